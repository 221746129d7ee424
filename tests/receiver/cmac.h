/* AES-128 (FIPS 197), encryption only, and the message authentication code made of it (RFC 4493). */
#include <stdint.h>
#include <string.h>

static uint8_t times2(uint8_t a) { return (uint8_t)(a << 1 ^ (a & 0x80 ? 0x1B : 0)); }

static uint8_t times(uint8_t a, uint8_t b) {
    uint8_t product = 0;
    for (; b; b >>= 1, a = times2(a))
        if (b & 1) product ^= a;
    return product;
}

/* The substitution: the inverse in GF(2^8), which is the 254th power, and an affine map. */
static uint8_t substitute(uint8_t a) {
    static uint8_t table[256];
    static int made;
    for (int i = 0; !made && i < 256; i++) {
        uint8_t inverse = 1, out = 0x63;
        for (int k = 0; k < 254; k++) inverse = times(inverse, (uint8_t)i);
        for (int k = 0; k < 5; k++) out ^= (uint8_t)(inverse << k | inverse >> (8 - k));
        table[i] = out;
    }
    made = 1;
    return table[a];
}

static void aes128(const uint8_t key[16], uint8_t block[16]) {
    uint8_t round_key[16], constant = 1;
    memcpy(round_key, key, 16);
    for (int i = 0; i < 16; i++) block[i] ^= round_key[i];
    for (int round = 1; round <= 10; round++) {
        uint8_t shifted[16];
        /* substitute bytes, shift rows: byte i lies in row i % 4 of column i / 4 */
        for (int i = 0; i < 16; i++) shifted[i] = substitute(block[(i + 4 * (i % 4)) % 16]);
        for (int c = 0; c < 16; c += 4)
            for (int r = 0; r < 4; r++) {
                const uint8_t *column = shifted + c;
                uint8_t next = column[(r + 1) % 4];
                block[c + r] = round == 10 ? column[r]
                             : (uint8_t)(times2(column[r]) ^ times2(next) ^ next ^ column[(r + 2) % 4] ^ column[(r + 3) % 4]);
            }
        /* the next round's key */
        for (int i = 0; i < 4; i++) round_key[i] ^= substitute(round_key[12 + (i + 1) % 4]);
        round_key[0] ^= constant;
        for (int i = 4; i < 16; i++) round_key[i] ^= round_key[i - 4];
        constant = times2(constant);
        for (int i = 0; i < 16; i++) block[i] ^= round_key[i];
    }
}

/* Shifts a block to the left by a bit, and reduces it. */
static void double_block(uint8_t block[16]) {
    int top = block[0] >> 7;
    for (int i = 0; i < 16; i++) block[i] = (uint8_t)(block[i] << 1 | (i < 15 ? block[i + 1] >> 7 : 0));
    if (top) block[15] ^= 0x87;
}

static void cmac(const uint8_t key[16], const uint8_t *message, int n, uint8_t code[16]) {
    uint8_t subkey[16] = {0}, last[16] = {0};
    int blocks = n > 0 ? (n + 15) / 16 : 1, rest = n - 16 * (blocks - 1);
    aes128(key, subkey);
    double_block(subkey);
    memcpy(last, message + 16 * (blocks - 1), (size_t)rest);
    if (rest < 16) {
        last[rest] = 0x80;
        double_block(subkey);
    }
    memset(code, 0, 16);
    for (int b = 0; b < blocks; b++) {
        for (int i = 0; i < 16; i++) code[i] ^= b < blocks - 1 ? message[16 * b + i] : (uint8_t)(last[i] ^ subkey[i]);
        aes128(key, code);
    }
}
