/* A receiver of visibility maps in C, written from src/wire/SPECIFICATION.md.
 *
 *     cc -O2 -o receiver receiver.c && ./receiver LOG [KEY]
 *
 * Reads a log of `candump -L` (classic CAN and CAN FD, sensors 0 to 7 from 0x400 on, the planes of visibility and probability), or of a serial line, chunk by
 * chunk: `(seconds) device bytes`. With a key, 32 hexadecimal digits, it takes authenticated messages and no others. Prints, whenever 100 ms of the log are over, for every sensor whose map is shown:
 *
 *     microseconds sensor visible invisible hash
 *
 * with the number of visible and of invisible cells and a hash (FNV-1a) of all cells: 0 unknown, 1 not visible, 2 visible,
 * azimuth by azimuth, near to far; of a sender with a table of probabilities also their sum in 1/255. `receiver --cmac KEY [MESSAGE]` prints a message's authentication code. Rules by their numbers are those of "What a receiver does".
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
#define PLANES 2       /* visibility and, of senders with a table of probabilities, that of probability */
#define WAITING 36     /* words that wait for others of their blocks */
#define PERIOD 5120000 /* us, of the scan numbers */
#define CLOCK (UINT64_C(1099511627776) * 1000) /* us, of the header's clock */
#define A_US 300000
#define D_US 100000
#define MARGIN_US 25000
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

typedef struct { int scan, start, index, delta; uint64_t word; } waiting_t;

/* A plane of a sensor's maps. */
typedef struct {
    bool there[AZIMUTHS], refreshed[AZIMUTHS];
    int now_scan[AZIMUTHS], was_scan[AZIMUTHS];
    ray_t now[AZIMUTHS], was[AZIMUTHS];
    waiting_t waiting[WAITING]; int words;
} plane_t;

typedef struct {
    /* session */
    int epoch; /* -1: none */
    uint64_t heard, map_heard, conflict, other_version;
    bool doubt; uint64_t misfit_since;
    struct { bool there, confirmed; uint64_t at, us, begun; } clock;
    struct { bool there; uint64_t begun, at, sunk; uint32_t lag; int count; } measure;
    struct { enum { UNMARKED, HEARD, LEFT } mark; uint64_t ms; } epochs[16];
    int previous; uint32_t previous_least; /* -1: none */
    /* header */
    uint8_t group[8][5]; int groups; bool complete; /* in the last place group 7 of narrow azimuths */
    int azimuths, ranges, usual_near, usual_end;
    enum { UNSAID, SAID, CONTRADICTED } levels_are; uint8_t levels[5];
    plane_t plane[PLANES];
    /* authentication */
    bool fresh; uint64_t freshness;
} sensor_t;

static sensor_t sensors[SENSORS];
static uint8_t key[16];
static bool keyed;
static uint64_t latest; /* time handed in */

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

/* Known cells from limits as they are sent; false if no sender sends them. */
static bool known(const sensor_t *s, ray_t *r, int near, int end) {
    r->near = near;
    r->end = end;
    return (near < end && end <= s->ranges) || (near == 1 && end == 0);
}

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
static void take(plane_t *p, int azimuth, int scan, const ray_t *ray, bool refresh) {
    if (!p->there[azimuth] || newer(scan, p->now_scan[azimuth]) || scan == p->now_scan[azimuth]) {
        if (p->there[azimuth] && (p->now[azimuth].near != ray->near || p->now[azimuth].end != ray->end))
            p->refreshed[azimuth] = false;
        p->now[azimuth] = *ray;
        p->now_scan[azimuth] = scan;
        p->there[azimuth] = true;
    }
    bool cells = p->now[azimuth].near == ray->near && p->now[azimuth].end == ray->end;
    if (refresh && cells && (!p->refreshed[azimuth] || !newer(p->was_scan[azimuth], scan))) {
        p->was[azimuth] = *ray;
        p->was_scan[azimuth] = scan;
        p->refreshed[azimuth] = true;
    }
}

