#!/usr/bin/env python3
"""A receiver of the visibility broadcast, wire format version 1.

Written from two pages: "The wire format, version 1" (the rules, whose numbers and names are used here) and "Does a receiver
conform?" (what comes in on standard input and what goes out on standard output). Plane 0, visibility, and plane 1 for
probabilities; without authentication. With --without-probability plane 0 alone is held, and no cell has a probability.

    gzip -dc logs/can-lossless.in.gz | python3 receiver.py
"""

import sys
import zlib
from binascii import crc_hqx
from functools import lru_cache

A = 300_000              # greatest age, microseconds like all times
D = 100_000              # greatest delay between measurement and reception
P = 5_120_000            # scan numbers come again
M = 2**40 * 1000         # the sender's clock comes again
TICK = 20_000
BASE = 0x400             # of the identifiers
PLANES = 1 if "--without-probability" in sys.argv else 2     # planes that are held, from 0 on
WIRE_VERSION = 1
ROOM_OF_WORDS = 36

# ---------------------------------------------------------------------------------------------------------------- Messages
# A message that passes is (number, epoch, own bytes).


def crc8_table():
    table = []
    for value in range(256):
        for _ in range(8):
            value = (value << 1 ^ 0x1D if value & 0x80 else value << 1) & 0xFF
        table.append(value)
    return table


CRC8 = crc8_table()


def crc8(data):
    value = 0
    for byte in data:
        value = CRC8[value ^ byte]
    return value


def data_id(sensor, number):
    return (0x8000 + 32 * sensor + number).to_bytes(2, "little")


def classic_message(sensor, number, data):
    """Profile 11; None if it does not pass."""
    if len(data) != 8 or data[1] & 15 == 15 or data[0] != crc8(data_id(sensor, number) + data[1:]):
        return None
    return number, data[1] >> 4, data[2:]


def long_message(data):
    """Profile 05; None if it does not pass. An authenticated one is left alone."""
    if not 6 <= len(data) <= 64 or data[3] > 31 or data[5] & 0xF0:
        return None
    if int.from_bytes(data[:2], "little") != crc_hqx(data[2:] + data_id(data[4], data[3]), 0xFFFF):
        return None
    return data[3], data[5] & 15, data[6:]


def cobs(stuffed):
    """The message without its stuffing; no bytes if a run goes beyond the end."""
    message, at = bytearray(), 0
    while at < len(stuffed):
        run = stuffed[at]
        if at + run > len(stuffed):
            return b""
        message += stuffed[at + 1:at + run]
        at += run
        if run < 255 and at < len(stuffed):
            message.append(0)
    return bytes(message)


# ------------------------------------------------------------------------------------------------------ Own bytes of header


def some_are_narrow(groups):
    """Whether the 30 bytes of groups 1 to 6 say that some azimuths are narrow."""
    return groups[19] > 127


def is_of_narrow(group):
    """Whether a group 7 is of narrow azimuths."""
    return group[2] == 0 and group[3] > 1


class Header:
    """What maps need of groups 1 to 6."""

    def __init__(self, groups, narrow):
        """`groups`: the 30 bytes of groups 1 to 6; `narrow`: group 7 of narrow azimuths, or None. ValueError if they are
        no header."""
        width = int.from_bytes(groups[17:19], "big")
        cell = int.from_bytes(groups[20:22], "big")
        first, last = groups[23], groups[24]
        self.azimuths = (groups[19] & 127) + 1
        checked = groups[:29]
        if some_are_narrow(groups):
            if narrow is None or not narrow[0] < narrow[1] <= self.azimuths or narrow[3] > 4:
                raise ValueError
            checked += narrow
        self.ranges = groups[22] + 1
        if groups[29] != crc8(checked) or width == 0 or cell == 0:
            raise ValueError
        if last >= self.ranges or first > last and (first, last) != (1, 0):
            raise ValueError
        usual_end = 0 if first > last else last + 1
        self.usual = (first, usual_end, cells_between(first, usual_end))


