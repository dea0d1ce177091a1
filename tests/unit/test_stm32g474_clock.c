/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The board's clock tree against a register model: frequencies worked out from what was written, the order
 * the manual asks for, and every wait that is not answered.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include "firmware/port/stm32g474/clock.h"
#include "firmware/port/stm32g474/registers.h"
#include "tests/unit/stm32g474_model.h"

/* What does not answer. */
enum dead { NOTHING, CRYSTAL, CAPTURE, SECOND_CAPTURE, LOCK, FLASH, SWITCH };

static struct {
	double hse_hz, hsi_hz;
	enum dead dead;
	unsigned captures;
} hardware;

static uint32_t on_read(uint32_t address, uint32_t kept)
{
	if (address == TIM17 + TIM_SR) {
		if (hardware.dead == CAPTURE || (hardware.dead == SECOND_CAPTURE && hardware.captures > 0))
			return 0;
		return TIM_CCIF(0);
	}
	if (address == TIM17 + TIM_CCR(0)) /* 8 periods of HSE/32 on a 16-bit counter; close to its wrap */
		return (uint32_t)(65500 + hardware.captures++ * hardware.hsi_hz * 256 / hardware.hse_hz) &
		       0xFFFF;
	return kept;
}

static uint32_t on_write(uint32_t address, uint32_t written, uint32_t kept)
{
	if (address == RCC_CR) {
		if ((written & RCC_CR_HSEON) && hardware.dead != CRYSTAL)
			written |= RCC_CR_HSERDY;
		if ((written & RCC_CR_PLLON) && hardware.dead != LOCK)
			written |= RCC_CR_PLLRDY;
	}
	if (address == RCC_CFGR && hardware.dead != SWITCH)
		written = (written & ~RCC_CFGR_SWS) | (written & 3u) << 2;
	if (address == FLASH_ACR && hardware.dead == FLASH)
		return kept;
	return written;
}

static int run(double hse_hz, double hsi_hz, enum dead dead, uint32_t *can_hz)
{
	model_init();
	model_put(RCC_CFGR, 5); /* reset values: HSI16 */
	model_put(RCC_CR, 0x500);
	model_put(PWR_CR5, PWR_CR5_R1MODE);
	model_put(FLASH_ACR, 0x00040600); /* with the debugger let in */
	model.on_read = on_read;
	model.on_write = on_write;
	hardware.hse_hz = hse_hz;
	hardware.hsi_hz = hsi_hz;
	hardware.dead = dead;
	hardware.captures = 0;
	return clock_setup(can_hz);
}

/* PLLCFGR as RM0440 7.4.4 defines it. */
static void check_pll(double hse_hz)
{
	uint32_t r = model_get(RCC_PLLCFGR);
	double input = hse_hz / ((r >> 4 & 15) + 1), vco = input * (r >> 8 & 127);

	assert_int_equal(r & 3, 3); /* from HSE */
	assert_true(input >= 2.66e6 && input <= 16e6);
	assert_true(vco >= 96e6 && vco <= 344e6);
	assert_true(vco / (2 * ((r >> 25 & 3) + 1)) == 168e6);
	assert_true(vco / (2 * ((r >> 21 & 3) + 1)) == 56e6);
	assert_int_equal(r >> 24 & 1, 1);
	assert_int_equal(r >> 20 & 1, 1);
}

static void frequencies(void **state)
{
	uint32_t can_hz = 0;

	(void)state;
	assert_int_equal(run(24e6, 16e6, NOTHING, &can_hz), 0);
	check_pll(24e6);
	assert_int_equal(can_hz, 56000000);
	assert_int_equal(model_get(RCC_CCIPR) >> 24 & 3, 1); /* PLL Q */
	assert_int_equal(run(40e6, 16e6, NOTHING, &can_hz), 0);
	check_pll(40e6);
	assert_int_equal(can_hz, 40000000);
	assert_int_equal(model_get(RCC_CCIPR) >> 24 & 3, 0); /* HSE */
	assert_int_equal(model_get(RCC_CFGR) & 0xFF, 0xF);   /* on the PLL, AHB not divided */
	assert_int_equal(model_get(RCC_APB2ENR) & RCC_APB2ENR_TIM17, 0);
}

