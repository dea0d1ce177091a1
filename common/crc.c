/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "common/crc.h"

/* The table of byte b is the remainder of b x^8; written as a sum over the bits of b it is a constant
 * expression, so that the compiler makes the tables and nobody types them. */
#define BIT(b, n, value) ((((b) >> (n)) & 1u) ? (value) : 0u)

#define CRC8_BYTE(b)                                                                          \
	(uint8_t)(BIT(b, 0, 0x2Fu) ^ BIT(b, 1, 0x5Eu) ^ BIT(b, 2, 0xBCu) ^ BIT(b, 3, 0x57u) ^ \
	          BIT(b, 4, 0xAEu) ^ BIT(b, 5, 0x73u) ^ BIT(b, 6, 0xE6u) ^ BIT(b, 7, 0xE3u))

#define CRC32_BYTE(b)                                                                                        \
	(BIT(b, 0, 0x77073096u) ^ BIT(b, 1, 0xEE0E612Cu) ^ BIT(b, 2, 0x076DC419u) ^ BIT(b, 3, 0x0EDB8832u) ^ \
	 BIT(b, 4, 0x1DB71064u) ^ BIT(b, 5, 0x3B6E20C8u) ^ BIT(b, 6, 0x76DC4190u) ^ BIT(b, 7, 0xEDB88320u))

#define FOUR(f, b) f(b), f((b) + 1u), f((b) + 2u), f((b) + 3u)
#define SIXTEEN(f, b) FOUR(f, b), FOUR(f, (b) + 4u), FOUR(f, (b) + 8u), FOUR(f, (b) + 12u)
#define SIXTY_FOUR(f, b) SIXTEEN(f, b), SIXTEEN(f, (b) + 16u), SIXTEEN(f, (b) + 32u), SIXTEEN(f, (b) + 48u)
#define ALL(f) SIXTY_FOUR(f, 0u), SIXTY_FOUR(f, 64u), SIXTY_FOUR(f, 128u), SIXTY_FOUR(f, 192u)

/* Where there is room for tables, eight bytes at once: the remainder of b x^(8 + 8 n) is a sum over the bits
 * of b as well, of what a byte's table makes of the sums before. */
#if UINTPTR_MAX > 0xFFFFFFFFu
#define CRC_AT_ONCE 8
#define BITS(f, to)                                                                                 \
	to##0 = f(1u), to##1 = f(2u), to##2 = f(4u), to##3 = f(8u), to##4 = f(16u), to##5 = f(32u), \
	to##6 = f(64u), to##7 = f(128u)
#define LATER(f, to, from)                                                                                  \
	to##0 = f(from##0), to##1 = f(from##1), to##2 = f(from##2), to##3 = f(from##3), to##4 = f(from##4), \
	to##5 = f(from##5), to##6 = f(from##6), to##7 = f(from##7)
