/* A receiver of visibility maps in C, written from src/wire/SPECIFICATION.md.
 *
 *     cc -O2 -o receiver receiver.c && ./receiver LOG [KEY]
 *
 * Reads a log of `candump -L` (classic CAN and CAN FD, sensors 0 to 7 from 0x400 on, the visibility plane), or of a serial line, chunk by
 * chunk: `(seconds) device bytes`. With a key, 32 hexadecimal digits, it takes authenticated messages and no others. Prints, whenever 100 ms of the log are over, for every sensor whose map is told:
 *
 *     microseconds sensor visible invisible hash
 *
 * with the number of visible and of invisible cells and a hash (FNV-1a) of all cells: 0 unknown, 1 not visible, 2 visible,
 * azimuth by azimuth, near to far. `receiver --cmac KEY [MESSAGE]` prints a message's authentication code. Rules by their numbers are those of "What a receiver does".
 */
#include <inttypes.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cmac.h"
#include "tables.h"

#define SENSORS 8
#define AZIMUTHS 128
#define CELLS 256
#define SLOTS 4
#define PERIOD 5120000 /* us, of the scan numbers */
#define A_US 300000
#define D_US 100000
#define NEVER UINT64_MAX

/* An azimuth: known cells near to end - 1, and a bit for each. */
typedef struct { int near, end; uint8_t bit[CELLS]; } ray_t;

static const ray_t NOTHING = {1, 0, {0}};

static bool same(const ray_t *a, const ray_t *b) {
    return a->near == b->near && a->end == b->end && memcmp(a->bit, b->bit, CELLS) == 0;
}

/* Clears what lies outside the known cells. */
static void trim(ray_t *r) {
    for (int c = 0; c < CELLS; c++)
        if (c < r->near || c >= r->end) r->bit[c] = 0;
}

/* Known cells from limits as they are told. */
static bool known(ray_t *r, int near, int end) {
    if (near < end && end <= CELLS) { r->near = near; r->end = end; return true; }
    r->near = 1; r->end = 0;
    return near == 1 && end == 0;
}

typedef struct { bool there; int scan, start, delta, have; uint64_t word[4]; unsigned touched; } slot_t;

typedef struct {
    /* session */
    int epoch; /* -1: none */
    uint64_t heard, begun, crept, map_heard, late_since, conflict;
    uint32_t least;
    int count;
    uint64_t left[16];
    int previous; uint32_t previous_least;
    /* header */
    uint8_t group[7][5]; int groups; bool complete, usable;
    int azimuths, ranges, usual_near, usual_end;
    /* maps */
    bool there[AZIMUTHS], refreshed[AZIMUTHS];
    int now_scan[AZIMUTHS], was_scan[AZIMUTHS];
    ray_t now[AZIMUTHS], was[AZIMUTHS];
    slot_t slot[SLOTS]; unsigned touches;
    /* authentication */
    bool fresh; uint64_t freshness;
} sensor_t;

static sensor_t sensors[SENSORS];
static uint8_t key[16];
static bool keyed;

/* ---- check sums ---- */

static uint8_t crc8(uint8_t sum, const uint8_t *p, int n) {
    while (n--) {
        sum ^= *p++;
        for (int i = 0; i < 8; i++) sum = (uint8_t)(sum & 0x80 ? sum << 1 ^ 0x1D : sum << 1);
    }
    return sum;
}

static uint16_t crc16(uint16_t sum, const uint8_t *p, int n) {
    while (n--) {
        sum ^= (uint16_t)(*p++ << 8);
        for (int i = 0; i < 8; i++) sum = (uint16_t)(sum & 0x8000 ? sum << 1 ^ 0x1021 : sum << 1);
    }
    return sum;
}

/* ---- the number code ---- */

typedef struct { const uint64_t *word; int words, bits, most, used; uint64_t v, w; bool out; } number_t;

static void join_word(number_t *n) {
    if (n->w >= 65536 || n->used >= n->most) return;
    if (n->used >= n->words) { n->out = true; return; }
    n->v = (n->v << n->bits) + n->word[n->used++];
    n->w <<= n->bits;
}