# --------------------------------------------------------------------------------------------------------------------- Rays
# A ray is (near, end, bits): bit c of `bits` is cell c; no known cells: (1, 0, 0).

NO_CELLS = (1, 0, 0)


@lru_cache(maxsize=None)             # of at most 257 * 257 pairs
def cells_between(near, end):
    return (1 << end) - 1 >> near << near


@lru_cache(maxsize=4096)
def edges_of(ray):
    """A bit for each edge."""
    near, end, bits = ray
    return (bits ^ bits << 1) & cells_between(near + 1, end)


def lowest(bits):
    return (bits & -bits).bit_length() - 1


@lru_cache(maxsize=4096)
def states_of(ray, ranges):
    """How many cells are visible and not visible, and the states of all cells: 0 unknown, 1 not visible, 2 visible."""
    near, end, bits = ray
    known = max(end - near, 0)
    states = format(bits >> near, "0%db" % known)[::-1].encode().translate(STATES) if known else b""
    visible = states.count(2)
    return visible, known - visible, bytes(near if known else 0) + states + bytes(ranges - (end if known else 0))


STATES = bytes.maketrans(b"01", b"\1\2")

# ------------------------------------------------------------------------------------------------------- The code of a block


class Missing(Exception):
    """A word or a refresh is needed and not there: the reading ends, what was read so far holds."""


class Malformed(Exception):
    """The block says what no sender says and ends there."""


