/* The C receiver of tests/receiver, fed and answering as README.md beside this says.
 *
 *     cc -std=c11 -O2 -o receiver tests/conformance/receiver.c
 */
#define RECEIVER_WITHOUT_MAIN
#include "../receiver/receiver.c"

static uint32_t crc32_table[256];

static void make_table(void) {
    for (uint32_t byte = 0; byte < 256; byte++) {
        uint32_t sum = byte;
        for (int i = 0; i < 8; i++) sum = sum & 1 ? sum >> 1 ^ 0xEDB88320 : sum >> 1;
        crc32_table[byte] = sum;
    }
}

/* 0 unknown, 1 not visible, 2 visible. */
static int state_of(const sensor_t *s, uint64_t now, int a, int c) {
    return shown(s, now, a) && c >= s->now[a].near && c < s->now[a].end ? 1 + s->now[a].bit[c] : 0;
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
    int count[3] = {0, 0, 0}, azimuths = trusted(s, now) ? s->azimuths : 0, n = 0;
    uint32_t sum = 0xFFFFFFFF;
    for (int a = 0; a < azimuths; a++) {
        rows[n++] = ' ';
        for (int c = 0; c < s->ranges; c++) {
            int state = state_of(s, now, a, c);
            count[state]++;
            sum = crc32_table[(sum ^ (uint32_t)state) & 255] ^ sum >> 8;
            rows[n++] = "?#."[state];
        }
    }
    bool nothing = count[1] + count[2] == 0;
    rows[nothing ? 0 : n] = 0;
    if (cells)
        printf("%" PRIu64 "%s\n", asked, rows);
    else
        printf("%" PRIu64 " %d %d %08" PRIx32 "\n", asked, count[2], count[1], nothing ? 0 : ~sum);
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
        } else {
            fprintf(stderr, "no line of tests/conformance/README.md: %s", line);
            return 2;
        }
    }
    return 0;
}
