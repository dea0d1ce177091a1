/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The board's random numbers against a register model: start-up, and every way in which the generator does
 * not deliver.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <stdbool.h>
#include <string.h>

#include "firmware/port/stm32g474/random.h"
#include "firmware/port/stm32g474/registers.h"
#include "tests/unit/stm32g474_model.h"

enum { CR = 0x50060800, SR = 0x50060804, DR = 0x50060808 }; /* RM0440 2.2.2, 26.7 */

static struct {
	bool no_oscillator, never_ready;
	unsigned bad;    /* numbers still to come with an error */
	uint32_t errors; /* status bits that come with those */
	uint32_t next;   /* number */
	uint32_t step;   /* to the one after */
	unsigned taken, discarded;
} hardware;

static uint32_t on_read(uint32_t address, uint32_t kept)
{
	if (address == SR) {
		if ((model_get(CR) & 4) == 0 || hardware.never_ready)
			return kept;
		return kept | 1;
	}
	if (address == DR) {
		uint32_t number = hardware.next;

		hardware.next += hardware.step;
		hardware.taken++;
		if (hardware.bad > 0 && hardware.errors != 0)
			model_put(SR, hardware.errors);
		hardware.bad -= hardware.bad > 0;
		return number;
	}
	return kept;
}

static uint32_t on_write(uint32_t address, uint32_t written, uint32_t kept)
{
	(void)kept;
	if (address == RCC_CRRCR && (written & 1) && !hardware.no_oscillator)
		written |= 2;
	if (address == CR && (written & 4)) { /* 26.3.5: clocks first */
		assert_int_equal(model_get(RCC_CRRCR) & 3, 3);
		assert_int_equal(model_get(RCC_AHB2ENR) >> 26 & 1, 1);
		assert_int_equal(model_get(RCC_CCIPR) >> 26 & 3, 0); /* HSI48 */
		assert_int_equal(written, 4); /* clock error detection on, no interrupt */
	}
	return written;
}

static void reset_hardware(void)
{
	model_init();
	memset(&hardware, 0, sizeof(hardware));
	hardware.next = 0x12345678;
	hardware.step = 0x9E3779B9;
	model_put(RCC_CCIPR, 3u << 26);
	model_put(RCC_AHB2ENR, 7);
	model.on_read = on_read;
	model.on_write = on_write;
}

static void delivers(void **state)
{
	uint32_t value = 0;

	(void)state;
	reset_hardware();
	for (unsigned i = 0; i < 100; i++) {
		assert_int_equal(random_number(&value), 0);
		assert_int_equal(value, 0x12345678u + i * 0x9E3779B9u);
	}
	assert_int_equal(model_count(CR), 1); /* started once */
	assert_int_equal(model_get(RCC_AHB2ENR), 7u | 1u << 26);
}

static void fails(void)
{
	uint32_t value = 7;

	assert_int_equal(random_number(&value), DT_E_SYSTEM);
	assert_int_equal(value, 7);
	assert_true(model.reads < 20000); /* each a clock or more of 168 MHz */
}

static void silence(void **state)
{
	(void)state;
	reset_hardware();
	hardware.no_oscillator = true;
	fails();
	assert_int_equal(model_count(CR), 0);
	hardware.no_oscillator = false; /* and it tries anew the next time */
	hardware.never_ready = true;
	fails();
	assert_int_equal(hardware.taken, 3 * 12); /* emptied three times, nothing given out */
}

/* 26.3.7: clear, start again, throw twelve away. */
static void recovers(void **state)
{
	static const uint32_t errors[] = {1u << 1 | 1u << 5, 1u << 2 | 1u << 6, 1u << 5, 1u << 6};

	(void)state;
	for (unsigned i = 0; i < 4; i++) {
		uint32_t value = 0;

		reset_hardware();
		hardware.next = i << 8; /* no number twice */
		hardware.bad = 1;
		hardware.errors = errors[i];
		assert_int_equal(random_number(&value), 0);
		assert_int_equal(hardware.taken, 1 + 12 + 1);
		assert_int_equal(value, (i << 8) + 13 * 0x9E3779B9u);
		assert_true(model_find(SR, ~0u, 0, 0) >= 0);
		assert_true(model_find(CR, 4, 0, 0) > model_find(SR, ~0u, 0, 0));
		assert_true(model_find(CR, 4, 4, model_find(CR, 4, 0, 0)) > 0);
		reset_hardware();
		hardware.bad = 1000; /* an error that stays */
		hardware.errors = errors[i];
		fails();
	}
}

static void stuck(void **state)
{
	uint32_t value = 0;

	(void)state;
	reset_hardware();
	hardware.step = 0;
	assert_int_equal(random_number(&value), 0);
	fails(); /* the same again */
	reset_hardware();
	hardware.next = 0;
	hardware.step = 0;
	fails(); /* what the register gives when there is nothing */
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(delivers),
	        cmocka_unit_test(silence),
	        cmocka_unit_test(recovers),
	        cmocka_unit_test(stuck),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
