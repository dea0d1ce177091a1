/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Priorities and requests as PM0214 and RM0440 table 100 have them; expected addresses and bytes by hand. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "firmware/port/stm32g474/interrupt.h"
#include "tests/unit/stm32g474_model.h"

enum {
	FDCAN1 = 21,
	TIM1_UP = 25,
	TIM2 = 28,
	TIM3 = 29,
	TIM4 = 30,
};

#define ISER0 0xE000E100u
#define IPR 0xE000E400u
#define ICSR 0xE000ED04u
#define SHPR3 0xE000ED20u

static unsigned priority_of(unsigned irq)
{
	return model_get(IPR + irq / 4 * 4) >> irq % 4 * 8 & 0xFF;
}

static void samples_are_above_all_else(void **state)
{
	(void)state;
	model_init();
	interrupt_setup();
	for (unsigned irq = 0; irq < 32; irq++) {
		unsigned expected = 0;

		if (irq == TIM1_UP || irq == TIM3 || irq == TIM4)
			expected = 0x40;
		if (irq == FDCAN1 || irq == TIM2)
			expected = 0x80;
		assert_int_equal(priority_of(irq), expected);
	}
	assert_int_equal(model_get(SHPR3), 0x00800000); /* PendSV: the third byte; SysTick's is left alone */
	assert_int_equal(model_get(ISER0), 1u << 21 | 1u << 25 | 1u << 28 | 1u << 29 | 1u << 30);
	assert_int_equal(model_count(ISER0), 1);
	/* enabled last: none comes with a priority that is not its own */
	assert_int_equal(model_find(ISER0, 0, 0, 0), model.writes - 1);
}

static void others_keep_their_priorities(void **state)
{
	(void)state;
	model_init();
	model_put(IPR + 28, 0x11223344); /* 28 to 31 */
	model_put(SHPR3, 0x55667788);
	interrupt_setup();
	assert_int_equal(model_get(IPR + 28), 0x11404080);
	assert_int_equal(model_get(SHPR3), 0x55807788);
}

static void control_is_requested_by_pendsv(void **state)
{
	(void)state;
	model_init();
	interrupt_control();
	assert_int_equal(model.writes, 1);
	assert_int_equal(model.log[0].address, ICSR);
	assert_int_equal(model.log[0].value, 0x10000000); /* nothing else: the other bits are requests too */
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(samples_are_above_all_else),
	        cmocka_unit_test(others_keep_their_priorities),
	        cmocka_unit_test(control_is_requested_by_pendsv),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
