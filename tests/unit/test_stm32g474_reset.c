/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The board's reset causes, watchdog and supply against a register model.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <stdbool.h>

#include "firmware/port/stm32g474/registers.h"
#include "firmware/port/stm32g474/reset.h"
#include "tests/unit/stm32g474_model.h"

/* RCC_CSR, RM0440 7.4.28. */
#define LOW_POWER (1u << 31)
#define IWDG (1u << 29)
#define SOFTWARE (1u << 28)
#define BOR (1u << 27)
#define PIN (1u << 26)
#define OPTION_BYTES (1u << 25)

static void causes(void **state)
{
	static const struct {
		uint32_t flags;
		bool ran; /* the RAM still says so */
		enum port_reset cause;
	} cases[] = {
	        {BOR | PIN, false, PORT_RESET_POWER_ON},
	        {BOR | PIN, true, PORT_RESET_BROWN_OUT},
	        {BOR, true, PORT_RESET_BROWN_OUT},
	        {PIN, true, PORT_RESET_PIN},
	        {PIN, false, PORT_RESET_POWER_ON},
	        {IWDG | PIN, true, PORT_RESET_WATCHDOG},
	        {IWDG | BOR | PIN, false, PORT_RESET_WATCHDOG},
	        {SOFTWARE | PIN, true, PORT_RESET_COMMAND},
	        {SOFTWARE | PIN, false, PORT_RESET_COMMAND},
	        {LOW_POWER | PIN, true, PORT_RESET_PIN},
	        {OPTION_BYTES | PIN, true, PORT_RESET_PIN},
	        {0, true, PORT_RESET_PIN},
	        {0, false, PORT_RESET_POWER_ON},
	};

	(void)state;
	for (unsigned i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct reset_mark mark = {0xDEADBEEF, 0x12345678, 0xC35AF00F};

		model_init();
		if (cases[i].ran)
			(void)reset_cause(&mark);
		model_init();
		model_put(RCC_CSR, cases[i].flags);
		assert_int_equal(reset_cause(&mark), cases[i].cause);
		assert_int_equal(model_find(RCC_CSR, 1u << 23, 1u << 23, 0), 0); /* RMVF: next time afresh */
	}
}

static void crash(void **state)
{
	struct reset_mark mark = {0, 0, 0};

	(void)state;
	model_init();
	(void)reset_cause(&mark);
	reset_by_crash(&mark);
	assert_int_equal(model_get(0xE000ED0C), 0x05FA0004);
	model_put(RCC_CSR, SOFTWARE | PIN);
	assert_int_equal(reset_cause(&mark), PORT_RESET_WATCHDOG);
	reset_by_command(); /* and the mark is not left behind */
	model_put(RCC_CSR, SOFTWARE | PIN);
	assert_int_equal(reset_cause(&mark), PORT_RESET_COMMAND);
	reset_by_crash(&mark);
	model_put(RCC_CSR, BOR | PIN);
	assert_int_equal(reset_cause(&mark), PORT_RESET_BROWN_OUT);
}

static void restart(struct reset_mark *mark, uint32_t flags)
{
	model_init();
	model_put(RCC_CSR, flags);
	(void)reset_cause(mark);
}

static void kept(void **state)
{
	static const uint32_t resets[] = {PIN, IWDG | PIN, SOFTWARE | PIN, BOR | PIN, LOW_POWER | PIN};
	struct reset_mark mark = {0xDEADBEEF, 0x12345678, 0xC35AF00F}; /* a byte kept in RAM that is noise */

	(void)state;
	restart(&mark, BOR | PIN);
	assert_int_equal(reset_kept(&mark), 0);
	for (unsigned byte = 0; byte < 256; byte++)
		for (unsigned i = 0; i < sizeof(resets) / sizeof(resets[0]); i++) {
			reset_keep(&mark, (uint8_t)byte);
			assert_int_equal(reset_kept(&mark), byte);
			restart(&mark, resets[i]);
			assert_int_equal(reset_kept(&mark), byte);
		}
	reset_keep(&mark, 5);
	reset_by_crash(&mark);
	restart(&mark, SOFTWARE | PIN);
	assert_int_equal(reset_kept(&mark), 5);
	for (unsigned bit = 0; bit < 32; bit++) { /* one that a dip has changed is none */
		reset_keep(&mark, 5);
		mark.kept ^= 1u << bit;
		assert_int_equal(reset_kept(&mark), 0);
	}
	reset_keep(&mark, 5);
	mark.inverse ^= 1; /* the power was away */
	restart(&mark, BOR | PIN);
	assert_int_equal(reset_kept(&mark), 0);
}

static void brown_out_level(void **state)
{
	(void)state;
	for (uint32_t level = 0; level < 8; level++) {
		model_init();
		model_put(0x40022020, 0xFFEFF8AAu | level << 8); /* the option bytes as delivered, 3.7.8 */
		assert_int_equal(brown_out_set(), level == 4);
		assert_int_equal(model.writes, 0);
	}
}

static void watchdog(void **state)
{
	static const struct {
		uint32_t address, value;
	} expected[] = {
	        {0x40003000, 0xCCCC}, {0x40003000, 0x5555}, {0x40003004, 2},
	        {0x40003008, 127},    {0x40003000, 0xAAAA},
	};
	double counts;

	(void)state;
	model_init();
	assert_int_equal(watchdog_start(), 0);
	assert_int_equal(model.writes, 5);
	for (int i = 0; i < 5; i++) { /* the order of 35.3.2 */
		assert_int_equal(model.log[i].address, expected[i].address);
		assert_int_equal(model.log[i].value, expected[i].value);
	}
	counts = (model_get(IWDG_RLR) + 1) * (4u << model_get(IWDG_PR));
	assert_true(counts / 34000 > 0.050); /* the core may take 50 ms */
	assert_true(counts / 29500 < 0.075);
	model_put(IWDG_SR, 2); /* never taken over */
	assert_int_equal(watchdog_start(), DT_E_TIMEOUT);
	watchdog_kick();
	assert_int_equal(model.log[model.writes - 1].value, 0xAAAA);
}

static void supply(void **state)
{
	(void)state;
	model_init();
	supply_watch();
	assert_int_equal(model_get(PWR_CR2), 6 << 1 | 1);
	assert_true(supply_good());
	model_put(PWR_SR2, 1u << 11);
	assert_false(supply_good());
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(causes),          cmocka_unit_test(crash),    cmocka_unit_test(kept),
	        cmocka_unit_test(brown_out_level), cmocka_unit_test(watchdog), cmocka_unit_test(supply),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