/* Reads what is there of a block; whether nothing can follow: it is complete, or malformed. */
static bool block(const sensor_t *s, plane_t *p, int delta, int scan, int start, const uint64_t *word, int words, int bits, int most) {
    static const int classes[7] = {8, 12, 16, 20, 26, 34, 48};
    number_t n = {word, words, bits, most, 1, word[0], UINT64_C(1) << bits, false};
    int base = 0;
    if (delta) {
        int age = plain(&n, 4);
        if (age < 0) return false;
        base = (scan - age - 1) & 255;
    }
    bool first = true, as_expected = true, unchanged = true;
    ray_t before = NOTHING, before_was = NOTHING, expected, ray;
    for (int a = start; a < s->azimuths; a++) {
        if (!first) {
            int r = room(&n), k = 0;
            if (r < 4) return true;
            while (k < 7 && r >= classes[k]) k++;
            int stop = symbol(&n, STOP[k], 2);
            if (stop != 0) return stop == 1;
        }
        const ray_t *was = &NOTHING;
        if (delta) {
            if (!p->refreshed[a] || p->was_scan[a] != base) return false;
            was = &p->was[a];
            expected = *was;
            if (!first) {
                for (int c = 0; c < CELLS; c++)
                    if (before.bit[c] != before_was.bit[c]) expected.bit[c] = before.bit[c];
                trim(&expected);
            }
        } else if (first) {
            expected = NOTHING;
            expected.near = s->usual_near;
            expected.end = s->usual_end;
            memset(expected.bit, 1, CELLS);
            trim(&expected);
        } else {
            expected = before;
        }
        int row = delta ? (first ? 3 : 4 + (unchanged ? 0 : 2) + (as_expected ? 0 : 1)) : (first ? 0 : as_expected ? 1 : 2);
        int way = symbol(&n, RAY[row][edge_from(&expected, 0) >= 0], 3);
        if (way < 0) return false;
        if (way == 0) {
            ray = expected;
        } else {
            ray = NOTHING;
            ray.near = expected.near;
            ray.end = expected.end;
            if (way == 2) {
                if (delta) return true;
                int near = limit(&n, expected.near);
                int end = n.out || near < 0 ? -1 : limit(&n, expected.end);
                if (near < 0 || end < 0 || !known(s, &ray, near, end)) return !n.out;
            }
            if (ray.near < ray.end && !edges(&n, delta, &expected, &ray)) return !n.out;
        }
        as_expected = same(&ray, &expected);
        unchanged = delta && same(&ray, was);
        before = ray;
        before_was = *was;
        first = false;
        /* `was` may point into what is replaced here, so it is not used any more */
        take(p, a, scan, &ray, !delta);
    }
    return true;
}

/* ---- session: rules 1 to 5 ---- */

static void forget_maps(sensor_t *s) {
    for (plane_t *p = s->plane; p < s->plane + PLANES; p++) {
        memset(p->there, 0, sizeof p->there);
        memset(p->refreshed, 0, sizeof p->refreshed);
        p->words = 0;
    }
}

static void begin(sensor_t *s, uint64_t now, int epoch);

static bool lasts(uint64_t sign, uint64_t now) { return sign != NEVER && now - sign < 1000000; }

static uint32_t behind(uint64_t lag, uint64_t least) { return (uint32_t)((lag + PERIOD - least) % PERIOD); }

static uint32_t lag_of(uint64_t now, int scan) { return behind(now % PERIOD, (uint64_t)scan * 20000); }

static uint32_t least(const sensor_t *s, uint64_t now) {
    return (uint32_t)((s->measure.lag + ((now - s->measure.at) >> 11)) % PERIOD);
}

/* The sender's clock as the headers bound it, and the lag of a scan measured by it now. */
static uint64_t sender_clock(const sensor_t *s, uint64_t now) {
    uint64_t passed = now - s->clock.at;
    return (s->clock.us + passed - (passed >> 11)) % CLOCK;
}

