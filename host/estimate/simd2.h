/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_SIMD2_H
#define DT_HOST_ESTIMATE_SIMD2_H
/*
 * Two numbers side by side, in what the processor has for it: element by element like one number, [0] and [1]
 * alone. What gcc and clang offer beyond C11; as exact as two numbers.
 */
#include <string.h>
#ifdef __SSE2__
#include <emmintrin.h>
#endif

#define PAIR double __attribute__((vector_size(2 * sizeof(double))))

static inline PAIR pair_load(const double *from)
{
	PAIR pair;

	memcpy(&pair, from, sizeof(pair));
	return pair;
}

static inline void pair_store(double *to, PAIR pair)
{
	memcpy(to, &pair, sizeof(pair));
}

/* a < b ? a : b of each element; a > b ? a : b */
static inline PAIR pair_less(PAIR a, PAIR b)
{
#ifdef __SSE2__
	return _mm_min_pd(a, b);
#else
	return (PAIR){a[0] < b[0] ? a[0] : b[0], a[1] < b[1] ? a[1] : b[1]};
#endif
}

static inline PAIR pair_more(PAIR a, PAIR b)
{
#ifdef __SSE2__
	return _mm_max_pd(a, b);
#else
	return (PAIR){a[0] > b[0] ? a[0] : b[0], a[1] > b[1] ? a[1] : b[1]};
#endif
}

#endif
