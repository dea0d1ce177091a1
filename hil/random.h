/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HIL_RANDOM_H
#define DT_HIL_RANDOM_H
/*
 * Repeatable random numbers: splitmix64 (Steele, Lea, Flood 2014). Any seed is a good first state.
 */
#include <stdint.h>

static inline uint64_t random_next(uint64_t *state)
{
	uint64_t z = (*state += 0x9E3779B97F4A7C15u);

	z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
	z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
	return z ^ (z >> 31);
}

#endif