static uint32_t clock_lag(const sensor_t *s, uint64_t now) { return behind(now % PERIOD, sender_clock(s, now) % PERIOD); }

/* By how much a lag is smaller than the sender's clock allows; 0 if it is not. */
static uint32_t ahead_of(uint32_t clock, uint32_t lag) {
    uint32_t by = behind(clock, lag);
    return by > D_US && by <= PERIOD / 2 ? by : 0;
}

/* Rule 1: whether a frame is of the session; scan is -1 where it has none. */
static bool enter(sensor_t *s, uint64_t now, int epoch, int scan) {
    uint64_t since_ms = now / 1000 - s->epochs[epoch].ms;
    if (epoch == s->epoch && now - s->heard <= PERIOD) { s->heard = now; return true; }
    if (s->epoch >= 0 && now - s->heard <= PERIOD / 2) {
        if (s->epochs[epoch].mark == LEFT && since_ms > PERIOD / 1000) s->epochs[epoch].mark = UNMARKED;
        bool left = s->epochs[epoch].mark == LEFT;
        if (left && since_ms <= (A_US + D_US) / 1000) return false;
        if (left || lasts(s->conflict, now)) {
            bool speaks = false;
            if (scan >= 0 && s->previous == epoch) {
                uint32_t late = behind(lag_of(now, scan), s->previous_least);
                speaks = late <= D_US || late > PERIOD / 2;
            } else if (scan >= 0) {
                speaks = !left;
            }
            if (speaks) s->conflict = now;
            return false;
        }
    }
    bool again = s->epochs[epoch].mark == HEARD && since_ms <= (A_US + D_US) / 1000;
    s->epochs[epoch].mark = HEARD;
    s->epochs[epoch].ms = now / 1000;
    if (again) begin(s, now, epoch);
    return again;
}

static void begin(sensor_t *s, uint64_t now, int epoch) {
    if (s->epoch >= 0 && s->epoch != epoch) {
        s->epochs[s->epoch].mark = LEFT;
        s->epochs[s->epoch].ms = now / 1000;
        s->previous = s->measure.there ? s->epoch : -1;
        s->previous_least = least(s, now);
    }
    s->epochs[epoch].mark = UNMARKED;
    s->epoch = epoch;
    s->heard = s->map_heard = now;
    s->conflict = s->other_version = s->misfit_since = NEVER;
    s->clock.there = s->measure.there = s->doubt = s->complete = false;
    s->levels_are = UNSAID;
    s->groups = 0;
    forget_maps(s);
}

/* Rule 2: the clock of a header. */
static void hear_clock(sensor_t *s, uint64_t now, const uint8_t *group) {
    uint64_t us = 0;
    for (int i = 0; i < 5; i++) us = us << 8 | group[i];
    us *= 1000;
    if (!s->clock.there) {
        s->clock.there = true;
        s->clock.confirmed = false;
        s->clock.at = s->clock.begun = now;
        s->clock.us = us;
    }
    uint64_t ahead = (us + CLOCK - sender_clock(s, now)) % CLOCK;
    bool faster = ahead < CLOCK / 2;
    if (faster && ahead > D_US) {
        s->clock.begun = now;
        s->clock.confirmed = false;
    } else if ((faster || CLOCK - ahead <= D_US) && now - s->clock.begun >= A_US + D_US) {
        s->clock.confirmed = true;
    }
    if (faster) {
        s->clock.at = now;
        s->clock.us = us;
    }
    if (s->measure.there && ahead_of(clock_lag(s, now), least(s, now)) > 0) {
        s->measure.there = false;
        forget_maps(s);
    }
}

/* Whether the measure was old enough and of enough frames at a time. */
static bool settled(const sensor_t *s, uint64_t at) {
    return at - s->measure.begun >= A_US + D_US && s->measure.count >= 8;
}