static void order(void **state)
{
	uint32_t can_hz;
	int hse, factors, on, outputs, half, boost, flash, on_pll, whole, security;

	(void)state;
	assert_int_equal(run(24e6, 16e6, NOTHING, &can_hz), 0);
	hse = model_find(RCC_CR, RCC_CR_HSEON, RCC_CR_HSEON, 0);
	factors = model_find(RCC_PLLCFGR, 3, 3, 0);
	on = model_find(RCC_CR, RCC_CR_PLLON, RCC_CR_PLLON, 0);
	outputs = model_find(RCC_PLLCFGR, RCC_PLLCFGR_REN, RCC_PLLCFGR_REN, 0);
	half = model_find(RCC_CFGR, 0xF3, 0x81, 0); /* AHB / 2, still on HSI16 */
	boost = model_find(PWR_CR5, PWR_CR5_R1MODE, 0, 0);
	flash = model_find(FLASH_ACR, 15, 4, 0);
	on_pll = model_find(RCC_CFGR, 0xF3, 0x83, 0);
	whole = model_find(RCC_CFGR, 0xF3, 0x03, 0);
	security = model_find(RCC_CR, 1u << 19, 1u << 19, 0); /* 7.2.8: with the crystal running */
	assert_true(0 <= hse && hse < factors && factors < on && on < outputs); /* 7.2.4 */
	assert_true(outputs < half && half < boost && boost < flash && flash < on_pll &&
	            on_pll < whole); /* 6.1.5 */
	assert_true(security > whole);
	assert_int_equal(model_get(RCC_CR) & (1u << 24 | 1u << 19 | 1u << 16),
	                 1u << 24 | 1u << 19 | 1u << 16);
	assert_int_equal(model_get(FLASH_ACR), 0x00040704);
	assert_int_equal(model_count(RCC_PLLCFGR), 2);
	assert_int_equal(model_count(RCC_CFGR), 3);
}

static void crystals(void **state)
{
	static const double wrong[] = {8e6, 12e6, 16e6, 20e6, 25e6, 32e6, 48e6};
	uint32_t can_hz = 7;

	(void)state;
	for (unsigned i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++) {
		assert_int_equal(run(wrong[i], 16e6, NOTHING, &can_hz), DT_E_LINK);
		assert_int_equal(model_count(RCC_CFGR), 0);
	}
	assert_int_equal(can_hz, 7);
	for (double off = 0.982; off < 1.0181; off += 0.004) { /* the internal oscillator's error */
		assert_int_equal(run(24e6, 16e6 * off, NOTHING, &can_hz), 0);
		assert_int_equal(can_hz, 56000000);
		assert_int_equal(run(40e6, 16e6 * off, NOTHING, &can_hz), 0);
		assert_int_equal(can_hz, 40000000);
	}
}

static void silence(void **state)
{
	uint32_t can_hz = 7;

	(void)state;
	for (enum dead dead = CRYSTAL; dead <= SWITCH; dead++) {
		assert_int_equal(run(24e6, 16e6, dead, &can_hz), DT_E_TIMEOUT);
		if (dead != SWITCH) /* stays on HSI16 */
			assert_int_equal(model_find(RCC_CFGR, 3, 3, 0), -1);
		assert_int_equal(model_find(RCC_CR, 1u << 19, 1u << 19, 0), -1);
	}
	assert_int_equal(can_hz, 7);
}

/* Why there are two crystals: with the core at a whole number of counts at 7 and 10 kHz no output Q of the
 * same PLL is exact at 5 and 8 Mbit/s, whatever the crystal (VCO up to 344 MHz; R and Q 2, 4, 6, 8). */
static void no_pll_gives_both(void **state)
{
	static const unsigned divisors[] = {2, 4, 6, 8};

	(void)state;
	for (unsigned r = 0; r < 4; r++)
		for (unsigned k = 1; 70000u * k <= 170000000u; k++) {
			uint64_t vco = 70000ull * k * divisors[r];

			for (unsigned q = 0; q < 4 && vco >= 96000000 && vco <= 344000000; q++)
				assert_false(vco % divisors[q] == 0 && vco / divisors[q] % 40000000 == 0);
		}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(frequencies),       cmocka_unit_test(order),
	        cmocka_unit_test(crystals),          cmocka_unit_test(silence),
	        cmocka_unit_test(no_pll_gives_both),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
