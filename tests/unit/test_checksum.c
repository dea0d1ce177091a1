/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The CRC-32 of much at once against its published check value and against the one of the wire, byte by byte.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include "common/crc.h"
#include "host/base/checksum.h"

static void is_the_one_of_the_wire(void **state)
{
	uint8_t bytes[700];
	uint32_t random = 1, plain = CRC32_INIT;

	(void)state;
	for (size_t i = 0; i < sizeof(bytes); i++) {
		random = random * 1664525 + 1013904223;
		bytes[i] = (uint8_t)(random >> 24);
	}
	for (size_t count = 0; count < sizeof(bytes); count++) {
		assert_int_equal(checksum_crc32(CRC32_INIT, bytes, count), plain);
		plain = crc32(plain, bytes + count, 1);
	}
}

static void of_nine_digits_and_of_zeros(void **state)
{
	static const uint8_t zeros[1024];

	(void)state;
	assert_int_equal(checksum_crc32(CRC32_INIT, (const uint8_t *)"123456789", 9),
	                 0xCBF43926);                                                   /* IEEE 802.3 */
	assert_int_equal(checksum_crc32(CRC32_INIT, zeros, sizeof(zeros)), 0xEFB5AF2E); /* zlib's */
}

static void continues_at_any_byte(void **state)
{
	uint8_t bytes[300];
	uint32_t whole;

	(void)state;
	for (size_t i = 0; i < sizeof(bytes); i++)
		bytes[i] = (uint8_t)(i * 7 + (i >> 5));
	whole = crc32(CRC32_INIT, bytes, sizeof(bytes));
	for (size_t first = 0; first <= sizeof(bytes); first++)
		assert_int_equal(checksum_crc32(checksum_crc32(CRC32_INIT, bytes, first), bytes + first,
		                                sizeof(bytes) - first),
		                 whole);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(is_the_one_of_the_wire),
	        cmocka_unit_test(of_nine_digits_and_of_zeros),
	        cmocka_unit_test(continues_at_any_byte),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
