/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The board's converters against a register model: set-up in the manual's order, the sequence of channels,
 * codes, and what becomes of scans that are late, missing or out of step.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <stdbool.h>
#include <string.h>

#include "common/wire.h"
#include "firmware/port/stm32g474/adc.h"
#include "firmware/port/stm32g474/registers.h"
#include "tests/unit/stm32g474_model.h"

enum { MIDDLE = 32760, RAILS = 65520 };

static const uint32_t adcs[] = {0x50000000, 0x50000100, 0x50000400, 0x50000500}; /* ADC1 to 4 */

static struct {
	unsigned dead; /* step of the start-up that is never done: 1 calibration, 2 ready, 3 stop */
	unsigned calibrated;
} hardware;

static bool is_control(uint32_t address)
{
	for (unsigned i = 0; i < 4; i++)
		if (address == adcs[i] + ADC_CR)
			return true;
	return false;
}

/* ADC_CR, 21.7.3: bits are set by writing 1; calibration only while disabled, ADEN only after it. */
static uint32_t write_control(uint32_t address, uint32_t written, uint32_t kept)
{
	if (written & ADC_CR_ADCAL) {
		assert_int_equal(kept & (ADC_CR_ADEN | ADC_CR_ADVREGEN), ADC_CR_ADVREGEN);
		hardware.calibrated++;
		return hardware.dead == 1 ? written : written & ~ADC_CR_ADCAL;
	}
	if (written & ADC_CR_ADEN && hardware.dead != 2)
		model_put(address - ADC_CR + ADC_ISR, ADC_ISR_ADRDY);
	if (written & ADC_CR_ADSTART) {
		assert_true(kept & ADC_CR_ADEN);
		if (address == ADC1 + ADC_CR || address == ADC3 + ADC_CR) /* the slave follows */
			model_put(address + 0x100, model_get(address + 0x100) | ADC_CR_ADSTART);
	}
	if (written & ADC_CR_ADSTP) {
		kept &= hardware.dead == 3 ? ~0u : ~ADC_CR_ADSTART;
		model_put(address + 0x100, model_get(address + 0x100) & ~ADC_CR_ADSTART);
		return kept;
	}
	return (kept & ~ADC_CR_ADVREGEN & ~(1u << 29)) | written;
}

static uint32_t on_write(uint32_t address, uint32_t written, uint32_t kept)
{
	if (is_control(address))
		return write_control(address, written, kept);
	if (address == ADC12 + ADC_CCR || address == ADC345 + ADC_CCR)
		for (unsigned i = 0; i < 2; i++) /* only while both are disabled */
			assert_int_equal(model_get((address & 0xFFFFFF00u) - 0x300 + 0x100 * i + ADC_CR) &
			                         ADC_CR_ADEN,
			                 0);
	if (address == DMA1_IFCR)
		model_put(DMA1_ISR, model_get(DMA1_ISR) & ~written);
	for (unsigned i = 0; i < 4; i++) {
		if (address == adcs[i] + ADC_ISR)
			return kept & ~written;
		if (address == adcs[i] + ADC_CFGR || address == adcs[i] + ADC_SQR1)
			assert_int_equal(model_get(adcs[i] + ADC_CR) & ADC_CR_ADSTART, 0);
	}
	return written;
}

static void reset_hardware(void)
{
	model_init();
	memset(&hardware, 0, sizeof(hardware));
	for (unsigned i = 0; i < 4; i++)
		model_put(adcs[i] + ADC_CR, 1u << 29); /* deep power-down */
	model.on_write = on_write;
}

static void set_up(void)
{
	reset_hardware();
	assert_int_equal(adc_setup(), 0);
	adc_start();
}

/* ---- the DMA, played: it writes where its registers say ---- */

static unsigned channel_of(enum adc_group group)
{
	return group == ADC_GROUP_YZ ? 0 : 1;
}

static void transfer(enum adc_group group, uint32_t word)
{
	unsigned channel = channel_of(group);
	unsigned total = group == ADC_GROUP_YZ ? 50 : 7;
	uint32_t left = model_get(DMA1_CNDTR(channel));
	/* CMAR has the lower half of an address of this program */
	uintptr_t room = (uintptr_t)&model +
	                 (uintptr_t)(int32_t)(model_get(DMA1_CMAR(channel)) - (uint32_t)(uintptr_t)&model);

	assert_in_range(left, 1, total);
	((uint32_t *)room)[total - left] = word;
	if (--left == 0) {
		left = total;
		model_put(DMA1_ISR, model_get(DMA1_ISR) | 2u << (4 * channel));
	}
	model_put(DMA1_CNDTR(channel), left);
}

static uint32_t pair(uint32_t s1, uint32_t s2)
{
	return s1 | s2 << 16;
}

