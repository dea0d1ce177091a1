/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/base/checksum.h"

#include "common/crc.h"

#if defined(__x86_64__)

#include <immintrin.h>

enum { LANES = 4, LANE_BYTES = 16, STEP_BYTES = LANES * LANE_BYTES };

#define CARRY_LESS __attribute__((target("pclmul,sse2")))

/* What has to come on: the two halves of 128 bits, each by its power of x mod the polynomial, bits reflected.
 */
CARRY_LESS static inline __m128i fold(__m128i held, __m128i powers, __m128i next)
{
	const __m128i low = _mm_clmulepi64_si128(held, powers, 0x00);
	const __m128i high = _mm_clmulepi64_si128(held, powers, 0x11);

	return _mm_xor_si128(_mm_xor_si128(low, high), next);
}

CARRY_LESS static inline __m128i lane(const uint8_t *bytes, unsigned i)
{
	return _mm_loadu_si128((const __m128i *)(const void *)(bytes + (size_t)LANE_BYTES * i));
}

/* 16 bytes that have the remainder of all before the last count % 64 bytes; count is 64 at least. */
CARRY_LESS static void fold_all(uint8_t folded[LANE_BYTES], uint32_t crc, const uint8_t *bytes, size_t count)
{
	/* x^(512 + 32), x^(512 - 32); x^(128 + 32), x^(128 - 32) */
	const __m128i by_step = _mm_set_epi64x(0x01c6e41596, 0x0154442bd4);
	const __m128i by_lane = _mm_set_epi64x(0x00ccaa009e, 0x01751997d0);
	__m128i held[LANES];

	for (unsigned i = 0; i < LANES; i++)
		held[i] = lane(bytes, i);
	held[0] = _mm_xor_si128(held[0], _mm_cvtsi32_si128((int)~crc));
	for (size_t at = STEP_BYTES; at + STEP_BYTES <= count; at += STEP_BYTES)
		for (unsigned i = 0; i < LANES; i++)
			held[i] = fold(held[i], by_step, lane(bytes + at, i));
	for (unsigned i = 1; i < LANES; i++)
		held[0] = fold(held[0], by_lane, held[i]);
	_mm_storeu_si128((__m128i *)(void *)folded, held[0]);
}

uint32_t checksum_crc32(uint32_t crc, const uint8_t *bytes, size_t count)
{
	uint8_t folded[LANE_BYTES];

	if (count < STEP_BYTES || !__builtin_cpu_supports("pclmul"))
		return crc32(crc, bytes, count);
	fold_all(folded, crc, bytes, count);
	crc = crc32(UINT32_MAX, folded, sizeof(folded)); /* its own beginning is in them already */
	return crc32(crc, bytes + count - count % STEP_BYTES, count % STEP_BYTES);
}

#else

uint32_t checksum_crc32(uint32_t crc, const uint8_t *bytes, size_t count)
{
	return crc32(crc, bytes, count);
}

#endif
