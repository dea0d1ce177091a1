/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The lengths behind `make busload`: a few counted by hand, the well-known bounds, and every data pattern of
 * short frames written out bit by bit.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <stdbool.h>

#include "common/link/canbits.h"

/* 0x181, 64 bytes. Start 0, identifier 00110000001, then RRS IDE FDF res BRS 00101:
 *     0 00110000 0[1] 01 00101             one stuff bit, 18 nominal bits before the data rate
 * ESI 0, length code 1111, 512 data bits: the first 1 makes five, then every fourth bit again, 511 / 4 = 127
 * more, but the last of these would be after bit 513: 1 + 127 = 128 stuff bits. CRC field: count 4, CRC 21,
 * fixed 7. CRC delimiter 1. After it ACK 2, EOF 7, intermission 3. */
static void block_by_hand(void **state)
{
	struct canbits bits = canbits_fd(0x181, 64);

	(void)state;
	assert_int_equal(bits.nominal, 18 + 12);
	assert_int_equal(bits.data, 1 + 4 + 512 + 128 + 4 + 21 + 7 + 1);
	assert_int_equal((int)(10 * canbits_us(bits, 1, 5) + 0.5), 1656); /* 30 + 678 / 5 us */
	assert_int_equal((int)(10 * canbits_us(bits, 1, 2) + 0.5), 3690);
	assert_int_equal((int)(100 * canbits_us(bits, 1, 8) + 0.5), 11475);
}

/* 0x682, 24 bytes. 0 11010000 0[1] 10 00101: one stuff bit. ESI 0, length code 1100 ends in two zeros: three
 * more, then every fourth of the 191 bits before the last, 1 + 188 / 4 = 48. */
static void capture_end_by_hand(void **state)
{
	struct canbits bits = canbits_fd(0x682, 24);

	(void)state;
	assert_int_equal(bits.nominal, 18 + 12);
	assert_int_equal(bits.data, 1 + 4 + 192 + 48 + 4 + 21 + 7 + 1);
}

/* 44 + 8 n bits and the intermission without stuffing; at most a stuff bit after the fifth and then every
 * fourth of the 34 + 8 n bits from start to CRC. */
static void classic_within_the_known_bound(void **state)
{
	(void)state;
	for (uint32_t id = 0; id < 0x800; id++)
		for (unsigned n = 0; n <= 8; n++) {
			unsigned bits = canbits_classic(id, n).nominal;

			assert_int_equal(canbits_classic(id, n).data, 0);
			assert_in_range(bits, 47 + 8 * n + (8 * n + 15) / 5, 47 + 8 * n + (33 + 8 * n) / 4);
		}
}

/* ---- every pattern, written out ---- */

struct line {
	uint8_t bit[256];
	unsigned count;
};

static void add(struct line *line, uint32_t word, unsigned count)
{
	for (unsigned i = count; i-- > 0;)
		line->bit[line->count++] = word >> i & 1;
}

/* Stuff bits among the bits sent, counted by looking at what has gone out. */
static unsigned stuffed(const struct line *raw, bool after_the_last)
{
	struct line sent = {.count = 0};

	for (unsigned i = 0; i < raw->count; i++) {
		const uint8_t *end;

		sent.bit[sent.count++] = raw->bit[i];
		end = sent.bit + sent.count;
		if (sent.count >= 5 && end[-1] == end[-2] && end[-2] == end[-3] && end[-3] == end[-4] &&
		    end[-4] == end[-5] && (after_the_last || i + 1 < raw->count))
			sent.bit[sent.count++] = !raw->bit[i];
	}
	return sent.count - raw->count;
}

static unsigned crc15(const struct line *line)
{
	unsigned crc = 0;

	for (unsigned i = 0; i < line->count; i++) {
		bool invert = line->bit[i] != (crc >> 14 & 1);

		crc = crc << 1 & 0x7FFF;
		if (invert)
			crc ^= 0x4599;
	}
	return crc;
}

static void every_short_fd_frame(void **state)
{
	static const uint16_t ids[] = {0x000, 0x07F, 0x181, 0x281, 0x381, 0x481, 0x681, 0x7FF};

	(void)state;
	for (size_t i = 0; i < sizeof(ids) / sizeof(ids[0]); i++)
		for (unsigned n = 1; n <= 2; n++) {
			unsigned longest = 0;

			for (uint32_t data = 0; data < 1u << 8 * n; data++) {
				struct line line = {.count = 0};
				unsigned count;

				add(&line, ids[i], 12);
				add(&line, 0x5, 5);
				add(&line, n, 5); /* ESI 0 and the length code */
				add(&line, data, 8 * n);
				count = line.count + stuffed(&line, false);
				longest = count > longest ? count : longest;
			}
			/* CRC field 4 + 17 + 6, delimiter 1, end 12 */
			assert_int_equal(canbits_fd(ids[i], n).nominal + canbits_fd(ids[i], n).data,
			                 longest + 27 + 1 + 12);
		}
}

static void every_short_classic_frame(void **state)
{
	static const uint16_t ids[] = {0x000, 0x07F, 0x181, 0x381, 0x682, 0x7FF};

	(void)state;
	for (size_t i = 0; i < sizeof(ids) / sizeof(ids[0]); i++)
		for (unsigned n = 0; n <= 2; n++) {
			unsigned longest = 0, bound = canbits_classic(ids[i], n).nominal;

			for (uint32_t data = 0; data < 1u << 8 * n; data++) {
				struct line line = {.count = 0};
				unsigned count;

				add(&line, ids[i], 12);
				add(&line, n, 7); /* RTR, IDE, r0 and the length code */
				add(&line, data, 8 * n);
				add(&line, crc15(&line), 15);
				count = line.count + stuffed(&line, true) + 13;
				longest = count > longest ? count : longest;
			}
			assert_true(longest <= bound);
			if (n == 2) /* the CRC follows from the data, which costs three at most */
				assert_in_range(longest, bound - 3, bound);
		}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(block_by_hand),
	        cmocka_unit_test(capture_end_by_hand),
	        cmocka_unit_test(classic_within_the_known_bound),
	        cmocka_unit_test(every_short_fd_frame),
	        cmocka_unit_test(every_short_classic_frame),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