/* Whether by the sender's clock the fastest map frame was in time. */
static bool fits(const sensor_t *s, uint64_t now) {
    return behind((uint64_t)least(s, now) + D_US, clock_lag(s, now)) <= 2 * D_US + MARGIN_US;
}

/* Whether nothing fitted measure and clock for a period: the clocks are not what they were. */
static bool misfits(sensor_t *s, uint64_t now) {
    if (s->misfit_since == NEVER) s->misfit_since = now;
    if (now - s->misfit_since < PERIOD) return false;
    s->clock.there = false;
    s->misfit_since = NEVER;
    return true;
}

static bool in_time(sensor_t *s, uint64_t now, uint32_t ahead) {
    s->map_heard = now;
    if (ahead) misfits(s, now);
    else s->misfit_since = NEVER;
    return true;
}

static bool measure_anew(sensor_t *s, uint64_t now, uint32_t lag, uint32_t ahead) {
    forget_maps(s);
    s->measure.there = true;
    s->measure.begun = s->measure.at = now;
    s->measure.lag = lag;
    s->measure.sunk = 0;
    s->measure.count = 1;
    return in_time(s, now, ahead);
}

static bool refuse(sensor_t *s, uint64_t now, uint32_t lag) {
    if (misfits(s, now)) return measure_anew(s, now, lag, 0);
    s->doubt = true;
    return false;
}

/* Rules 2 and 3: whether a frame with a scan number is in time. */
static bool hear(sensor_t *s, uint64_t now, int scan) {
    uint32_t lag = lag_of(now, scan), ahead = s->clock.there ? ahead_of(clock_lag(s, now), lag) : 0;
    bool sure = s->measure.there && s->clock.there && s->clock.confirmed && settled(s, now) && fits(s, now);
    if (ahead > 1500000 || (ahead && sure)) return refuse(s, now, lag);
    if (!s->measure.there) return measure_anew(s, now, lag, ahead);
    uint32_t late = behind(lag, least(s, now));
    if (late > D_US && late <= PERIOD / 2) return refuse(s, now, lag);
    if (late > PERIOD / 2) {
        uint64_t allowed = (now - s->measure.at) >> 10;
        s->measure.sunk = (s->measure.sunk > allowed ? s->measure.sunk - allowed : 0) + PERIOD - late;
        if (s->measure.sunk > D_US) return measure_anew(s, now, lag, ahead);
        s->measure.at = now;
        s->measure.lag = lag;
    }
    if (now - s->map_heard > A_US && !settled(s, s->map_heard)) {
        s->measure.begun = now;
        s->measure.count = 0;
    }
    if (s->measure.count < 255) s->measure.count++;
    if (now - s->map_heard > 1000000) forget_maps(s);
    return in_time(s, now, ahead);
}

/* Rule 4, the dropping. */
static bool too_old(const sensor_t *s, uint64_t now, int scan) {
    return behind(lag_of(now, scan), least(s, now)) > 1000000;
}

static void purge(sensor_t *s, uint64_t now) {
    for (plane_t *p = s->plane; p < s->plane + PLANES; p++) {
        for (int a = 0; a < AZIMUTHS; a++) {
            if (p->there[a] && too_old(s, now, p->now_scan[a])) p->there[a] = p->refreshed[a] = false;
            if (p->refreshed[a] && too_old(s, now, p->was_scan[a])) p->refreshed[a] = false;
        }
        int kept = 0;
        for (int i = 0; i < p->words; i++)
            if (!too_old(s, now, p->waiting[i].scan)) p->waiting[kept++] = p->waiting[i];
        p->words = kept;
    }
}

/* Rule 5. */
static bool trusted(const sensor_t *s, uint64_t now) {
    return s->epoch >= 0 && s->complete && s->measure.there && s->clock.there && settled(s, now) &&
           now - s->map_heard <= A_US && (s->clock.confirmed || !s->doubt) && fits(s, now) &&
           !lasts(s->conflict, now) && !lasts(s->other_version, now);
}

