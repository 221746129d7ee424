/* The C receiver of tests/receiver, fed and answering as README.md beside this says.
 *
 *     cc -std=c11 -O3 -o receiver tests/conformance/receiver.c
 */
#define RECEIVER_WITHOUT_MAIN
#include "../receiver/receiver.c"

/* Of a byte with so many zero bytes after it. */
static uint32_t crc32_table[8][256];

static void make_table(void) {
    for (uint32_t byte = 0; byte < 256; byte++) {
        uint32_t sum = byte;
        for (int i = 0; i < 8; i++) sum = sum & 1 ? sum >> 1 ^ 0xEDB88320 : sum >> 1;
        crc32_table[0][byte] = sum;
    }
    for (int zeros = 1; zeros < 8; zeros++)
        for (int byte = 0; byte < 256; byte++) {
            uint32_t sum = crc32_table[zeros - 1][byte];
            crc32_table[zeros][byte] = sum >> 8 ^ crc32_table[0][sum & 255];
        }
}

/* Eight bytes at a time: cells are most of the work. */
static uint32_t crc32_of(uint32_t sum, const uint8_t *bytes, int n) {
    for (; n >= 8; n -= 8, bytes += 8) {
        uint32_t next = 0;
        for (int i = 0; i < 8; i++)
            next ^= crc32_table[7 - i][bytes[i] ^ (i < 4 ? sum >> 8 * i & 255 : 0)];
        sum = next;
    }
    for (; n > 0; n--) sum = crc32_table[0][(sum ^ *bytes++) & 255] ^ sum >> 8;
    return sum;
}

/* The states of an azimuth: 0 unknown, 1 not visible, 2 visible. */
static void states_of(const sensor_t *s, uint64_t now, int a, uint8_t *states) {
    const ray_t *ray = &s->plane[0].now[a];
    memset(states, 0, (size_t)s->ranges);
    if (shown(s, &s->plane[0], now, a))
        for (int c = ray->near; c < ray->end && c < s->ranges; c++) states[c] = 1 + ray->bit[c];
}

/* Bytes of hexadecimal digits; how many, at most `most`. */
static int bytes_in(const char *digits, uint8_t *bytes, int most) {
    int n = 0;
    for (unsigned byte; n < most && sscanf(digits + 2 * n, "%2x", &byte) == 1; n++) bytes[n] = (uint8_t)byte;
    return n;
}

/* Answers `look`; with `cells` cell by cell. */
static void answer(const sensor_t *s, uint64_t asked, bool cells) {
    uint64_t now = watch(asked);
    static char rows[AZIMUTHS * (CELLS + 1) + 1];
    uint8_t states[CELLS];
    int visible = 0, known = 0, azimuths = trusted(s, now) ? s->azimuths : 0, n = 0;
    uint32_t sum = 0xFFFFFFFF;
    for (int a = 0; a < azimuths; a++) {
        states_of(s, now, a, states);
        for (int c = 0; c < s->ranges; c++) {
            visible += states[c] == 2;
            known += states[c] != 0;
        }
        sum = crc32_of(sum, states, s->ranges);
        if (!cells) continue;
        rows[n++] = ' ';
        for (int c = 0; c < s->ranges; c++) rows[n++] = "?#."[states[c]];
    }
    bool nothing = known == 0;
    rows[nothing ? 0 : n] = 0;
    if (cells)
        printf("%" PRIu64 "%s\n", asked, rows);
    else
        printf("%" PRIu64 " %d %d %08" PRIx32 "\n", asked, visible, known - visible, nothing ? 0 : ~sum);
}

/* Answers `probability`. */
static void answer_probability(const sensor_t *s, uint64_t asked) {
    uint64_t now = watch(asked);
    uint8_t of_cell[CELLS];
    int cells = 0, azimuths = trusted(s, now) ? s->azimuths : 0;
    long total = 0;
    uint32_t sum = 0xFFFFFFFF;
    for (int a = 0; a < azimuths; a++) {
        for (int c = 0; c < s->ranges; c++) {
            int p = probability(s, now, a, c);
            cells += p >= 0;
            of_cell[c] = (uint8_t)(p > 0 ? p : 0);
            total += of_cell[c];
        }
        sum = crc32_of(sum, of_cell, s->ranges);
    }
    printf("%" PRIu64 " p %d %ld %08" PRIx32 "\n", asked, cells, total, cells == 0 ? 0 : ~sum);
}

int main(void) {
    static char line[4096];
    char bus[16] = "", data[2049];
    int sensor = 0;
    make_table();
    start();
    while (fgets(line, sizeof line, stdin)) {
        unsigned long long now;
        unsigned id;
        uint8_t bytes[1024];
        if (sscanf(line, "start %15s %d", bus, &sensor) == 2 && sensor >= 0 && sensor < SENSORS) {
            start();
        } else if (sscanf(line, "frame %llu %x %2048s", &now, &id, data) == 3) {
            frame(now, id, bytes, bytes_in(data, bytes, 64), !strcmp(bus, "canfd"));
        } else if (sscanf(line, "bytes %llu %2048s", &now, data) == 2) {
            int n = bytes_in(data, bytes, 1024);
            for (int i = 0; i < n; i++) serial_byte(now, bytes[i]);
        } else if (sscanf(line, "look %llu", &now) == 1) {
            answer(&sensors[sensor], now, false);
        } else if (sscanf(line, "cells %llu", &now) == 1) {
            answer(&sensors[sensor], now, true);
        } else if (sscanf(line, "probability %llu", &now) == 1) {
            answer_probability(&sensors[sensor], now);
        } else {
            fprintf(stderr, "no line of tests/conformance/README.md: %s", line);
            return 2;
        }
    }
    return 0;
}
