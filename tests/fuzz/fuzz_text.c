/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Frames as text: SLCAN byte by byte, candump line by line. What is a frame is written and read again: the
 * same frame.
 */
#include <string.h>

#include "common/link/candump.h"
#include "common/link/slcan_text.h"
#include "tests/fuzz/fuzz.h"

static bool same(const struct frame *a, const struct frame *b)
{
	return a->id == b->id && a->flags == b->flags && a->length == b->length &&
	       memcmp(a->data, b->data, a->length) == 0;
}

static void try_slcan(const uint8_t *bytes, size_t size)
{
	struct slcan_decoder decoder = {0}, second = {0};

	for (size_t i = 0; i < size; i++) {
		char line[SLCAN_LINE_MAX];
		struct frame frame, again;
		size_t length;
		int result = 0;

		if (slcan_decode(&decoder, (char)bytes[i], &frame) != 1)
			continue;
		length = slcan_encode(line, &frame);
		for (size_t k = 0; k < length; k++)
			result = slcan_decode(&second, line[k], &again);
		if (length > 0 && (result != 1 || !same(&frame, &again)))
			fuzz_fail("SLCAN: not the same frame again");
	}
}

static void try_candump(const uint8_t *bytes, size_t size)
{
	const char *at = (const char *)bytes, *end = at + size;

	while (at < end) {
		const char *stop = memchr(at, '\n', (size_t)(end - at));
		size_t length = (size_t)((stop != NULL ? stop : end) - at);
		char line[CANDUMP_LINE_MAX];
		struct frame frame, again;
		unsigned column;

		if (candump_parse(at, length, &frame, &column) == 1) {
			size_t written = candump_format(line, &frame, "can0");

			if (candump_parse(line, written, &again, &column) != 1 || !same(&frame, &again))
				fuzz_fail("candump: not the same frame again: %s", line);
		}
		at += length + 1;
	}
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
	if (size < 1)
		return 0;
	if (bytes[0] % 2 == 0)
		try_slcan(bytes + 1, size - 1);
	else
		try_candump(bytes + 1, size - 1);
	return 0;
}