static bool shown(const sensor_t *s, const plane_t *p, uint64_t now, int a) {
    return p->there[a] && behind(lag_of(now, p->now_scan[a]), least(s, now)) + MARGIN_US <= A_US;
}

/* The probability of a cell that is shown, 1/255; -1 for none. */
static int probability(const sensor_t *s, uint64_t now, int a, int c) {
    const ray_t *ray = &s->plane[0].now[a], *other = &s->plane[1].now[a];
    if (s->levels_are != SAID || !shown(s, &s->plane[0], now, a) || c < ray->near || c >= ray->end) return -1;
    bool bit = shown(s, &s->plane[1], now, a) && c >= other->near && c < other->end && other->bit[c];
    return s->levels[!ray->bit[c] ? 0 : bit ? 2 : 1];
}

/* Nothing heard. */
static void start_sensor(sensor_t *s) {
    bool fresh = s->fresh;
    uint64_t freshness = s->freshness;
    memset(s, 0, sizeof *s);
    s->fresh = fresh;
    s->freshness = freshness;
    s->epoch = s->previous = -1;
    s->conflict = s->other_version = NEVER;
}

/* Before every frame and every look, the time to count with: one that steps back ends all sessions. */
static uint64_t watch(uint64_t now) {
    if (now <= latest && latest - now <= 20000) return latest;
    if (now < latest)
        for (int i = 0; i < SENSORS; i++) start_sensor(&sensors[i]);
    return latest = now;
}

/* ---- messages ---- */

/* Whether a group 7 is of narrow azimuths. */
static bool of_narrow(const uint8_t group[5]) { return group[2] == 0 && group[3] > 1; }

/* Whether group 4 says that some azimuths are narrow. */
static bool some_narrow(uint8_t group[8][5]) { return group[4][4] > 127; }

static bool header_holds(uint8_t group[8][5]) {
    int ranges = group[5][2] + 1, near = group[5][3], last = group[5][4], azimuths = (group[4][4] & 127) + 1;
    const uint8_t *narrow = group[7];
    bool cells = near <= last ? last < ranges : near == 1 && last == 0;
    uint8_t sum = crc8(0, group[1], 29);
    if (some_narrow(group)) {
        sum = crc8(sum, narrow, 5);
        if (!of_narrow(narrow) || narrow[0] >= narrow[1] || narrow[1] > azimuths || narrow[3] > 4) return false;
    }
    return sum == group[6][4] && azimuths <= AZIMUTHS && cells && (group[4][2] || group[4][3]) &&
           (group[5][0] || group[5][1]);
}

/* Group 7 of probabilities; it changes nothing of what is visible. */
static void levels(sensor_t *s, const uint8_t group[5]) {
    if (group[2] == 0 || group[0] > group[1] || group[1] > group[2]) return;
    bool other = s->levels_are != UNSAID && memcmp(s->levels, group, 5);
    if (s->levels_are == UNSAID || other) s->levels_are = other ? CONTRADICTED : SAID;
    if (!other) memcpy(s->levels, group, 5);
}

