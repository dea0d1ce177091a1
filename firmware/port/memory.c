/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Words first, since nearly all that is moved here is frames and ticks; the processor takes them unaligned.
 */
#include "common/memory.h"

#include <stdint.h>

struct word {
	uint32_t v;
} __attribute__((packed, may_alias));

void *memcpy(void *restrict to, const void *restrict from, size_t count)
{
	unsigned char *d = to;
	const unsigned char *s = from;

	for (; count >= 16; count -= 16, d += 16, s += 16) {
		struct word *dw = (void *)d;
		const struct word *sw = (const void *)s;
		uint32_t a = sw[0].v, b = sw[1].v, c = sw[2].v, e = sw[3].v;

		dw[0].v = a;
		dw[1].v = b;
		dw[2].v = c;
		dw[3].v = e;
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