static void scan_yz(uint32_t y, uint32_t z, uint32_t bias)
{
	transfer(ADC_GROUP_YZ, y);
	transfer(ADC_GROUP_YZ, z);
	for (unsigned i = 0; i < 3; i++)
		transfer(ADC_GROUP_YZ, bias);
}

/* ---- set-up ---- */

static void configuration(void **state)
{
	(void)state;
	set_up();
	assert_int_equal(hardware.calibrated, 4);
	for (uint32_t common = ADC12; common <= ADC345; common += 0x400)
		/* HCLK/4, one DMA request for both, circular, regular simultaneous */
		assert_int_equal(model_get(common + ADC_CCR), 3u << 16 | 2u << 14 | 1u << 13 | 6);
	for (unsigned i = 0; i < 4; i++) {
		uint32_t cfgr = model_get(adcs[i] + ADC_CFGR);

		assert_int_equal(cfgr >> 10 & 3, 1);              /* rising edge of */
		assert_int_equal(cfgr >> 5 & 31, i < 2 ? 4 : 12); /* tim3_trgo (table 166), tim4_trgo (168) */
		assert_int_equal(cfgr & 0x01017018, 0);           /* 12 bits, right aligned, overrun keeps */
		assert_int_equal(model_get(adcs[i] + ADC_CFGR2), 3u << 2 | 1); /* 16 x, no shift */
		for (unsigned channel = 0; channel < 19; channel++)
			assert_int_equal(model_get(adcs[i] + (channel < 10 ? ADC_SMPR1 : ADC_SMPR2)) >>
			                                 (3 * (channel % 10)) &
			                         7,
			                 3); /* 24.5 clocks */
	}
}

/* Data sheet, pins: which channel of which converter. */
static void sequence(void **state)
{
	static const unsigned expected[4][5] = {
	        {6, 7, 8, 9, 15},  /* PC0 S1Y, PC1 S1Z, bias S1: PC2 X, PC3 Y, PB0 Z */
	        {3, 4, 17, 5, 11}, /* PA6 S2Y, PA7 S2Z, bias S2: PA4 X, PC4 Y, PC5 Z */
	        {1, 0, 0, 0, 0},   /* PB1 S1X */
	        {3, 0, 0, 0, 0},   /* PB12 S2X */
	};

	(void)state;
	set_up();
	for (unsigned i = 0; i < 4; i++) {
		uint32_t sqr1 = model_get(adcs[i] + ADC_SQR1);

		assert_int_equal((sqr1 & 15) + 1, i < 2 ? 5 : 1);
		for (unsigned k = 0; k < 4; k++)
			assert_int_equal(sqr1 >> (6 + 6 * k) & 31, expected[i][k]);
		assert_int_equal(model_get(adcs[i] + ADC_SQR2), expected[i][4]);
	}
}

static void dma(void **state)
{
	static const uint32_t request[] = {5, 37}, source[] = {0x5000030C, 0x5000070C}, words[] = {50, 7};

	(void)state;
	set_up();
	for (unsigned channel = 0; channel < 2; channel++) {
		int enable = model_find(DMA1_CCR(channel), 1, 1, 0),
		    mux = model_find(DMAMUX_CCR(channel), 0, 0, 0);
		int count = model_find(DMA1_CNDTR(channel), 0, 0, 0);

		assert_int_equal(model_get(DMAMUX_CCR(channel)), request[channel]);
		assert_int_equal(model_get(DMA1_CPAR(channel)), source[channel]);
		assert_int_equal(model_get(DMA1_CNDTR(channel)), words[channel]);
		/* to memory that advances, 32 bits, circular, highest priority */
		assert_int_equal(model_get(DMA1_CCR(channel)),
		                 3u << 12 | 2u << 10 | 2u << 8 | 1u << 7 | 1u << 5 | 1);
		assert_true(count < mux && mux < enable); /* 13.4.3 */
		assert_true(enable < model_find((channel == 0 ? ADC1 : ADC3) + ADC_CR, 4, 4, 0));
	}
}

static void order(void **state)
{
	(void)state;
	set_up();
	for (unsigned i = 0; i < 4; i++) {
		uint32_t control = adcs[i] + ADC_CR;
		int awake = model_find(control, 0xFFFFFFFF, 0, 0),
		    regulator = model_find(control, 1u << 28, 1u << 28, 0);
		int calibration = model_find(control, 1u << 31, 1u << 31, 0),
		    enable = model_find(control, 1, 1, 0);
		int common = model_find((i < 2 ? ADC12 : ADC345) + ADC_CCR, 0, 0, 0);

		assert_true(common < awake && awake < regulator && regulator < calibration &&
		            calibration < enable);
		assert_true(enable < model_find(adcs[i] + ADC_CFGR, 0, 0, 0));
	}
}