static void header(sensor_t *s, uint64_t now, const uint8_t *own, int n) {
    if (n > 0 && (own[0] & 15) != 1) s->other_version = now;
    if (n < 6 || (own[0] & 15) != 1) return;
    int first = own[0] >> 4 & 7;
    uint8_t all[8][5] = {0};
    if (n >= 36) {
        int there = 0x7E;
        memcpy(all, own + 1, 35);
        for (int at = 36; at + 5 <= n && there == 0x7E; at += 5)
            if (of_narrow(own + at)) { memcpy(all[7], own + at, 5); there |= 1 << 7; }
        if (!header_holds(all)) return;
        for (int g = 1; g < 8; g++)
            if (s->groups & there & 1 << g && memcmp(s->group[g], all[g], 5)) { s->conflict = now; return; }
        for (int g = 1; g < 8; g++)
            if (there >> g & 1) memcpy(s->group[g], all[g], 5);
        s->groups |= there;
        for (int at = 36; at + 5 <= n; at += 5) levels(s, own + at);
        hear_clock(s, now, all[0]);
    } else if (first == 0) {
        hear_clock(s, now, own + 1);
        return;
    } else if (first < 7 || of_narrow(own + 1)) {
        if (s->groups >> first & 1 && memcmp(s->group[first], own + 1, 5)) { s->conflict = now; return; }
        memcpy(s->group[first], own + 1, 5);
        s->groups |= 1 << first;
    } else {
        levels(s, own + 1);
    }
    if ((s->groups & 0x7E) != 0x7E || (some_narrow(s->group) && !(s->groups >> 7)) || s->complete) return;
    if (!header_holds(s->group)) { s->groups = 0; return; }
    const uint8_t *g4 = s->group[4], *g5 = s->group[5];
    s->azimuths = (g4[4] & 127) + 1;
    s->ranges = g5[2] + 1;
    s->usual_near = g5[3];
    s->usual_end = g5[3] == 1 && g5[4] == 0 ? 0 : g5[4] + 1;
    s->complete = true;
}

static void plain_cells(const sensor_t *s, plane_t *p, int scan, int a, const uint8_t *own, int n, uint64_t word, bool is_long) {
    ray_t new = NOTHING;
    int segment = is_long ? 15 : (int)(word >> 29);
    int near = is_long ? own[2] : (int)(word >> 21 & 255), last = is_long ? own[3] : (int)(word >> 13 & 255);
    if (is_long && n < 4) return;
    if (segment == 15 && !known(s, &new, near, near == 1 && last == 0 ? 0 : last + 1)) return;
    if (segment > 8 && segment < 15) return;
    if (is_long && new.end > 8 * (n - 4)) return;
    if (!p->there[a] || newer(scan, p->now_scan[a])) {
        p->now[a] = NOTHING;
        p->now_scan[a] = scan;
        p->there[a] = true;
        p->refreshed[a] = false;
    }
    if (p->now_scan[a] != scan) return;
    ray_t *r = &p->now[a];
    if (segment == 15 && (r->near != new.near || r->end != new.end)) p->refreshed[a] = false;
    if (is_long) {
        for (int c = 0; c < new.end; c++) new.bit[c] = own[4 + c / 8] >> (7 - c % 8) & 1;
        *r = new;
    } else if (segment == 15) {
        r->near = new.near;
        r->end = new.end;
    } else {
        for (int i = 0; i < 29 && 29 * segment + i < CELLS; i++)
            if (word >> (28 - i) & 1) r->bit[29 * segment + i] = 1;
    }
    trim(r);
}

/* A word of a block: it waits, and if it joins those that are there from the first on, they are read. */
static void classic_word(const sensor_t *s, plane_t *p, int scan, int start, int index, int delta, uint64_t word) {
    bool again = false;
    int kept = 0;
    for (int i = 0; i < p->words; i++) {
        const waiting_t *w = &p->waiting[i];
        bool same_word = w->scan == scan && w->start == start && w->index == index;
        again |= same_word;
        if (!same_word) p->waiting[kept++] = *w;
    }
    p->words = kept;
    if (p->words == WAITING) memmove(p->waiting, p->waiting + 1, sizeof *p->waiting * (size_t)--p->words);
    p->waiting[p->words++] = (waiting_t){scan, start, index, delta, word};
    if (again) return;
    uint64_t words[4] = {0};
    int have = 0, count = 0;
    for (int i = 0; i < p->words; i++) {
        const waiting_t *w = &p->waiting[i];
        if (w->scan != scan || w->start != start) continue;
        words[w->index] = w->word;
        have |= 1 << w->index;
        if (w->index == 0) delta = w->delta;
    }
    while (have >> count & 1) count++;
    if (count <= index || !block(s, p, delta, scan, start, words, count, 33, 4)) return;
    kept = 0;
    for (int i = 0; i < p->words; i++)
        if (p->waiting[i].scan != scan || p->waiting[i].start != start) p->waiting[kept++] = p->waiting[i];
    p->words = kept;
}