static int symbol(number_t *n, const uint8_t *f, int count) {
    join_word(n);
    if (n->out) return -1;
    uint64_t below = 0, low = 0;
    for (int s = 0; s < count; s++) {
        below += f[s];
        uint64_t high = n->w * below >> 8;
        if (n->v < high) { n->v -= low; n->w = high - low; return s; }
        low = high;
    }
    return -1;
}

static int plain(number_t *n, int bits) {
    int value = 0;
    while (bits-- > 0) {
        join_word(n);
        if (n->out) return -1;
        uint64_t half = n->w / 2;
        if (n->v < half) { n->w = half; value *= 2; }
        else { n->v -= half; n->w -= half; value = 2 * value + 1; }
    }
    return value;
}

static int room(const number_t *n) {
    int log = 0;
    while (log < 63 && n->w >> (log + 1)) log++;
    return log + (n->most - n->used) * n->bits;
}

/* ---- rays ---- */

/* The first edge at or behind a cell; -1 for none. */
static int edge_from(const ray_t *r, int from) {
    if (from <= r->near) from = r->near + 1;
    for (int c = from; c < r->end; c++)
        if (r->bit[c] != r->bit[c - 1]) return c;
    return -1;
}

static int hint_of(const ray_t *expected, int from, int bit, int end) {
    int at = edge_from(expected, from);
    if (at >= 0 && expected->bit[at] == bit) at = edge_from(expected, at + 1);
    return at >= 0 && at < end ? at : -1;
}

/* How far the next edge lies; 0 if words or sense are missing. */
static int distance(number_t *n, int bit) {
    int bits = symbol(n, DISTANCE[bit], 8);
    int low = bits < 0 ? -1 : plain(n, bits);
    return low < 0 ? 0 : (1 << bits) + low;
}

static int limit(number_t *n, int expected) {
    switch (symbol(n, LIMIT, 4)) {
    case 0: return expected;
    case 1: return expected - 1;
    case 2: return expected + 1;
    case 3: return plain(n, 9);
    default: return -1;
    }
}

enum { NONE, SAME, NEARER, FARTHER, OTHER };

/* Reads the edges of a ray whose known cells are set. */
static bool edges(number_t *n, int kind, const ray_t *expected, ray_t *ray) {
    int bit = expected->end <= expected->near || expected->bit[expected->near];
    int turned = symbol(n, FIRST[bit], 2);
    if (turned < 0) return false;
    bit ^= turned;
    int place = ray->near, from = ray->near + 1, last = NONE;
    memset(ray->bit, 0, CELLS);
    for (int turns = 0; turns < 2 * CELLS; turns++) {
        int hint = hint_of(expected, from, bit, ray->end), next;
        if (hint >= 0) {
            int s = symbol(n, EDGE[kind][bit][last], 13);
            if (s < 0) return false;
            if (s == 11) { last = OTHER; from = hint + 1; continue; }
            if (s == 12) {
                int d = distance(n, bit);
                if (!d) return false;
                next = place + d;
                last = OTHER;
            } else {
                next = hint + s - 5;
                last = s < 5 ? NEARER : s == 5 ? SAME : FARTHER;
                if (next <= place) return false;
            }
        } else {
            int s = symbol(n, END[kind][bit][last == NONE || last == OTHER], 2);
            if (s < 0) return false;
            if (s == 0) {
                for (int c = place; c < ray->end; c++) ray->bit[c] = (uint8_t)bit;
                return true;
            }
            int d = distance(n, bit);
            if (!d) return false;
            next = place + d;
            last = OTHER;
        }
        if (next >= ray->end) return false;
        for (int c = place; c < next; c++) ray->bit[c] = (uint8_t)bit;
        place = next;
        bit = !bit;
        if (from < place + 1) from = place + 1;
    }
    return false;
}

/* Whether a scan is newer than another. */
static bool newer(int scan, int other) {
    int ticks = (scan - other) & 255;
    return ticks >= 1 && ticks <= 127;
}

