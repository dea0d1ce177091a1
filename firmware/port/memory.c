/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Words first, since nearly all that is moved here is frames and ticks; the processor takes them unaligned.
 */
#include "common/memory.h"

#include <stdint.h>

struct word {
	uint32_t v;
} __attribute__((packed, may_alias));

/* Loads before stores: the processor's pipeline takes neighbours of a kind in a clock each. */
static inline void copy_four(unsigned char *to, const unsigned char *from)
{
	struct word *d = (void *)to;
	const struct word *s = (const void *)from;
	uint32_t a = s[0].v, b = s[1].v, c = s[2].v, e = s[3].v;

	d[0].v = a;
	d[1].v = b;
	d[2].v = c;
	d[3].v = e;
}

void *memcpy(void *restrict to, const void *restrict from, size_t count)
{
	unsigned char *d = to;
	const unsigned char *s = from;

	for (; count >= 32; count -= 32, d += 32, s += 32) {
		copy_four(d, s);
		copy_four(d + 16, s + 16);
	}
	if (count >= 16) {
		copy_four(d, s);
		count -= 16, d += 16, s += 16;
	}
	for (; count >= 4; count -= 4, d += 4, s += 4)
		((struct word *)(void *)d)->v = ((const struct word *)(const void *)s)->v;
	for (; count > 0; count--)
		*d++ = *s++;
	return to;
}

void *memset(void *to, int byte, size_t count)
{
	const uint32_t pattern = (uint8_t)byte * 0x01010101u;
	unsigned char *d = to;

	for (; count >= 16; count -= 16, d += 16)
		for (unsigned i = 0; i < 4; i++)
			((struct word *)(void *)d)[i].v = pattern;
	for (; count >= 4; count -= 4, d += 4)
		((struct word *)(void *)d)->v = pattern;
	for (; count > 0; count--)
		*d++ = (unsigned char)byte;
	return to;
}

int memcmp(const void *a, const void *b, size_t count)
{
	const unsigned char *p = a, *q = b;

	for (; count > 0; count--, p++, q++)
		if (*p != *q)
			return *p - *q;
	return 0;
}