static void message(sensor_t *s, uint64_t now, int number, int epoch, const uint8_t *own, int n, bool is_long, int most) {
    /* from anybody, of no epoch */
    if (number == 4 || number == 5 || number >= 24) return;
    bool dated = number == 2 || number >= 6, whole = n >= 3;
    if (!enter(s, now, epoch, dated && whole ? own[0] : -1)) return;
    if (number == 1) header(s, now, own, n);
    if (!dated || !whole || !hear(s, now, own[0])) return;
    purge(s, now);
    int scan = own[0], start = is_long ? own[1] : own[1] >> 1, part = (number - 6) % 6;
    if (number < 6 || number >= 6 + 6 * PLANES || !s->complete || start >= s->azimuths) return;
    plane_t *p = &s->plane[(number - 6) / 6];
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
    if (part == 5) plain_cells(s, p, scan, start, own, n, word[0], is_long);
    else if (is_long) { if (part < 2 && words > 0) block(s, p, part, scan, start, word, words, 32, most); }
    else classic_word(s, p, scan, start, part < 2 ? 0 : part - 1, part == 1, word[0]);
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
    if (n < 6 || n > 64 || data[3] >= 32 || data[4] >= SENSORS || data[5] & 0x70) return;
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
    now = watch(now);
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
static uint8_t stuffed[256];
static int length;

static void serial_byte(uint64_t now, uint8_t byte) {
    if (byte != 0) {
        if (length < 256) stuffed[length++] = byte;
        return;
    }
    if (length == 0) return;
    uint8_t data[256];
    int n = 0, at = 0;
    while (at < length && length < 256) {
        int block = stuffed[at++];
        if (at + block - 1 > length) { n = 0; break; }
        for (int i = 1; i < block; i++) data[n++] = stuffed[at++];
        if (block < 255 && at < length) data[n++] = 0;
    }
    length = 0;
    now = watch(now);
    long_message(now, data, n);
}

/* Forgets everything. */
static void start(void) {
    memset(sensors, 0, sizeof sensors);
    for (int i = 0; i < SENSORS; i++) start_sensor(&sensors[i]);
    length = 0;
    latest = 0;
}

#ifndef RECEIVER_WITHOUT_MAIN

/* Bytes of hexadecimal digits; how many, at most `most`. */
static int bytes_of(const char *digits, uint8_t *bytes, int most) {
    int n = 0;
    for (unsigned byte; n < most && sscanf(digits + 2 * n, "%2x", &byte) == 1; n++) bytes[n] = (uint8_t)byte;
    return n;
}

static void print_maps(uint64_t now) {
    now = watch(now);
    for (int i = 0; i < SENSORS; i++) {
        const sensor_t *s = &sensors[i];
        if (!trusted(s, now)) continue;
        int visible = 0, invisible = 0;
        long probable = 0;
        uint64_t hash = UINT64_C(14695981039346656037);
        for (int a = 0; a < s->azimuths; a++)
            for (int c = 0; c < s->ranges; c++) {
                const ray_t *ray = &s->plane[0].now[a];
                bool is_known = shown(s, &s->plane[0], now, a) && c >= ray->near && c < ray->end;
                int state = is_known ? 1 + ray->bit[c] : 0;
                visible += state == 2;
                invisible += state == 1;
                int p = probability(s, now, a, c);
                probable += p > 0 ? p : 0;
                hash = (hash ^ (uint64_t)state) * UINT64_C(1099511628211);
            }
        printf("%" PRIu64 " %d %d %d %016" PRIx64, now, i, visible, invisible, hash);
        if (s->levels_are == SAID) printf(" %ld", probable);
        putchar('\n');
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
    start();
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
#endif