/* Rule 4. */
static void take(sensor_t *s, int azimuth, int scan, const ray_t *ray, bool refresh) {
    if (!s->there[azimuth] || newer(scan, s->now_scan[azimuth]) || scan == s->now_scan[azimuth]) {
        if (s->there[azimuth] && (s->now[azimuth].near != ray->near || s->now[azimuth].end != ray->end))
            s->refreshed[azimuth] = false;
        s->now[azimuth] = *ray;
        s->now_scan[azimuth] = scan;
        s->there[azimuth] = true;
    }
    bool cells = s->now[azimuth].near == ray->near && s->now[azimuth].end == ray->end;
    if (refresh && cells && (!s->refreshed[azimuth] || !newer(s->was_scan[azimuth], scan))) {
        s->was[azimuth] = *ray;
        s->was_scan[azimuth] = scan;
        s->refreshed[azimuth] = true;
    }
}

/* Reads what is there of a block. */
static void block(sensor_t *s, int delta, int scan, int start, const uint64_t *word, int words, int bits, int most) {
    static const int classes[7] = {8, 12, 16, 20, 26, 34, 48};
    number_t n = {word, words, bits, most, 1, word[0], UINT64_C(1) << bits, false};
    int base = 0;
    if (delta) {
        int age = plain(&n, 4);
        if (age < 0) return;
        base = (scan - age - 1) & 255;
    }
    bool first = true, as_expected = true, unchanged = true;
    ray_t before = NOTHING, before_was = NOTHING, expected, ray;
    for (int a = start; a < s->azimuths; a++) {
        if (!first) {
            int r = room(&n), k = 0;
            if (r < 4) return;
            while (k < 7 && r >= classes[k]) k++;
            if (symbol(&n, STOP[k], 2) != 0) return;
        }
        const ray_t *was = &NOTHING;
        if (delta) {
            if (!s->refreshed[a] || s->was_scan[a] != base) return;
            was = &s->was[a];
            expected = *was;
            if (!first) {
                for (int c = 0; c < CELLS; c++)
                    if (before.bit[c] != before_was.bit[c]) expected.bit[c] = before.bit[c];
                trim(&expected);
            }
        } else if (first) {
            expected = NOTHING;
            known(&expected, s->usual_near, s->usual_end);
            memset(expected.bit, 1, CELLS);
            trim(&expected);
        } else {
            expected = before;
        }
        int row = delta ? (first ? 3 : 4 + (unchanged ? 0 : 2) + (as_expected ? 0 : 1)) : (first ? 0 : as_expected ? 1 : 2);
        int told = symbol(&n, RAY[row][edge_from(&expected, 0) >= 0], 3);
        if (told < 0) return;
        if (told == 0) {
            ray = expected;
        } else {
            ray = NOTHING;
            ray.near = expected.near;
            ray.end = expected.end;
            if (told == 2) {
                if (delta) return;
                int near = limit(&n, expected.near);
                int end = n.out || near < 0 ? -1 : limit(&n, expected.end);
                if (near < 0 || end < 0 || !known(&ray, near, end)) return;
            }
            if (ray.near < ray.end && !edges(&n, delta, &expected, &ray)) return;
        }
        as_expected = same(&ray, &expected);
        unchanged = delta && same(&ray, was);
        before = ray;
        before_was = *was;
        first = false;
        /* `was` may point into what is replaced here, so it is not used any more */
        take(s, a, scan, &ray, !delta);
    }
}

/* ---- session: rules 1 to 3 ---- */

static void forget_maps(sensor_t *s) {
    memset(s->there, 0, sizeof s->there);
    memset(s->refreshed, 0, sizeof s->refreshed);
    memset(s->slot, 0, sizeof s->slot);
}

static void begin_measure(sensor_t *s) { s->begun = s->late_since = NEVER; s->count = 0; }

static void begin(sensor_t *s, uint64_t now, int epoch) {
    if (s->epoch >= 0 && s->epoch != epoch) {
        s->left[s->epoch] = now;
        s->previous = s->begun != NEVER ? s->epoch : -1;
        s->previous_least = s->least;
    }
    s->left[epoch] = NEVER;
    s->epoch = epoch;
    s->heard = now;
    s->conflict = NEVER;
    s->groups = 0;
    s->complete = false;
    s->usable = true;
    begin_measure(s);
    forget_maps(s);
}