static void silence(void **state)
{
	(void)state;
	for (unsigned dead = 1; dead <= 2; dead++) {
		reset_hardware();
		hardware.dead = dead;
		assert_int_equal(adc_setup(), DT_E_TIMEOUT);
	}
}

/* ---- codes ---- */

static void codes(void **state)
{
	/* +-512 g are 0 to 65520: sums worked out by hand, codes 1/32 g */
	static const struct {
		uint32_t sum;
		int code;
	} cases[] = {
	        {MIDDLE, 0},
	        {MIDDLE + 2, 1},
	        {MIDDLE - 2, -1},
	        {MIDDLE + 64 * 100, 3201},
	        {MIDDLE - 64 * 100, -3201},
	        {64753, 16000},
	        {767, -16000},
	        {RAILS - 1, 16384},
	        {1, -16384},
	        {RAILS, 32767},
	        {0, -32767},
	        {65535, 32767},
	};
	int16_t code[ADC_CODES];

	(void)state;
	set_up();
	for (unsigned i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		transfer(ADC_GROUP_X, pair(cases[i].sum, MIDDLE));
		assert_true(adc_read(ADC_GROUP_X, i % 7, code));
		assert_in_range(code[0] + 40000, cases[i].code + 40000 - 1, cases[i].code + 40000 + 1);
		assert_int_equal(code[1], 0);
		if (i % 7 == 6)
			adc_begin(ADC_GROUP_X);
	}
}

static void places(void **state)
{
	int16_t code[ADC_CODES];

	(void)state;
	set_up();
	for (unsigned ms = 0; ms < 3; ms++) {
		for (unsigned k = 0; k < 10; k++) /* all of it before the first is read: nothing moves */
			scan_yz(pair(MIDDLE + 20 * k, MIDDLE + 200 + 20 * k),
			        pair(MIDDLE - 20 * k, MIDDLE - 200 - 20 * k), pair(20000, 20000));
		for (unsigned k = 0; k < 10; k++) {
			int n = 10 * (int)k;

			assert_true(adc_read(ADC_GROUP_YZ, k, code));
			assert_int_equal(code[0], n); /* S1Y S1Z S2Y S2Z */
			assert_int_equal(code[1], -n);
			assert_int_equal(code[2], 100 + n);
			assert_int_equal(code[3], -100 - n);
		}
		assert_int_equal(adc_align(ADC_GROUP_YZ), 0);
		adc_begin(ADC_GROUP_YZ);
	}
	for (unsigned k = 0; k < 7; k++)
		transfer(ADC_GROUP_X, pair(MIDDLE + 20 * k, MIDDLE - 20 * k));
	for (unsigned k = 0; k < 7; k++) {
		assert_true(adc_read(ADC_GROUP_X, k, code));
		assert_int_equal(code[0], 10 * (int)k);
		assert_int_equal(code[1], -10 * (int)k);
	}
	assert_int_equal(adc_align(ADC_GROUP_X), 0);
}

static void not_ready(void **state)
{
	int16_t code[ADC_CODES] = {1, 2, 3, 4};

	(void)state;
	set_up();
	assert_false(adc_read(ADC_GROUP_X, 0, code));
	assert_int_equal(code[0], 0);
	transfer(ADC_GROUP_X, pair(MIDDLE, MIDDLE));
	assert_true(adc_read(ADC_GROUP_X, 0, code));
	assert_false(adc_read(ADC_GROUP_X, 1, code));
	for (unsigned i = 0; i < 4; i++) /* a scan of which a channel is missing */
		transfer(ADC_GROUP_YZ, pair(20000, 20000));
	assert_false(adc_read(ADC_GROUP_YZ, 0, code));
	transfer(ADC_GROUP_YZ, pair(20000, 20000));
	assert_true(adc_read(ADC_GROUP_YZ, 0, code));
}