class Numbers:
    """The words of a block, read as one big number."""

    def __init__(self, words, word_bits, most):
        self.words, self.word_bits, self.most = words, word_bits, most
        self.v, self.w, self.u = words[0], 1 << word_bits, 1

    def join(self):
        if self.w < 1 << 16 and self.u < self.most:
            if self.u == len(self.words):
                raise Missing
            self.v = self.v << self.word_bits | self.words[self.u]
            self.w <<= self.word_bits
            self.u += 1

    def symbol(self, table):
        if self.w < 1 << 16:
            self.join()
        # v < w * F / 256, rounded down, is the same as ((v + 1) * 256 - 1) / w < F
        s, below, above = table[((self.v << 8) + 255) // self.w]
        low = self.w * below >> 8
        self.v -= low
        self.w = (self.w * above >> 8) - low
        return s

    def plain(self, count):
        value = 0
        for _ in range(count):
            self.join()
            half = self.w >> 1
            if self.v < half:
                self.w = half
                value <<= 1
            else:
                self.v -= half
                self.w -= half
                value = value << 1 | 1
        return value

    def room(self):
        return self.w.bit_length() - 1 + (self.most - self.u) * self.word_bits


def tables(rows):
    """From frequencies, a row each, to lookup tables: for each 256th (symbol, sum of the frequencies before it, and with it)."""
    made = []
    for row in rows.split("\n"):
        table, below = [], 0
        for symbol, frequency in enumerate(map(int, row.split(","))):
            table += [(symbol, below, below + frequency)] * frequency
            below += frequency
        assert below == 256
        made.append(table)
    return made


AS_EXPECTED, EDGES, KNOWN = 0, 1, 2

# Rows: refresh first, previous as expected, previous otherwise; delta first, previous unchanged and as expected, unchanged
# otherwise, changed and as expected, changed otherwise; each without and with an edge expected.
RAY = tables("""28, 191, 37
85, 85, 86
242, 10, 4
121, 132, 3
190, 39, 27
58, 196, 2
196, 59, 1
32, 223, 1
252, 3, 1
192, 63, 1
245, 10, 1
139, 116, 1
211, 44, 1
101, 154, 1
177, 78, 1
51, 204, 1""")

FIRST = tables("""202, 54
253, 3""")

GONE, NEW = 11, 12
NONE, SAME, NEARER, FARTHER, OTHER = range(5)

# Rows: refresh, delta; each not visible, visible before it; each with last none, same, nearer, farther, other.
EDGE = tables("""1, 4, 17, 37, 114, 28, 30, 8, 4, 1, 1, 5, 6
2, 3, 4, 10, 48, 105, 54, 4, 3, 2, 2, 13, 6
12, 20, 32, 51, 60, 20, 3, 1, 1, 1, 1, 11, 43
1, 1, 1, 1, 2, 29, 79, 49, 27, 16, 8, 35, 7
3, 2, 3, 5, 6, 13, 6, 5, 3, 2, 2, 92, 114
2, 2, 4, 7, 30, 49, 60, 15, 7, 4, 2, 52, 22
3, 5, 8, 8, 19, 42, 46, 14, 8, 6, 3, 70, 24
1, 4, 10, 14, 19, 52, 21, 10, 5, 3, 2, 77, 38
2, 2, 3, 3, 15, 55, 42, 26, 14, 8, 5, 57, 24
2, 2, 4, 4, 8, 33, 13, 7, 7, 4, 3, 109, 60
2, 3, 5, 10, 45, 56, 59, 12, 4, 2, 2, 32, 24
1, 2, 2, 5, 23, 96, 38, 11, 7, 5, 5, 56, 5
11, 14, 24, 36, 51, 41, 8, 5, 4, 2, 2, 32, 26
1, 2, 3, 4, 6, 35, 56, 40, 25, 14, 10, 53, 7
5, 6, 7, 10, 16, 71, 13, 8, 6, 4, 3, 51, 56
1, 5, 8, 13, 24, 61, 32, 12, 5, 3, 1, 71, 20
1, 3, 5, 9, 16, 49, 23, 16, 6, 4, 1, 107, 16
1, 7, 12, 21, 17, 49, 15, 13, 8, 4, 1, 98, 10
1, 2, 3, 5, 9, 52, 30, 28, 17, 10, 1, 88, 10
1, 7, 15, 17, 14, 54, 21, 18, 15, 8, 1, 69, 16""")

# Rows: refresh, delta; each not visible, visible before it; each with last same, nearer, farther and with last none, other.
END = tables("""242, 14
115, 141
242, 14
136, 120
246, 10
156, 100
247, 9
199, 57""")

DISTANCE = tables("""6, 29, 41, 50, 42, 41, 45, 2
7, 12, 20, 34, 60, 64, 46, 13""")

LIMIT, = tables("100, 24, 59, 73")

STOP_ROWS = tables("""153, 103
200, 56
220, 36
232, 24
246, 10
253, 3
255, 1""")
STOP = [STOP_ROWS[sum(room >= least for least in (8, 12, 16, 20, 26, 34))] for room in range(49)]  # by room, 48 and more as one


def read_block(plane, delta, scan, first, numbers):
    """Reads the rays of a block and hands each to the plane. Returns when the block is complete; raises Missing or Malformed."""
    azimuths, ranges = plane.header.azimuths, plane.header.ranges
    named = scan - numbers.plain(4) - 1 & 255 if delta else None
    went_before = 0                     # the pair of rows of RAY
    ray = refresh = None                # of the azimuth before
    for azimuth in range(first, azimuths):
        if azimuth != first:
            room = numbers.room()
            if room < 4 or numbers.symbol(STOP[min(room, 48)]):
                return
        if delta:
            if plane.refreshes[azimuth] is None or plane.refreshes[azimuth][0] != named:
                raise Missing
            refresh_before, refresh = refresh, plane.refreshes[azimuth][1]
            near, end, bits = expected = refresh
            if azimuth != first and ray != refresh_before:
                not_as_it_was = ray[2] ^ refresh_before[2]
                bits = (bits & ~not_as_it_was | ray[2] & not_as_it_was) & cells_between(near, end)
                expected = (near, end, bits)
        else:
            expected = plane.header.usual if azimuth == first else ray
        edges = edges_of(expected)

        told_by = numbers.symbol(RAY[6 * delta + 2 * went_before + (edges != 0)])
        if told_by == AS_EXPECTED:
            ray = expected
        elif told_by == EDGES:
            ray = read_edges(numbers, delta, expected, edges, *expected[:2]) if expected[0] < expected[1] else NO_CELLS
        elif delta:
            raise Malformed
        else:
            near = read_limit(numbers, expected[0])
            end = read_limit(numbers, expected[1])
            if near < end <= ranges:
                ray = read_edges(numbers, delta, expected, edges, near, end)
            elif (near, end) == (1, 0):
                ray = NO_CELLS
            else:
                raise Malformed
        plane.ray_of_block(azimuth, scan, ray, delta)
        went_before = 1 + (ray != expected) + (2 * (ray != refresh) if delta else 0)


def read_limit(numbers, expected):
    told_by = numbers.symbol(LIMIT)
    if told_by == 3:
        return numbers.plain(9)
    limit = expected + (0, -1, 1)[told_by]
    if limit < 0:
        raise Malformed
    return limit


def read_edges(numbers, delta, expected, edges, near, end):
    bit = expected[2] >> expected[0] & 1 if expected[0] < expected[1] else 1
    if numbers.symbol(FIRST[bit]):
        bit ^= 1
    bits = cells_between(near, end) if bit else 0
    edges &= cells_between(0, end)
    place, search, last = near, near + 1, NONE          # `search` is the page's `from`
    while True:
        hint = None
        ahead = edges >> search
        if ahead:
            hint = search + lowest(ahead)
            if expected[2] >> hint & 1 == bit:
                ahead = edges >> hint + 1
                hint = hint + 1 + lowest(ahead) if ahead else None
        if hint is not None:
            answer = numbers.symbol(EDGE[10 * delta + 5 * bit + last])
            if answer == GONE:
                search, last = hint + 1, OTHER
                continue
            if answer == NEW:
                place, last = place + read_distance(numbers, bit), OTHER
            else:
                shift = answer - 5
                if hint + shift <= place:
                    raise Malformed
                place = hint + shift
                last = SAME if shift == 0 else NEARER if shift < 0 else FARTHER
        else:
            if numbers.symbol(END[4 * delta + 2 * bit + (last in (NONE, OTHER))]) == 0:
                return near, end, bits
            place, last = place + read_distance(numbers, bit), OTHER
        if place >= end:
            raise Malformed
        bit ^= 1
        bits ^= cells_between(place, end)
        search = max(search, place + 1)


def read_distance(numbers, bit):
    n = numbers.symbol(DISTANCE[bit])
    return (1 << n) + numbers.plain(n)


# ------------------------------------------------------------------------------------------------------ What a receiver does


class Receiver:
    """Hears a bus and answers for one sensor: rule 0, and which messages are the sensor's."""

    def __init__(self, bus, sensor):
        self.bus, self.number = bus, sensor
        self.latest = None
        self.stuffed = bytearray()
        self.sensor = Sensor()

    def time(self, t):
        """Rule 0."""
        if self.latest is not None and t < self.latest:
            if self.latest - t <= TICK:
                return self.latest
            self.sensor = Sensor()
        self.latest = t
        return t

    def frame(self, t, identifier, data):
        t = self.time(t)
        sensor, number = identifier - BASE >> 5, identifier & 31
        if sensor != self.number:
            return
        if self.bus == "can":
            message = classic_message(sensor, number, data)
        elif data[3:5] == bytes((number, sensor)):
            message = long_message(data)
        else:
            message = None
        if message:
            self.sensor.message(t, *message, self.bus != "can")

    def serial(self, t, data):
        """A piece of the stream; the time of a message is that of its zero byte."""
        *ended, rest = data.split(b"\0")
        for piece in ended:
            stuffed, self.stuffed = self.stuffed + piece, bytearray()
            if not stuffed:
                continue
            now = self.time(t)
            data = cobs(stuffed)
            if len(data) >= 6 and data[4] == self.number:
                message = long_message(data)
                if message:
                    self.sensor.message(now, *message, True)
        self.stuffed += rest

    def look(self, t):
        """What `states_of` says of each azimuth, azimuth 0 first; None if nothing is shown."""
        t = self.time(t)                # first: it may put another in the sensor's place
        return self.sensor.look(t)

    def probabilities(self, t):
        t = self.time(t)
        return self.sensor.probabilities(t)


class Plane:
    """What is held of a plane: rule 4 a to d."""

    def __init__(self):
        self.header = None
        self.empty()

    def empty(self):
        self.rays = [None] * 128        # of each azimuth: scan, ray
        self.refreshes = [None] * 128   # of each azimuth: scan, ray
        self.words = {}                 # (scan, first azimuth, which): (word, delta); in the order they came in

    def drop(self, old):                                                                                 # e
        self.rays = [None if held and held[0] in old else held for held in self.rays]
        self.refreshes = [None if held and held[0] in old else held for held in self.refreshes]
        self.words = {key: word for key, word in self.words.items() if key[0] not in old}

    def ray_of_block(self, azimuth, scan, ray, delta):                                                   # a
        held = self.rays[azimuth]
        if held is None or scan == held[0] or newer(scan, held[0]):
            if held is not None and held[1][:2] != ray[:2]:
                self.refreshes[azimuth] = None
            held = self.rays[azimuth] = (scan, ray)
        refresh = self.refreshes[azimuth]
        if not delta and held[1][:2] == ray[:2] and (refresh is None or not newer(refresh[0], scan)):
            self.refreshes[azimuth] = (scan, ray)

    def ray_of_cells(self, azimuth, scan):
        """Rule 4 b up to the first and last known cell: the held ray the cells go to, or None."""
        held = self.rays[azimuth]
        if held is None or newer(scan, held[0]):
            held = self.rays[azimuth] = (scan, NO_CELLS)
            self.refreshes[azimuth] = None
        return held[1] if held[0] == scan else None

    def put_cells(self, azimuth, scan, ray, near, end, bits):
        if ray[:2] != (near, end):
            self.refreshes[azimuth] = None
        self.rays[azimuth] = (scan, (near, end, bits & cells_between(near, end)))

    def known_cells(self, first, last):
        """near and end, or None if malformed."""
        if (first, last) == (1, 0):
            return 1, 0
        return (first, last + 1) if first <= last < self.header.ranges else None

    def classic_cells(self, scan, azimuth, segment, content):                                            # b
        if segment == 15:
            known = self.known_cells(content >> 21, content >> 13 & 255)
            ray = known and self.ray_of_cells(azimuth, scan)
            if ray:
                self.put_cells(azimuth, scan, ray, *known, ray[2])
        elif segment <= 8:
            ray = self.ray_of_cells(azimuth, scan)
            if ray:
                cells = int(format(content, "029b")[::-1], 2) << 29 * segment
                self.put_cells(azimuth, scan, ray, ray[0], ray[1], ray[2] | cells)

    def long_cells(self, scan, azimuth, content):                                                        # b
        known = self.known_cells(*content[:2]) if len(content) >= 2 else None
        if known and len(content) - 2 >= (known[1] + 7) // 8:
            ray = self.ray_of_cells(azimuth, scan)
            if ray:
                cells = "".join(format(byte, "08b") for byte in content[2:])
                self.put_cells(azimuth, scan, ray, *known, int("0" + cells[::-1], 2))

    def long_block(self, scan, azimuth, delta, content):                                                 # c
        words = [int.from_bytes(content[at:at + 4], "big") for at in range(0, min(len(content) // 4, 14) * 4, 4)]
        if words:
            try:
                read_block(self, delta, scan, azimuth, Numbers(words, 32, 14))
            except (Missing, Malformed):
                pass

    def word(self, scan, azimuth, which, word, delta):                                                   # d
        if self.words.pop((scan, azimuth, which), None):
            self.words[scan, azimuth, which] = (word, delta)
            return
        if len(self.words) == ROOM_OF_WORDS:
            del self.words[next(iter(self.words))]
        self.words[scan, azimuth, which] = (word, delta)
        keys = [(scan, azimuth, each) for each in range(4)]
        words = []
        for key in keys:
            if key not in self.words:
                break
            words.append(self.words[key][0])
        if len(words) <= which:
            return
        try:
            read_block(self, self.words[keys[0]][1], scan, azimuth, Numbers(words, 33, 4))
        except Missing:
            return
        except Malformed:
            pass
        for key in keys:
            self.words.pop(key, None)


class Sensor:
    """What is known of a sensor: rules 1 to 5."""

    def __init__(self):
        self.session = None             # its epoch
        self.levels = None
        self.came = {}                  # epoch: when its last frame came to rule 1 c
        self.left = {}                  # epoch: when rule 1 c ended a session of it
        self.left_last = (None, None)   # epoch, smallest lag of its measure then

    def begin(self, t, epoch):
        """A session begins: nothing is held."""
        self.session, self.last_frame = epoch, t
        self.conflict = self.other_version = None       # last sign of it
        self.in_doubt = False
        self.misfit = None              # noted time, rule 3 a
        self.groups = [None] * 8        # in the last place group 7 of narrow azimuths
        self.header = None
        self.levels = None              # group 7; b"" once it was contradicted
        self.planes = [Plane() for _ in range(PLANES)]
        self.has_clock = self.has_measure = False
        self.last_in_time = t
        self.empty_maps()

    def empty_maps(self):
        for plane in self.planes:
            plane.empty()
        self.looked_after = None        # scan of the frame with which rule 4 e was seen to

    # Rule 1

    def message(self, t, number, epoch, own, long):
        if number in (4, 5) or number >= 24:
            return
        dated = (number == 2 or number >= 6) and len(own) >= 3
        if not self.in_session(t, epoch, own[0] if dated else None):
            return
        if number == 1:
            self.header_message(t, own, long)
        elif dated and self.in_time(t, own[0]):
            self.map_message(t, number, own, long)
        # The status changes no map.

    def in_session(self, t, epoch, scan):
        """True if the frame is one of the session. `scan` of a dated message, or None."""
        silent = P + 1 if self.session is None else t - self.last_frame
        if epoch == self.session and silent <= P:                                                        # a
            self.last_frame = t
            return True
        if silent <= 2_560_000:                                                                          # b
            since = t // 1000 - self.left[epoch] // 1000 if epoch in self.left else None
            left = since is not None and since <= 5120
            if left and since <= (A + D) // 1000:
                return False
            if left or self.signed(self.conflict, t):
                if scan is not None and self.speaks_now(t, epoch, scan, left):
                    self.conflict = t
                return False
        before = self.came.get(epoch)                                                                    # c
        self.left.pop(epoch, None)
        if before is None or t // 1000 - before // 1000 > (A + D) // 1000:
            self.came[epoch] = t
            return False
        self.came.pop(epoch)
        if self.session is not None and self.session != epoch:
            self.came.pop(self.session, None)
            self.left[self.session] = t
            self.left_last = (self.session, self.smallest_lag(t) if self.has_measure else None)
        self.begin(t, epoch)
        return True

    def speaks_now(self, t, epoch, scan, left):
        last, smallest = self.left_last
        if epoch == last and smallest is not None:
            late = (lag(t, scan) - smallest) % P
            return late <= D or late > P // 2
        return not left

    @staticmethod
    def signed(sign, t):
        """A conflict, or another version, lasts."""
        return sign is not None and t - sign < 1_000_000

    # Rule 2

    def header_message(self, t, own, long):
        if own and own[0] & 15 != WIRE_VERSION:
            self.other_version = t
            return
        if len(own) < 6:
            return
        if long and len(own) >= 36:
            coming = {group: own[1 + 5 * group:6 + 5 * group] for group in range(7)}
            sevens = [own[at:at + 5] for at in range(36, len(own) - 4, 5)]
        else:
            coming = {own[0] >> 4 & 7: own[1:6]}
            sevens = [coming.pop(7)] if 7 in coming else []
        narrow = next((seven for seven in sevens if is_of_narrow(seven)), None)
        if len(coming) == 7:
            try:
                Header(own[6:36], narrow)
            except ValueError:
                return
        clock = coming.pop(0, None)
        if narrow is not None:
            coming[7] = narrow
        for group, content in coming.items():
            if self.groups[group] not in (None, content):
                self.conflict = t
                return
        for group, content in coming.items():
            self.groups[group] = content
        if self.header is None and None not in self.groups[1:7]:
            groups = b"".join(self.groups[1:7])
            if not some_are_narrow(groups) or self.groups[7] is not None:
                try:
                    self.header = Header(groups, self.groups[7])
                except ValueError:
                    self.groups = [None] * 8
        for levels in sevens:
            if levels[2] > 0 and levels[0] <= levels[1] <= levels[2]:
                self.levels = levels if self.levels in (None, levels) else b""
        if clock:
            self.group_0(t, int.from_bytes(clock, "big") * 1000)

    def group_0(self, t, c):
        if not self.has_clock:                                                                           # a
            self.has_clock = True
            self.clock_at = self.clock_begun = t
            self.clock_us, self.confirmed = c, False
        else:                                                                                            # b
            ahead = (c - self.senders_clock(t)) % M
            faster = ahead < M // 2
            if faster and ahead > D:
                self.clock_begun, self.confirmed = t, False
            elif (faster or M - ahead <= D) and t - self.clock_begun >= A + D:
                self.confirmed = True
            if faster:
                self.clock_at, self.clock_us = t, c
        if self.has_measure and D < (self.clock_lag(t) - self.smallest_lag(t)) % P <= P // 2:            # c
            self.has_measure = False
            self.empty_maps()

    def senders_clock(self, t):
        """S(t)"""
        p = t - self.clock_at
        return (self.clock_us + p - (p >> 11)) % M

    def clock_lag(self, t):
        """L(t)"""
        return (t - self.senders_clock(t)) % P

    # Rule 3

    def settled(self, t):
        return t - self.begun >= A + D and self.count >= 8

    def fits(self, t):
        return (self.smallest_lag(t) + D - self.clock_lag(t)) % P <= 2 * D + 25_000

    def smallest_lag(self, t):
        """m(t)"""
        return (self.lag + (t - self.at >> 11)) % P

    def in_time(self, t, scan):
        """True if a dated message is accepted."""
        of = lag(t, scan)
        x = (self.clock_lag(t) - of) % P if self.has_clock else 0                                        # b
        sure = self.has_measure and self.has_clock and self.confirmed and self.settled(t) and self.fits(t)
        ahead = D < x <= 1_500_000 and not sure
        refused = (D if sure else 1_500_000) < x <= P // 2
        late = (of - self.smallest_lag(t)) % P if self.has_measure else 0
        if D < late <= P // 2:                                                                           # d
            refused = True
        if not refused and not ahead:                                                                    # a
            self.misfit = None
        elif self.misfit is None:
            self.misfit = t
        elif t - self.misfit >= P:
            self.has_clock, self.misfit = False, None
            if refused:
                return self.measure_anew(t, of)
        if refused:
            self.in_doubt = True
            return False
        if not self.has_measure:                                                                         # c
            return self.measure_anew(t, of)
        if late > P // 2:                                                                                # d
            self.sunk = max(0, self.sunk - (t - self.at >> 10)) + P - late
            if self.sunk > D:
                return self.measure_anew(t, of)
            self.at, self.lag = t, of
        if t - self.last_in_time > A and not self.settled(self.last_in_time):
            self.begun, self.count = t, 0
        self.count += 1
        if t - self.last_in_time > 1_000_000:
            self.empty_maps()
        self.last_in_time = t
        return True

    def measure_anew(self, t, of):                                                                       # e
        self.empty_maps()
        self.has_measure = True
        self.begun = self.at = self.last_in_time = t
        self.lag, self.sunk, self.count = of, 0, 1
        return True

    # Rule 4

    def map_message(self, t, number, own, long):
        self.drop_old(t, own[0])
        if number < 6:
            return                      # the visible range is dated, but no map
        place, kind = divmod(number - 6, 6)
        if self.header is None or place >= PLANES:
            return
        plane = self.planes[place]
        plane.header = self.header
        scan = own[0]
        if long:
            if own[1] >= self.header.azimuths:
                return
            if kind in (0, 1):
                plane.long_block(scan, own[1], kind, own[2:])
            elif kind == 5:
                plane.long_cells(scan, own[1], own[2:])
        else:
            big = int.from_bytes(own, "big")
            azimuth = big >> 33 & 127
            if azimuth >= self.header.azimuths:
                return
            if kind == 5:
                plane.classic_cells(scan, azimuth, big >> 29 & 15, big & (1 << 29) - 1)
            else:
                plane.word(scan, azimuth, max(kind - 1, 0), big & (1 << 33) - 1, kind == 1)

    def drop_old(self, t, scan):                                                                         # e
        if scan == self.looked_after:
            return
        self.looked_after = scan
        smallest = self.smallest_lag(t)
        old = {each for each in range(256) if (lag(t, each) - smallest) % P > 1_000_000}
        for plane in self.planes:
            plane.drop(old)

    # Rule 5

    def shown(self, t):
        """Of both planes the rays that are shown; None if nothing is."""
        if self.session is None or self.header is None or not self.has_measure or not self.has_clock:
            return None
        smallest = self.smallest_lag(t)
        if (not self.settled(t)
                or t - self.last_in_time > A
                or self.in_doubt and not self.confirmed
                or not self.fits(t)
                or self.signed(self.conflict, t) or self.signed(self.other_version, t)):
            return None
        return [[held[1] if held and (lag(t, held[0]) - smallest) % P + 25_000 <= A else NO_CELLS
                 for held in plane.rays[:self.header.azimuths]] for plane in self.planes]

    def look(self, t):
        planes = self.shown(t)
        return planes and [states_of(ray, self.header.ranges) for ray in planes[0]]

    def probabilities(self, t):
        """How many cells have one, and the least of every cell, azimuth by azimuth; 0 for none."""
        planes = self.shown(t) if self.levels and PLANES == 2 else None
        known, all_cells = 0, bytearray()
        for (near, end, visible), (n, e, clear) in zip(*planes) if planes else ():
            clear &= visible & cells_between(n, e)
            cells = bytearray(self.header.ranges)
            for cell in range(near, end):
                known += 1
                cells[cell] = self.levels[(visible >> cell & 1) + (clear >> cell & 1)]
            all_cells += cells
        return known, bytes(all_cells)


def lag(t, scan):
    """Of a dated message received at t, or of a scan at t."""
    return (t - TICK * scan) % P


def newer(scan, than):
    return 1 <= (scan - than) % 256 <= 127


# ------------------------------------------------------------------------------------------- How it is fed, how it answers


def answer(time, rows):
    visible = invisible = crc = 0
    if rows:
        visible, invisible = sum(row[0] for row in rows), sum(row[1] for row in rows)
    if visible or invisible:
        crc = zlib.crc32(b"".join(row[2] for row in rows))
    return "%s %d %d %08x" % (time, visible, invisible, crc)


def answer_cells(time, rows):
    if not rows or not any(row[0] or row[1] for row in rows):
        return time
    return " ".join([time] + [row[2].translate(bytes.maketrans(b"\0\1\2", b"?#.")).decode() for row in rows])


def answer_probability(time, known, cells):
    return "%s p %d %d %08x" % (time, known, sum(cells), zlib.crc32(cells) if known else 0)


def data_of(field):
    return b"" if field == "-" else bytes.fromhex(field)


def main():
    receiver = None
    for line in sys.stdin:
        what, *fields = line.split()
        if what == "start":
            receiver = Receiver(fields[0], int(fields[1]))
        elif what == "frame":
            receiver.frame(int(fields[0]), int(fields[1], 16), data_of(fields[2]))
        elif what == "bytes":
            receiver.serial(int(fields[0]), data_of(fields[1]))
        elif what == "look":
            print(answer(fields[0], receiver.look(int(fields[0]))))
        elif what == "cells":
            print(answer_cells(fields[0], receiver.look(int(fields[0]))))
        elif what == "probability":
            print(answer_probability(fields[0], *receiver.probabilities(int(fields[0]))))


if __name__ == "__main__":
    main()