static bool conflicting(const sensor_t *s, uint64_t now) { return s->conflict != NEVER && now - s->conflict < 1000000; }

static uint32_t lag_of(uint64_t now, int scan) {
    return (uint32_t)((now % PERIOD + PERIOD - (uint64_t)scan * 20000) % PERIOD);
}

static uint32_t behind(uint32_t lag, uint32_t least) { return (lag + PERIOD - least) % PERIOD; }

/* Whether a frame is of the session; scan is -1 where it has none. */
static bool enter(sensor_t *s, uint64_t now, int epoch, int scan) {
    if (s->epoch < 0 || now < s->heard || now - s->heard > PERIOD / 2) { begin(s, now, epoch); return true; }
    if (epoch == s->epoch) { s->heard = now; return true; }
    uint64_t since = s->left[epoch] == NEVER ? NEVER : (now / 1000 - s->left[epoch] / 1000) * 1000;
    if (since != NEVER && since > PERIOD) s->left[epoch] = NEVER;
    if (since <= A_US + D_US) return false;
    if (conflicting(s, now) || since <= PERIOD) {
        bool speaks = false;
        if (scan >= 0 && s->previous == epoch) {
            uint32_t late = behind(lag_of(now, scan), s->previous_least);
            speaks = late <= D_US || late > PERIOD / 2;
        } else if (scan >= 0) {
            speaks = s->left[epoch] == NEVER;
        }
        if (speaks) s->conflict = now;
        return false;
    }
    begin(s, now, epoch);
    return true;
}

static bool begin_with(sensor_t *s, uint64_t now, uint32_t lag) {
    begin_measure(s);
    s->begun = s->crept = s->map_heard = now;
    s->least = lag;
    s->count = 1;
    return true;
}

/* Rule 2: whether a map frame is in time. */
static bool hear(sensor_t *s, uint64_t now, int scan) {
    uint32_t lag = lag_of(now, scan);
    if (s->begun == NEVER) return begin_with(s, now, lag);
    uint64_t steps = (now - s->crept) >> 11;
    s->least = (uint32_t)((s->least + steps) % PERIOD);
    s->crept += steps << 11;
    uint32_t late = behind(lag, s->least);
    if (late > D_US && late <= PERIOD / 2) {
        if (s->late_since == NEVER) s->late_since = now;
        if (now - s->late_since < PERIOD) return false;
        forget_maps(s);
        return begin_with(s, now, lag);
    }
    if (late > PERIOD / 2) {
        if (PERIOD - late > D_US) { forget_maps(s); return begin_with(s, now, lag); }
        s->least = lag;
        s->crept = now;
    }
    s->late_since = NEVER;
    s->map_heard = now;
    if (s->count < 255) s->count++;
    return true;
}

/* Rule 5, the dropping. */
static void purge(sensor_t *s, uint64_t now) {
    for (int a = 0; a < AZIMUTHS; a++) {
        if (s->there[a] && behind(lag_of(now, s->now_scan[a]), s->least) > 1000000) s->there[a] = s->refreshed[a] = false;
        if (s->refreshed[a] && behind(lag_of(now, s->was_scan[a]), s->least) > 1000000) s->refreshed[a] = false;
    }
    for (int i = 0; i < SLOTS; i++)
        if (s->slot[i].there && behind(lag_of(now, s->slot[i].scan), s->least) > 1000000) s->slot[i].there = false;
}

static bool trusted(const sensor_t *s, uint64_t now) {
    return s->epoch >= 0 && s->complete && s->usable && s->begun != NEVER && now - s->begun >= A_US + D_US &&
           now - s->map_heard <= A_US && s->count >= 8 && !conflicting(s, now);
}

static bool told(const sensor_t *s, uint64_t now, int a) {
    return s->there[a] && behind(lag_of(now, s->now_scan[a]), s->least) + 25000 <= A_US;
}

/* ---- messages ---- */

