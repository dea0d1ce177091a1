/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The checksums against their published check values and a bit-by-bit reference.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include "common/crc.h"

static const uint8_t nine[] = "123456789";

static void published_check_values(void **state)
{
	(void)state;
	assert_int_equal(crc8(CRC8_INIT, nine, 9), 0xDF);         /* AUTOSAR CRC8H2F */
	assert_int_equal(crc32(CRC32_INIT, nine, 9), 0xCBF43926); /* IEEE 802.3 */
	assert_int_equal(crc8(CRC8_INIT, nine, 0), 0);
	assert_int_equal(crc32(CRC32_INIT, nine, 0), 0);
}

static uint8_t slow8(const uint8_t *bytes, size_t count)
{
	unsigned crc = 0xFF;

	for (size_t i = 0; i < count; i++) {
		crc ^= bytes[i];
		for (int bit = 0; bit < 8; bit++)
			crc = (crc & 0x80) ? ((crc << 1) ^ 0x2F) & 0xFF : crc << 1;
	}
	return (uint8_t)(crc ^ 0xFF);
}

static uint32_t slow32(const uint8_t *bytes, size_t count)
{
	uint32_t crc = 0xFFFFFFFF;

	for (size_t i = 0; i < count; i++) {
		crc ^= bytes[i];
		for (int bit = 0; bit < 8; bit++)
			crc = (crc & 1) ? (crc >> 1) ^ 0xEDB88320 : crc >> 1;
	}
	return ~crc;
}

static void table_equals_bit_by_bit_and_continues(void **state)
{
	uint8_t bytes[300];

	(void)state;
	for (size_t i = 0; i < sizeof(bytes); i++)
		bytes[i] = (uint8_t)(i * 7 + (i >> 5));
	for (size_t count = 0; count <= sizeof(bytes); count++) {
		size_t half = count / 2;

		assert_int_equal(crc8(CRC8_INIT, bytes, count), slow8(bytes, count));
		assert_int_equal(crc32(CRC32_INIT, bytes, count), slow32(bytes, count));
		assert_int_equal(crc8(crc8(CRC8_INIT, bytes, half), bytes + half, count - half),
		                 slow8(bytes, count));
		assert_int_equal(crc32(crc32(CRC32_INIT, bytes, half), bytes + half, count - half),
		                 slow32(bytes, count));
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(published_check_values),
	        cmocka_unit_test(table_equals_bit_by_bit_and_continues),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
