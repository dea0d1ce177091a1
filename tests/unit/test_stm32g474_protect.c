/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The board's memory protection: what the registers let through, address by address, as PM0214 4.2 decodes
 * them.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <stdbool.h>

#include "firmware/port/stm32g474/protect.h"
#include "tests/unit/stm32g474_model.h"

enum { READ = 1, WRITE = 2, EXECUTE = 4 };

#define SHCSR 0xE000ED24u
#define CTRL 0xE000ED94u
#define RBAR 0xE000ED9Cu
#define RASR 0xE000EDA0u

static struct {
	uint32_t base, rasr;
} regions[8];

static uint32_t on_write(uint32_t address, uint32_t written, uint32_t kept)
{
	(void)kept;
	if (address == RBAR) {
		assert_int_equal(written >> 4 & 1, 1);
		assert_in_range(written & 15, 0, 7);
		regions[written & 15].base = written & ~31u;
	} else if (address == RASR) {
		uint32_t number = model_get(RBAR) & 15, size = 2u << (written >> 1 & 31);

		assert_int_equal(model_get(CTRL), 0);
		assert_int_equal(regions[number].base % size, 0); /* 4.2.8: aligned to its size */
		regions[number].rasr = written;
	}
	return written;
}

/* What a privileged access may do; the highest region counts; no default map: PRIVDEFENA is 0. */
static unsigned allowed(uint32_t address)
{
	unsigned found = 0;

	for (unsigned i = 0; i < 8; i++) {
		uint32_t rasr = regions[i].rasr, size = 2u << (rasr >> 1 & 31),
		         offset = address - regions[i].base;
		unsigned access = rasr >> 24 & 7;

		if ((rasr & 1) == 0 || offset >= size)
			continue;
		if (size >= 256 && (rasr >> 8 >> (offset / (size / 8)) & 1))
			continue;
		found = access == 0 ? 0 : access >= 5 ? READ : READ | WRITE;
		if (found != 0 && (rasr >> 28 & 1) == 0)
			found |= EXECUTE;
	}
	return found;
}

static void map(void **state)
{
	static const struct {
		uint32_t first, last;
		unsigned expected;
	} ranges[] = {
	        {0x00000000, 0x07FFFFFF, 0}, /* NULL */
	        {0x08000000, 0x0807FFFF, READ | EXECUTE},
	        {0x08080000, 0x0FFFFFFF, 0},
	        {0x10000000, 0x10000FFF, READ | WRITE}, /* the stack */
	        {0x10001000, 0x1FFFFFFF, 0},
	        {0x20000000, 0x20017FFF, READ | WRITE}, /* 96 KiB */
	        {0x20018000, 0x3FFFFFFF, 0},
	        {0x40000000, 0x4003FFFF, READ | WRITE},
	        {0x40040000, 0x47FFFFFF, 0},
	        {0x48000000, 0x48001FFF, READ | WRITE},
	        {0x48002000, 0x4FFFFFFF, 0},
	        {0x50000000, 0x5007FFFF, READ | WRITE},
	        {0x50080000, 0xDFFFFFFF, 0},
	};
	uint32_t next = 0;

	(void)state;
	model_init();
	model.on_write = on_write;
	model_put(SHCSR, 1);
	protect_setup();
	for (unsigned i = 0; i < sizeof(ranges) / sizeof(ranges[0]); i++) {
		assert_int_equal(ranges[i].first, next); /* the list has no hole */
		next = ranges[i].last + 1;
		assert_int_equal(allowed(ranges[i].first), ranges[i].expected);
		assert_int_equal(allowed(ranges[i].first / 2 + ranges[i].last / 2), ranges[i].expected);
		assert_int_equal(allowed(ranges[i].last), ranges[i].expected);
	}
}

static void order(void **state)
{
	(void)state;
	model_init();
	model_put(SHCSR, 1);
	protect_setup();
	assert_int_equal(model_get(SHCSR), 7u << 16 | 1); /* each fault is told as what it is */
	assert_int_equal(model.log[model.writes - 1].address, CTRL);
	assert_int_equal(model.log[model.writes - 1].value, 1);
	assert_int_equal(model.barrier_at, model.writes);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(map),
	        cmocka_unit_test(order),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