static void header(sensor_t *s, uint64_t now, const uint8_t *own, int n) {
    if (n < 6) return;
    if ((own[0] & 15) != 1) { s->usable = false; return; }
    int first = own[0] >> 4 & 7, count = n >= 36 ? 7 : 1;
    uint8_t all[7][5];
    for (int g = 0; g < count; g++) memcpy(all[count == 7 ? g : first], own + 1 + 5 * g, 5);
    for (int g = 1; g < 7; g++) {
        if (count == 1 && g != first) continue;
        if (s->groups >> g & 1 && memcmp(s->group[g], all[g], 5)) { s->conflict = now; return; }
        memcpy(s->group[g], all[g], 5);
        s->groups |= 1 << g;
    }
    if (s->groups != 0x7E || s->complete) return;
    uint8_t check = crc8(0, s->group[1], 29);
    const uint8_t *g4 = s->group[4], *g5 = s->group[5];
    if (check != s->group[6][4]) { s->groups = 0; return; }
    s->azimuths = g4[4] + 1;
    s->ranges = g5[2] + 1;
    s->usual_near = g5[3];
    s->usual_end = g5[3] == 1 && g5[4] == 0 ? 0 : g5[4] + 1;
    if (s->azimuths > AZIMUTHS) { s->groups = 0; return; }
    s->complete = true;
}

static void plain_cells(sensor_t *s, int scan, int a, const uint8_t *own, int n, uint64_t word, bool is_long) {
    if (!s->there[a] || newer(scan, s->now_scan[a])) {
        s->now[a] = NOTHING;
        s->now_scan[a] = scan;
        s->there[a] = true;
        s->refreshed[a] = false;
    }
    if (s->now_scan[a] != scan) return;
    ray_t *r = &s->now[a];
    if (is_long) {
        ray_t whole = NOTHING;
        if (n < 4 || !known(&whole, own[2], own[2] == 1 && own[3] == 0 ? 0 : own[3] + 1) || whole.end > 8 * (n - 4)) return;
        for (int c = 0; c < whole.end; c++) whole.bit[c] = own[4 + c / 8] >> (7 - c % 8) & 1;
        trim(&whole);
        *r = whole;
        return;
    }
    int segment = (int)(word >> 29);
    if (segment == 15) {
        int near = word >> 21 & 255, last = word >> 13 & 255;
        known(r, near, near == 1 && last == 0 ? 0 : last + 1);
    } else if (segment < 9) {
        for (int i = 0; i < 29 && 29 * segment + i < CELLS; i++)
            if (word >> (28 - i) & 1) r->bit[29 * segment + i] = 1;
    }
    trim(r);
}

static void classic_word(sensor_t *s, int scan, int start, int index, int delta, uint64_t word) {
    int at = -1, oldest = 0;
    for (int i = 0; i < SLOTS; i++) {
        if (s->slot[i].there && s->slot[i].scan == scan && s->slot[i].start == start) at = i;
        if (!s->slot[i].there ? s->slot[oldest].there : s->slot[oldest].there && s->slot[i].touched < s->slot[oldest].touched)
            oldest = i;
    }
    if (at < 0) {
        at = oldest;
        s->slot[at] = (slot_t){.there = true, .scan = scan, .start = start};
    }
    slot_t *slot = &s->slot[at];
    slot->touched = ++s->touches;
    slot->word[index] = word;
    int words = 0, before = 0;
    while (before < 4 && slot->have >> before & 1) before++;
    slot->have |= 1 << index;
    while (words < 4 && slot->have >> words & 1) words++;
    if (index == 0) slot->delta = delta;
    if (words > before) block(s, slot->delta, scan, start, slot->word, words, 33, 4);
}