static void realigned(void **state)
{
	int16_t code[ADC_CODES];
	int stop;

	(void)state;
	set_up();
	for (unsigned k = 0; k < 9; k++) /* a trigger was lost */
		scan_yz(pair(MIDDLE, MIDDLE), pair(MIDDLE, MIDDLE), pair(20000, 20000));
	assert_false(adc_read(ADC_GROUP_YZ, 9, code));
	model_put(ADC1 + ADC_ISR, ADC_ISR_OVR);
	model.writes = 0;
	assert_int_equal(adc_align(ADC_GROUP_YZ), 1);
	assert_int_equal(model_get(DMA1_CNDTR(0)), 50);
	assert_int_equal(model_get(ADC1 + ADC_ISR) & ADC_ISR_OVR, 0);
	assert_true(model_get(ADC1 + ADC_CR) & ADC_CR_ADSTART);
	/* the regulator stays on, neither deep power-down nor anything else comes with it */
	stop = model_find(ADC1 + ADC_CR, 0xFFFFFFFF, 1u << 28 | 1u << 4, 0);
	assert_true(stop >= 0 && stop < model_find(DMA1_CCR(0), 0xFFFFFFFF, 0, 0));
	assert_int_equal(model_count(ADC1 + ADC_CR), 2);
	assert_true(model_find(ADC1 + ADC_CR, 0xFFFFFFFF, 1u << 28 | 1u << 2, 0) >= 0);
	assert_true(model_find(DMA1_CCR(0), 0xFFFFFFFF, 0, 0) <
	            model_find(DMA1_CNDTR(0), 0, 0, 0)); /* while off */
	scan_yz(pair(MIDDLE + 2000, MIDDLE), pair(MIDDLE, MIDDLE), pair(20000, 20000));
	assert_true(adc_read(ADC_GROUP_YZ, 0, code));
	assert_int_equal(code[0], 1000);
	assert_int_equal(model_count(DMA1_CCR(1)), 0); /* the other pair was left alone */
	for (unsigned k = 0; k < 10;
	     k++) /* one scan too many: the first of the next millisecond is not yet there */
		scan_yz(pair(MIDDLE, MIDDLE), pair(MIDDLE, MIDDLE), pair(20000, 20000));
	assert_int_equal(adc_align(ADC_GROUP_YZ), 1);
	assert_false(adc_read(ADC_GROUP_YZ, 0, code));
	transfer(ADC_GROUP_X, pair(MIDDLE, MIDDLE));
	model.writes = 0;
	assert_int_equal(adc_align(ADC_GROUP_X), 1);
	assert_true(model_find(DMA1_CCR(1), 0xFFFFFFFF, 0, 0) >= 0);
	assert_int_equal(model_get(DMA1_CNDTR(1)), 7);
	assert_int_equal(model_count(DMA1_CCR(0)), 0);
	hardware.dead = 3;
	assert_int_equal(adc_align(ADC_GROUP_YZ), DT_E_TIMEOUT);
	assert_int_equal(model_get(DMA1_CCR(0)), 0);
}

/* ---- bias ---- */

static uint16_t bias_of(uint32_t word, unsigned axis)
{
	int16_t code[ADC_CODES];
	const uint32_t good = pair(20000, 20000);

	set_up();
	transfer(ADC_GROUP_YZ, pair(MIDDLE, MIDDLE));
	transfer(ADC_GROUP_YZ, pair(MIDDLE, MIDDLE));
	for (unsigned i = 0; i < 3; i++)
		transfer(ADC_GROUP_YZ, i == axis ? word : good);
	assert_true(adc_read(ADC_GROUP_YZ, 0, code));
	adc_judge_bias();
	return adc_bias();
}

static void bias(void **state)
{
	const uint16_t both = WIRE_IO_IEPE_S1 | WIRE_IO_IEPE_S2;
	const double per_volt = 65520 / 3.3 / 10; /* sum for a volt at the sensor */

	(void)state;
	for (unsigned axis = 0; axis < 3; axis++) {
		for (double volt = 6.01; volt < 16; volt += 0.5)
			assert_int_equal(
			        bias_of(pair((uint32_t)(volt * per_volt), (uint32_t)(volt * per_volt)), axis),
			        both);
		assert_int_equal(adc_bias_high(), 0);
		assert_int_equal(bias_of(pair(0, 20000), axis), WIRE_IO_IEPE_S2); /* short */
		assert_int_equal(bias_of(pair((uint32_t)(5.99 * per_volt), 20000), axis), WIRE_IO_IEPE_S2);
		assert_int_equal(adc_bias_high(), 0);
		assert_int_equal(bias_of(pair(20000, (uint32_t)(16.01 * per_volt)), axis), WIRE_IO_IEPE_S1);
		assert_int_equal(adc_bias_high(), WIRE_IO_IEPE_S2);
		assert_int_equal(bias_of(pair(65520, (uint32_t)(22 * per_volt)), axis), 0); /* open */
		assert_int_equal(adc_bias_high(), both);
		assert_int_equal(bias_of(pair(65520, 0), axis), 0);
		assert_int_equal(adc_bias_high(), WIRE_IO_IEPE_S1);
	}
	assert_int_equal(bias_of(pair(20000, 20000), 0), both);
	assert_int_equal(adc_bias_high(), 0);
	adc_judge_bias(); /* a scan that is not there says nothing of the cable: the last one counts */
	assert_int_equal(adc_bias(), both);
	set_up();
	assert_int_equal(adc_bias(), 0); /* nothing converted yet is not good */
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(configuration), cmocka_unit_test(sequence),  cmocka_unit_test(dma),
	        cmocka_unit_test(order),         cmocka_unit_test(silence),   cmocka_unit_test(codes),
	        cmocka_unit_test(places),        cmocka_unit_test(not_ready), cmocka_unit_test(realigned),
	        cmocka_unit_test(bias),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