#define BY(z, b)                                                                                   \
	(BIT(b, 0, z##0) ^ BIT(b, 1, z##1) ^ BIT(b, 2, z##2) ^ BIT(b, 3, z##3) ^ BIT(b, 4, z##4) ^ \
	 BIT(b, 5, z##5) ^ BIT(b, 6, z##6) ^ BIT(b, 7, z##7))
#define CRC32_LATER(z) (((z) >> 8) ^ CRC32_BYTE((z)&0xFFu))

/* a of crc8, p of crc32: of b x^8, bit by bit; then of b x^16 and so on. */
enum {
	BITS(CRC8_BYTE, a),
	LATER(CRC8_BYTE, b, a),
	LATER(CRC8_BYTE, c, b),
	LATER(CRC8_BYTE, d, c),
	LATER(CRC8_BYTE, e, d),
	LATER(CRC8_BYTE, f, e),
	LATER(CRC8_BYTE, g, f),
	LATER(CRC8_BYTE, h, g),
};
enum {
	BITS(CRC32_BYTE, p),
	LATER(CRC32_LATER, q, p),
	LATER(CRC32_LATER, r, q),
	LATER(CRC32_LATER, s, r),
	LATER(CRC32_LATER, t, s),
	LATER(CRC32_LATER, u, t),
	LATER(CRC32_LATER, v, u),
	LATER(CRC32_LATER, w, v),
};
#define BY_B(n) (uint8_t) BY(b, n)
#define BY_C(n) (uint8_t) BY(c, n)
#define BY_D(n) (uint8_t) BY(d, n)
#define BY_E(n) (uint8_t) BY(e, n)
#define BY_F(n) (uint8_t) BY(f, n)
#define BY_G(n) (uint8_t) BY(g, n)
#define BY_H(n) (uint8_t) BY(h, n)
#define BY_Q(n) BY(q, n)
#define BY_R(n) BY(r, n)
#define BY_S(n) BY(s, n)
#define BY_T(n) BY(t, n)
#define BY_U(n) BY(u, n)
#define BY_V(n) BY(v, n)
#define BY_W(n) BY(w, n)
#else
#define CRC_AT_ONCE 1
#endif

static const uint8_t table8[CRC_AT_ONCE][256] = {
        {ALL(CRC8_BYTE)},
#if CRC_AT_ONCE == 8
        {ALL(BY_B)},      {ALL(BY_C)}, {ALL(BY_D)}, {ALL(BY_E)}, {ALL(BY_F)}, {ALL(BY_G)}, {ALL(BY_H)},
#endif
};
static const uint32_t table32[CRC_AT_ONCE][256] = {
        {ALL(CRC32_BYTE)},
#if CRC_AT_ONCE == 8
        {ALL(BY_Q)},       {ALL(BY_R)}, {ALL(BY_S)}, {ALL(BY_T)}, {ALL(BY_U)}, {ALL(BY_V)}, {ALL(BY_W)},
#endif
};

#if defined(__x86_64__)

/* Sixteen bytes side by side, each the remainder of every sixteenth: b x^128 is that of its lower half and of
 * its upper, and a register holds a table of either. */
enum { TOGETHER = 16 };
#define BY_64(b) BY(h, b)
enum { LATER(BY_64, i, h) };
#define BY_I(n) (uint8_t) BY(i, n)
#define BY_I_UPPER(n) (uint8_t) BY(i, (n) << 4)
typedef uint8_t together __attribute__((vector_size(TOGETHER), may_alias, aligned(1)));
typedef uint16_t halves __attribute__((vector_size(TOGETHER)));
static const together lower = {SIXTEEN(BY_I, 0u)}, upper = {SIXTEEN(BY_I_UPPER, 0u)};
static const together places = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};

typedef char lookup __attribute__((vector_size(TOGETHER)));

/* Of sixteen entries those that are asked for; 0 for one below them. */
__attribute__((target("ssse3"))) static inline together look_up(together entries, together which)
{
	return (together)__builtin_ia32_pshufb128((lookup)entries, (lookup)which);
}

__attribute__((target("ssse3"))) static uint8_t together8(uint8_t crc, const uint8_t *bytes, size_t count)
{
	const size_t first = (count - 1) % TOGETHER + 1;
	together left = *(const together *)bytes ^ (together) { crc ^ 0xFFu }, last;

	/* the first of them with zeros before them, which leave nothing */
	left = look_up(left, places - (uint8_t)(TOGETHER - first));
	for (size_t i = first; i < count; i += TOGETHER)
		left = look_up(lower, left & 15) ^ look_up(upper, (together)((halves)left >> 4) & 15) ^
		       *(const together *)(bytes + i);
	last = left;
	return crc8(0xFFu, (const uint8_t *)&last, sizeof(last));
}

#endif

uint8_t crc8(uint8_t crc, const uint8_t *bytes, size_t count)
{
	size_t i = 0;

#if defined(__x86_64__)
	if (count >= 2 * TOGETHER && __builtin_cpu_supports("ssse3"))
		return together8(crc, bytes, count);
#endif
	crc ^= 0xFFu;
#if CRC_AT_ONCE == 8
	for (; i + 8 <= count; i += 8)
		crc = table8[7][crc ^ bytes[i]] ^ table8[6][bytes[i + 1]] ^ table8[5][bytes[i + 2]] ^
		      table8[4][bytes[i + 3]] ^ table8[3][bytes[i + 4]] ^ table8[2][bytes[i + 5]] ^
		      table8[1][bytes[i + 6]] ^ table8[0][bytes[i + 7]];
#endif
	for (; i < count; i++)
		crc = table8[0][crc ^ bytes[i]];
	return crc ^ 0xFFu;
}

uint32_t crc32(uint32_t crc, const uint8_t *bytes, size_t count)
{
	size_t i = 0;

	crc = ~crc;
#if CRC_AT_ONCE == 8
	for (; i + 8 <= count; i += 8)
		crc = table32[7][(crc ^ bytes[i]) & 0xFFu] ^ table32[6][(crc >> 8 & 0xFFu) ^ bytes[i + 1]] ^
		      table32[5][(crc >> 16 & 0xFFu) ^ bytes[i + 2]] ^ table32[4][crc >> 24 ^ bytes[i + 3]] ^
		      table32[3][bytes[i + 4]] ^ table32[2][bytes[i + 5]] ^ table32[1][bytes[i + 6]] ^
		      table32[0][bytes[i + 7]];
#endif
	for (; i < count; i++)
		crc = table32[0][(crc ^ bytes[i]) & 0xFFu] ^ (crc >> 8);
	return ~crc;
}