static void message(sensor_t *s, uint64_t now, int number, int epoch, const uint8_t *own, int n, bool is_long, int most) {
    bool map = number >= 6 && number < 24;
    /* from anybody, of no epoch */
    if (number >= 24) return;
    if (!enter(s, now, epoch, (map || number == 2) && n > 0 ? own[0] : -1)) return;
    if (number == 1) header(s, now, own, n);
    if (number == 2 && n > 2) { if (hear(s, now, own[0])) purge(s, now); }
    if (!map || n < (is_long ? 2 : 6)) return;
    int scan = own[0], start = is_long ? own[1] : own[1] >> 1;
    if (!hear(s, now, scan)) return;
    purge(s, now);
    int part = (number - 6) % 6;
    if (!s->complete || !s->usable || start >= s->azimuths || number >= 12) return;
    uint64_t word[14] = {0};
    int words = 1;
    if (is_long) {
        words = (n - 2) / 4 < most ? (n - 2) / 4 : most;
        for (int i = 0; i < words; i++)
            for (int k = 0; k < 4; k++) word[i] = word[i] << 8 | own[2 + 4 * i + k];
    } else {
        word[0] = own[1] & 1;
        for (int k = 2; k < 6; k++) word[0] = word[0] << 8 | own[k];
    }
    if (part == 5) plain_cells(s, scan, start, own, n, word[0], is_long);
    else if (is_long) { if (part < 2 && words > 0) block(s, part, scan, start, word, words, 32, most); }
    else classic_word(s, scan, start, part < 2 ? 0 : part - 1, part == 1, word[0]);
}

/* Whether the last 8 bytes of a message are its sender's, and it is new. */
static bool authentic(sensor_t *s, unsigned data_id, const uint8_t *data, int n) {
    if (n < 6 + 8) return false;
    const uint8_t *seal = data + n - 8;
    uint64_t low = (uint64_t)(seal[0] << 8 | seal[1]), f = 0;
    if (data[3] == 3) {
        if (n < 6 + 8 + 8) return false;
        for (int i = 0; i < 8; i++) f = f << 8 | data[6 + i];
        if ((f & 0xFFFF) != low || (s->fresh && f <= s->freshness)) return false;
    } else {
        if (!s->fresh) return false;
        f = (s->freshness & ~UINT64_C(0xFFFF)) | low;
        if (f <= s->freshness) f += 0x10000;
    }
    uint8_t covered[10 + 64] = {(uint8_t)(data_id >> 8), (uint8_t)data_id}, code[16];
    for (int i = 0; i < 8; i++) covered[2 + i] = (uint8_t)(f >> (56 - 8 * i));
    memcpy(covered + 10, data + 3, (size_t)(n - 3 - 8));
    cmac(key, covered, 10 + n - 3 - 8, code);
    if (memcmp(code, seal + 2, 6) != 0) return false;
    s->fresh = true;
    s->freshness = f;
    return true;
}

/* Checks a long message and takes it. */
static void long_message(uint64_t now, const uint8_t *data, int n) {
    if (n < 6 || n > 64 || data[3] >= 32 || data[4] >= SENSORS) return;
    int number = data[3];
    sensor_t *s = &sensors[data[4]];
    unsigned data_id = 0x8000u + 32u * data[4] + (unsigned)number;
    uint8_t data_id_bytes[2] = {(uint8_t)data_id, (uint8_t)(data_id >> 8)};
    if (crc16(crc16(0xFFFF, data + 2, n - 2), data_id_bytes, 2) != (data[0] | data[1] << 8)) return;
    bool secured = data[5] & 0x80;
    if (secured != keyed || (secured && !authentic(s, data_id, data, n))) return;
    message(s, now, number, data[5] & 15, data + 6, n - 6 - (secured ? 8 : 0), true, secured ? 12 : 14);
}

/* Checks a frame and takes it. */
static void frame(uint64_t now, unsigned id, const uint8_t *data, int n, bool fd) {
    if (id < 0x400 || id >= 0x500) return;
    int sensor = (int)(id - 0x400) / 32, number = (int)id % 32;
    if (fd) {
        if (n >= 6 && data[3] == number && data[4] == sensor) long_message(now, data, n);
        return;
    }
    uint16_t data_id = (uint16_t)(0x8000 + 32 * sensor + number);
    uint8_t data_id_bytes[2] = {(uint8_t)data_id, (uint8_t)(data_id >> 8)};
    if (keyed || n < 8 || (data[1] & 15) == 15) return;
    if (crc8(crc8(0, data_id_bytes, 2), data + 1, n - 1) != data[0]) return;
    message(&sensors[sensor], now, number, data[1] >> 4, data + 2, n - 2, false, 4);
}

/* A byte of a serial line: at the end of a message takes the stuffing out of it. */
static void serial_byte(uint64_t now, uint8_t byte) {
    static uint8_t stuffed[256];
    static int length;
    if (byte != 0) {
        if (length < 256) stuffed[length++] = byte;
        return;
    }
    uint8_t data[256];
    int n = 0, at = 0;
    while (at < length && length < 256) {
        int block = stuffed[at++];
        if (at + block - 1 > length) { n = 0; break; }
        for (int i = 1; i < block; i++) data[n++] = stuffed[at++];
        if (block < 255 && at < length) data[n++] = 0;
    }
    length = 0;
    long_message(now, data, n);
}

/* Bytes of hexadecimal digits; how many, at most `most`. */
static int bytes_of(const char *digits, uint8_t *bytes, int most) {
    int n = 0;
    for (unsigned byte; n < most && sscanf(digits + 2 * n, "%2x", &byte) == 1; n++) bytes[n] = (uint8_t)byte;
    return n;
}

static void print_maps(uint64_t now) {
    for (int i = 0; i < SENSORS; i++) {
        const sensor_t *s = &sensors[i];
        if (!trusted(s, now)) continue;
        int visible = 0, invisible = 0;
        uint64_t hash = UINT64_C(14695981039346656037);
        for (int a = 0; a < s->azimuths; a++)
            for (int c = 0; c < s->ranges; c++) {
                bool is_known = told(s, now, a) && c >= s->now[a].near && c < s->now[a].end;
                int state = is_known ? 1 + s->now[a].bit[c] : 0;
                visible += state == 2;
                invisible += state == 1;
                hash = (hash ^ (uint64_t)state) * UINT64_C(1099511628211);
            }
        printf("%" PRIu64 " %d %d %d %016" PRIx64 "\n", now, i, visible, invisible, hash);
    }
}

int main(int argc, char **argv) {
    if (argc >= 3 && !strcmp(argv[1], "--cmac")) {
        uint8_t bytes[256], code[16];
        bytes_of(argv[2], key, 16);
        cmac(key, bytes, argc > 3 ? bytes_of(argv[3], bytes, 256) : 0, code);
        for (int i = 0; i < 16; i++) printf("%02x", code[i]);
        return 0;
    }
    FILE *log = argc == 2 || argc == 3 ? fopen(argv[1], "r") : NULL;
    keyed = argc == 3;
    if (!log || (keyed && bytes_of(argv[2], key, 16) != 16)) {
        fprintf(stderr, "usage: receiver LOG [KEY]\n");
        return 2;
    }
    for (int i = 0; i < SENSORS; i++) {
        sensors[i].epoch = sensors[i].previous = -1;
        sensors[i].conflict = NEVER;
        for (int e = 0; e < 16; e++) sensors[i].left[e] = NEVER;
        begin_measure(&sensors[i]);
    }
    char line[1024], text[900];
    uint64_t next = NEVER;
    while (fgets(line, sizeof line, log)) {
        unsigned long long seconds, micros;
        if (sscanf(line, "(%llu.%6llu) %*s %899s", &seconds, &micros, text) != 3) continue;
        uint64_t now = seconds * 1000000 + micros;
        if (next == NEVER) next = now + 100000;
        if (now >= next) { print_maps(now); next = now + 100000; }
        uint8_t data[400];
        char *hex = strchr(text, '#');
        if (!hex) {
            int n = bytes_of(text, data, 400);
            for (int i = 0; i < n; i++) serial_byte(now, data[i]);
            continue;
        }
        bool fd = hex[1] == '#';
        *hex = 0;
        unsigned id = (unsigned)strtoul(text, NULL, 16);
        int n = bytes_of(hex + (fd ? 3 : 1), data, 64);
        frame(now, id, data, n, fd);
    }
    fclose(log);
    return 0;
}
