/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The board's timers, outputs and pins against a register model. Its compare channels are played as
 * RM0440 30.5.8 defines their modes, so that a planned edge can be seen on the pin at its microsecond.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <stdbool.h>
#include <string.h>

#include "common/wire.h"
#include "firmware/port/stm32g474/output.h"
#include "firmware/port/stm32g474/pin.h"
#include "firmware/port/stm32g474/registers.h"
#include "firmware/port/stm32g474/timer.h"
#include "tests/unit/stm32g474_model.h"

enum { GPIO_A = 0x48000000, GPIO_B = 0x48000400, GPIO_C = 0x48000800 };

/* ---- the compare channels, played ---- */

enum { LATCH, MAGNET, DAMPERS, CHANNELS };

static const struct {
	uint32_t timer, mode, ccr, pin; /* registers of the channel, and its pin of port B */
	unsigned shift;
} channels[CHANNELS] = {
        [LATCH] = {TIM5, TIM5 + 0x18, TIM5 + 0x34, 2, 0},
        [MAGNET] = {TIM2, TIM2 + 0x1C, TIM2 + 0x3C, 10, 0},
        [DAMPERS] = {TIM2, TIM2 + 0x1C, TIM2 + 0x40, 11, 8},
};

static struct {
	bool level[CHANNELS];
	uint32_t counter_step; /* clocks of 1 us that each read of a counter takes */
} hardware;

static unsigned mode_of(unsigned i)
{
	uint32_t field = model_get(channels[i].mode) >> channels[i].shift;

	return (field >> 4 & 7) | (field >> 13 & 8);
}

/* 30.4.15: a reference that may be cleared is, by a high tim_etrf, but not while its level is forced. TIM5
 * has no pin of its own for it: its source 8 is TIM2's. */
static bool cleared(unsigned i)
{
	uint32_t smcr = model_get(channels[i].timer + TIM_SMCR);
	bool pin = model_get(GPIO_A + GPIO_IDR) >> 15 & 1, inverted = smcr >> 15 & 1;

	if (channels[i].timer == TIM5 && (model_get(TIM5 + 0x60) >> 14 & 15) != 8)
		return false;
	return (smcr >> 3 & 1) && (smcr >> 12 & 3) == 0 && pin != inverted &&
	       (model_get(channels[i].mode) >> channels[i].shift >> 7 & 1) && (mode_of(i) & ~1u) != 4;
}

static void match(unsigned i)
{
	if (mode_of(i) == 2 && model_get(channels[i].timer + TIM_CNT) == model_get(channels[i].ccr))
		hardware.level[i] = false;
	if (cleared(i))
		hardware.level[i] = false;
}

static void advance(uint32_t us)
{
	while (us-- > 0) {
		model_put(TIM2 + TIM_CNT, model_get(TIM2 + TIM_CNT) + 1);
		model_put(TIM5 + TIM_CNT, model_get(TIM5 + TIM_CNT) + 1);
		for (unsigned i = 0; i < CHANNELS; i++)
			match(i);
	}
}

static uint32_t on_write(uint32_t address, uint32_t written, uint32_t kept)
{
	if (address == TIM1 + TIM_SR || address == TIM2 + TIM_SR || address == TIM3 + TIM_SR ||
	    address == TIM4 + TIM_SR || address == TIM5 + TIM_SR)
		return kept & written; /* cleared by 0 */
	model_put(address, written);
	for (unsigned i = 0; i < CHANNELS; i++)
		if (mode_of(i) == 4 || mode_of(i) == 5)
			hardware.level[i] = mode_of(i) == 5;
		else if (cleared(i))
			hardware.level[i] = false;
	for (uint32_t port = GPIO_B; port <= GPIO_C; port += 0x400)
		if (address == port + GPIO_BSRR)
			model_put(port + GPIO_IDR,
			          (model_get(port + GPIO_IDR) | (written & 0xFFFF)) & ~(written >> 16));
	return written;
}

static uint32_t on_read(uint32_t address, uint32_t kept)
{
	if (address == TIM2 + TIM_CNT || address == TIM5 + TIM_CNT) {
		advance(hardware.counter_step);
		return kept;
	}
	if (address == TIM2 + TIM_CCR(0) ||
	    address == TIM2 + TIM_CCR(1)) /* reading a capture clears its flag */
		model_put(TIM2 + TIM_SR,
		          model_get(TIM2 + TIM_SR) & ~(address == TIM2 + TIM_CCR(0) ? 2u : 4u));
	if (address == TIM5 + TIM_CCR(1))
		model_put(TIM5 + TIM_SR, model_get(TIM5 + TIM_SR) & ~4u);
	if (address == GPIO_B + GPIO_IDR)
		for (unsigned i = 0; i < CHANNELS; i++)
			kept = (kept & ~(1u << channels[i].pin)) | (uint32_t)hardware.level[i]
			                                                   << channels[i].pin;
	return kept;
}

static void reset_hardware(void)
{
	model_init();
	memset(&hardware, 0, sizeof(hardware));
	model_put(GPIO_A + GPIO_MODER, 0xABFFFFFF); /* 9.4.1 */
	model_put(GPIO_B + GPIO_MODER, 0xFFFFFEBF);
	model_put(GPIO_C + GPIO_MODER, 0xFFFFFFFF);
	model_put(GPIO_A + GPIO_IDR, 0x8003);  /* emergency stop clear, both beams there */
	model_put(GPIO_C + GPIO_IDR, 1u << 7); /* the frame is up */
	model.on_read = on_read;
	model.on_write = on_write;
}

static void set_up(void)
{
	reset_hardware();
	timer_setup();
	output_setup();
	pin_setup();
	timer_start();
}

/* ---- time ---- */

static void periods(void **state)
{
	(void)state;
	set_up();
	assert_int_equal((model_get(TIM1 + TIM_PSC) + 1) * (model_get(TIM1 + TIM_ARR) + 1), 168000);
	assert_int_equal(168000000 / (model_get(TIM2 + TIM_PSC) + 1), 1000000);
	assert_int_equal(168000000 / (model_get(TIM5 + TIM_PSC) + 1), 1000000);
	assert_int_equal(model_get(TIM2 + TIM_ARR), UINT32_MAX);
	assert_int_equal(model_get(TIM5 + TIM_ARR), UINT32_MAX);
	assert_int_equal(model_get(TIM3 + TIM_PSC), 0);
	assert_int_equal(model_get(TIM3 + TIM_ARR) + 1, 16800); /* 10 kHz exactly */
	assert_int_equal(model_get(TIM4 + TIM_PSC), 0);
	assert_int_equal(model_get(TIM4 + TIM_ARR) + 1, 24000); /* 7 kHz exactly */
}

/* Clocks from the common start until the counter first runs over. */
static uint32_t first_overflow(uint32_t timer)
{
	return (model_get(timer + TIM_ARR) + 1 - model_get(timer + TIM_CNT)) *
	       (model_get(timer + TIM_PSC) + 1);
}

static void phases(void **state)
{
	uint32_t tick, us_0;

	(void)state;
	set_up();
	tick = first_overflow(TIM1);
	assert_int_equal(first_overflow(TIM3), 1);
	assert_int_equal(first_overflow(TIM4), 1);
	assert_int_equal(tick, TIMER_LEAD);
	/* 16 conversions of 37 ADC clocks, 4 clocks each; a value is held at the end of its 24.5 of sampling.
	 */
	assert_true(tick - 1 > 4 * (7.5 * 37 + 24.5) - 20 && tick - 1 < 4 * (7.5 * 37 + 24.5) + 20);
	us_0 = (0u - model_get(TIM2 + TIM_CNT)) * 168;
	assert_true(us_0 <= tick && tick - us_0 < 168); /* the first tick is in microsecond 0 */
	/* A scan is over before its interrupt, which is over well before the next scan. */
	assert_true(model_get(TIM3 + TIM_CCR(0)) > 5 * 16 * 37 * 4 &&
	            model_get(TIM3 + TIM_CCR(0)) < 16800 - 3000);
	assert_true(model_get(TIM4 + TIM_CCR(0)) > 16 * 37 * 4 &&
	            model_get(TIM4 + TIM_CCR(0)) < 24000 - 3000);
}

static void start_together(void **state)
{
	(void)state;
	reset_hardware();
	timer_setup();
	for (uint32_t timer = TIM2; timer <= TIM4; timer += 0x400) {
		/* trigger mode, tim_itr0 = tim1_trgo; TIM2 also: clear by ETR, filtered, active low */
		assert_int_equal(model_get(timer + TIM_SMCR),
		                 timer == TIM2 ? 6 | 1 << 3 | 15 << 8 | 1 << 15 : 6);
		assert_int_equal(model_count(timer + TIM_CR1), 0);
	}
	assert_int_equal(model_get(TIM1 + TIM_CR2) >> 4 & 7, 1); /* its trigger output: that it is enabled */
	assert_int_equal(model_get(TIM3 + TIM_CR2) >> 4 & 7, 2); /* theirs: the update, for the converters */
	assert_int_equal(model_get(TIM4 + TIM_CR2) >> 4 & 7, 2);
	assert_int_equal(model_count(TIM1 + TIM_CR1), 0);
	timer_start();
	assert_int_equal(model.log[model.writes - 1].address, TIM1 + TIM_CR1);
	assert_int_equal(model.log[model.writes - 1].value, 1);
	/* The prescalers are taken over by an update, which also clears the counter: only then the phase. */
	assert_true(model_find(TIM1 + TIM_EGR, 1, 1, 0) < model_find(TIM1 + TIM_CNT, 0, 0, 0));
	assert_true(model_find(TIM2 + TIM_EGR, 1, 1, 0) < model_find(TIM2 + TIM_CNT, 0, 0, 0));
	assert_int_equal(model_count(TIM3 + TIM_EGR), 0); /* would trigger a conversion */
	assert_int_equal(model_count(TIM4 + TIM_EGR), 0);
}

static void frame_sync(void **state)
{
	(void)state;
	set_up();
	assert_int_equal(model_get(TIM1 + TIM_CCMR1) & 0x10073,
	                 0x60);                                /* output, PWM mode 1: high from the tick on */
	assert_int_equal(model_get(TIM1 + TIM_CCR(0)), 12000); /* for 0.5 ms */
	assert_int_equal(model_get(TIM1 + TIM_CCER), 1);
	assert_int_equal(model_get(TIM1 + TIM_BDTR) & 0x8000, 0x8000);
	assert_int_equal(model_get(GPIO_A + GPIO_MODER) >> 16 & 3, 2);
	assert_int_equal(model_get(GPIO_A + GPIO_AFR + 4) & 15, 6);
	assert_int_equal(model_get(TIM1 + TIM_DIER), 1);
}

static void gates(void **state)
{
	uint32_t time_us = 7;

	(void)state;
	set_up();
	for (unsigned shift = 0; shift < 16; shift += 8) {
		assert_int_equal(model_get(TIM2 + TIM_CCMR1) >> shift & 3, 1);       /* capture, own input */
		assert_int_equal(model_get(TIM2 + TIM_CCMR1) >> (shift + 2) & 3, 0); /* every edge */
		assert_int_equal(model_get(TIM2 + TIM_CCMR1) >> (shift + 4) & 15, 15); /* longest filter */
	}
	assert_int_equal(model_get(TIM2 + TIM_CCER) & 0xBB, 0x33); /* falling: normally closed */
	assert_int_equal(model_get(TIM2 + TIM_DIER), 6);
	assert_false(timer_gate(0, &time_us));
	assert_int_equal(time_us, 7);
	model_put(TIM2 + TIM_CCR(0), 123456);
	model_put(TIM2 + TIM_CCR(1), 0xFFFFFFF0);
	model_put(TIM2 + TIM_SR, 1u << 1 | 1u << 2 | 1u << 10); /* both, the lower twice */
	assert_true(timer_gate(0, &time_us));
	assert_int_equal(time_us, 123456);
	assert_false(timer_gate(0, &time_us));
	assert_true(timer_gate(1, &time_us));
	assert_int_equal(time_us, 0xFFFFFFF0);
	assert_int_equal(model_get(TIM2 + TIM_SR), 0);
}

static void keeper(void **state)
{
	uint32_t time_us = 7;

	(void)state;
	set_up();
	assert_int_equal(model_get(TIM5 + TIM_CCMR1) >> 8 & 3, 1);    /* TIM5_CH2: capture, own input */
	assert_int_equal(model_get(TIM5 + TIM_CCMR1) >> 10 & 3, 0);   /* every edge */
	assert_int_equal(model_get(TIM5 + TIM_CCMR1) >> 12 & 15, 15); /* as long as the gates' filter */
	assert_int_equal(model_get(TIM5 + TIM_CCER) & 0xBB, 0x31);    /* falling; the latch as it was */
	assert_int_equal(model_get(TIM5 + TIM_SMCR) >> 8 & 15, 15);   /* the emergency stop's, too */
	assert_false(timer_keeper(&time_us));
	assert_int_equal(time_us, 7);
	model_put(TIM5 + TIM_CNT, 500); /* both wrap at a time of their own */
	model_put(TIM2 + TIM_CNT, 0xFFFFFF00);
	model_put(TIM5 + TIM_CCR(1), 400);
	model_put(TIM5 + TIM_SR, 1u << 2 | 1u << 10);
	assert_true(timer_keeper(&time_us));
	assert_int_equal(time_us, 0xFFFFFF00 - 100);
	assert_int_equal(model_get(TIM5 + TIM_SR), 0);
	assert_false(timer_keeper(&time_us));
	model_put(TIM5 + TIM_CNT, 10);
	model_put(TIM2 + TIM_CNT, 20);
	model_put(TIM5 + TIM_CCR(1), 0xFFFFFFF0);
	model_put(TIM5 + TIM_SR, 1u << 2);
	assert_true(timer_keeper(&time_us));
	assert_int_equal(time_us, 0xFFFFFFFA); /* 26 us before 20 */
	assert_int_equal(model.held, 0);
}

static void clearing(void **state)
{
	(void)state;
	set_up();
	model_put(TIM1 + TIM_SR, 3);
	model_put(TIM3 + TIM_SR, 3);
	model_put(TIM4 + TIM_SR, 3);
	timer_clear_tick();
	timer_clear_yz();
	timer_clear_x();
	assert_int_equal(model_get(TIM1 + TIM_SR), 2); /* only its own */
	assert_int_equal(model_get(TIM3 + TIM_SR), 1);
	assert_int_equal(model_get(TIM4 + TIM_SR), 1);
}

static void pauses(void **state)
{
	uint32_t before;

	(void)state;
	set_up();
	hardware.counter_step = 1;
	before = model_get(TIM5 + TIM_CNT);
	timer_pause_us(20);
	assert_in_range(model_get(TIM5 + TIM_CNT) - before, 20, 25);
	hardware.counter_step = 0; /* a dead timer */
	timer_pause_us(20);
	assert_true(model.reads < 5000);
}

/* ---- outputs ---- */

static bool level(uint16_t output)
{
	return pin_io() & output;
}

static void reset_states(void **state)
{
	int moder;

	(void)state;
	reset_hardware();
	timer_setup();
	output_setup();
	assert_true(hardware.level[MAGNET]);
	assert_false(hardware.level[LATCH]);
	assert_false(hardware.level[DAMPERS]);
	assert_int_equal(model_get(TIM2 + TIM_CCER), 0x1133);
	assert_int_equal(model_get(TIM5 + TIM_CCER), 0x0031);
	assert_int_equal(model_count(GPIO_B + GPIO_MODER), 0); /* pins open: the resistors decide */
	pin_setup();
	moder = model_find(GPIO_B + GPIO_MODER, 3u << 20, 2u << 20, 0);
	assert_true(moder > model_find(TIM2 + TIM_CCER, 1u << 8, 1u << 8, 0));
	assert_true(moder >
	            model_find(GPIO_B + GPIO_AFR + 4, 15u << 8, 1u << 8, 0)); /* never another function */
	assert_int_equal(model_find(TIM2 + TIM_CCMR2, 0x70, 0x40, 0), -1);    /* the magnet was never off */
	assert_int_equal(pin_io() & WIRE_IO_OUTPUTS, WIRE_IO_MAGNET_HOLD);
}

static void on_and_off(void **state)
{
	(void)state;
	set_up();
	output_set(WIRE_IO_LATCH_OPEN | WIRE_IO_DAMPERS_RELIEVE, WIRE_IO_MAGNET_HOLD);
	pin_outputs(WIRE_IO_CAMERA, WIRE_IO_MAGNET_HOLD | WIRE_IO_WARNING);
	assert_int_equal(pin_io() & WIRE_IO_OUTPUTS,
	                 WIRE_IO_LATCH_OPEN | WIRE_IO_DAMPERS_RELIEVE | WIRE_IO_CAMERA);
	output_set(WIRE_IO_MAGNET_HOLD, 0); /* the others alone */
	pin_outputs(WIRE_IO_MAGNET_HOLD | WIRE_IO_WARNING, 0);
	assert_int_equal(pin_io() & WIRE_IO_OUTPUTS, WIRE_IO_OUTPUTS);
	assert_int_equal(model_get(GPIO_C + GPIO_IDR) >> 10 & 1, 1);
	output_set(0, WIRE_IO_LATCH_OPEN | WIRE_IO_DAMPERS_RELIEVE);
	pin_outputs(0, WIRE_IO_CAMERA | WIRE_IO_WARNING);
	assert_int_equal(pin_io() & WIRE_IO_OUTPUTS, WIRE_IO_MAGNET_HOLD);
	assert_int_equal(model.held, 0);
}

static void planned_edge(void **state)
{
	static const uint32_t starts[] = {1000, 0xFFFFFFF0, 0x7FFFFFF0}; /* across both kinds of wrap */

	(void)state;
	for (unsigned i = 0; i < 3; i++) {
		set_up();
		model_put(TIM2 + TIM_CNT, starts[i]);
		output_set(WIRE_IO_DAMPERS_RELIEVE, 0);
		assert_int_equal(output_off_at(WIRE_IO_MAGNET_HOLD, starts[i] + 100), 0);
		assert_int_equal(output_off_at(WIRE_IO_DAMPERS_RELIEVE, starts[i] + 150), 0);
		advance(99);
		assert_true(level(WIRE_IO_MAGNET_HOLD));
		advance(1);
		assert_false(level(WIRE_IO_MAGNET_HOLD));
		assert_true(level(WIRE_IO_DAMPERS_RELIEVE));
		advance(49);
		assert_true(level(WIRE_IO_DAMPERS_RELIEVE));
		advance(1);
		assert_false(level(WIRE_IO_DAMPERS_RELIEVE));
		output_set(WIRE_IO_MAGNET_HOLD, 0);
		advance(300); /* an edge is made once */
		assert_true(level(WIRE_IO_MAGNET_HOLD));
	}
}

static void past_edge(void **state)
{
	(void)state;
	set_up();
	model_put(TIM2 + TIM_CNT, 5000);
	assert_int_equal(output_off_at(WIRE_IO_MAGNET_HOLD, 4999), 1);
	assert_false(level(WIRE_IO_MAGNET_HOLD));
	output_set(WIRE_IO_MAGNET_HOLD, 0);
	assert_int_equal(output_off_at(WIRE_IO_MAGNET_HOLD, 5000), 0); /* now */
	assert_false(level(WIRE_IO_MAGNET_HOLD));
	for (uint32_t ahead = 1; ahead < 6; ahead++) { /* reached while it is being planned */
		output_set(WIRE_IO_MAGNET_HOLD, 0);
		hardware.counter_step = 3;
		assert_int_equal(output_off_at(WIRE_IO_MAGNET_HOLD, model_get(TIM2 + TIM_CNT) + ahead), 0);
		hardware.counter_step = 0;
		advance(6);
		assert_false(level(WIRE_IO_MAGNET_HOLD));
	}
}

static void cancelled_edge(void **state)
{
	(void)state;
	set_up();
	assert_int_equal(output_off_at(WIRE_IO_MAGNET_HOLD, model_get(TIM2 + TIM_CNT) + 50), 0);
	advance(49);
	output_off_cancel(WIRE_IO_MAGNET_HOLD);
	advance(200);
	assert_true(level(WIRE_IO_MAGNET_HOLD));
	assert_int_equal(output_off_at(WIRE_IO_MAGNET_HOLD, model_get(TIM2 + TIM_CNT) + 50),
	                 0); /* and anew */
	advance(50);
	assert_false(level(WIRE_IO_MAGNET_HOLD));
	output_off_cancel(WIRE_IO_MAGNET_HOLD); /* too late: nothing */
	advance(1);
	assert_false(level(WIRE_IO_MAGNET_HOLD));
	assert_int_equal(model.held, 0);
}

static void latch_pulse(void **state)
{
	(void)state;
	set_up();
	output_set(WIRE_IO_LATCH_OPEN, 0);
	output_set(WIRE_IO_DAMPERS_RELIEVE, 0);
	advance(OUTPUT_PULSE_US - 1);
	assert_true(level(WIRE_IO_LATCH_OPEN) && level(WIRE_IO_DAMPERS_RELIEVE));
	advance(1);
	assert_false(level(WIRE_IO_LATCH_OPEN) || level(WIRE_IO_DAMPERS_RELIEVE));
	assert_true(level(WIRE_IO_MAGNET_HOLD));
	output_set(WIRE_IO_LATCH_OPEN, 0);
	advance(10);
	output_set(0, WIRE_IO_LATCH_OPEN);
	assert_false(level(WIRE_IO_LATCH_OPEN));
	/* Longer than the core waits for the upper gate: twice the fall to the lowest one allowed, 2.4 m. */
	assert_true(OUTPUT_PULSE_US > 2 * 700000);
	assert_int_equal(output_off_at(WIRE_IO_LATCH_OPEN, 5), 0); /* no such edge */
}

static void press(bool pressed)
{
	model_put(GPIO_A + GPIO_IDR, pressed ? 0x0003 : 0x8003);
	advance(1);
}

/* Without the processor: nothing is called between pressing and looking. */
static void emergency_stop(void **state)
{
	(void)state;
	set_up();
	output_set(WIRE_IO_LATCH_OPEN | WIRE_IO_DAMPERS_RELIEVE, 0);
	assert_int_equal(output_off_at(WIRE_IO_DAMPERS_RELIEVE, model_get(TIM2 + TIM_CNT) + 400000), 0);
	assert_int_equal(output_off_at(WIRE_IO_MAGNET_HOLD, model_get(TIM2 + TIM_CNT) + 390000), 0);
	advance(1000);
	assert_true(level(WIRE_IO_LATCH_OPEN) && level(WIRE_IO_DAMPERS_RELIEVE));
	press(true);
	assert_false(level(WIRE_IO_LATCH_OPEN) || level(WIRE_IO_DAMPERS_RELIEVE));
	assert_true(level(WIRE_IO_MAGNET_HOLD)); /* off is the release */
	assert_int_equal(pin_io() & WIRE_IO_ESTOP_CLEAR, 0);
	press(false);
	advance(10); /* and closing it again switches nothing on */
	assert_false(level(WIRE_IO_LATCH_OPEN) || level(WIRE_IO_DAMPERS_RELIEVE));
	advance(400000);
	assert_false(level(WIRE_IO_MAGNET_HOLD)); /* planned: as it was */
	press(true);
	output_set(WIRE_IO_LATCH_OPEN | WIRE_IO_DAMPERS_RELIEVE | WIRE_IO_MAGNET_HOLD, 0);
	assert_false(level(WIRE_IO_LATCH_OPEN) || level(WIRE_IO_DAMPERS_RELIEVE));
	assert_true(level(WIRE_IO_MAGNET_HOLD));
}

/* ---- pins ---- */

static void pin_table(void **state)
{
	static const struct {
		uint32_t port, number, mode, alternate, pull;
	} expected[] = {
	        /* alternate functions: STM32G474 data sheet, table 13 */
	        {GPIO_A, 0, 2, 1, 2},  {GPIO_A, 1, 2, 1, 2},   {GPIO_A, 8, 2, 6, 0},  {GPIO_A, 11, 2, 9, 1},
	        {GPIO_A, 12, 2, 9, 0}, {GPIO_A, 15, 2, 14, 2}, {GPIO_B, 2, 2, 2, 0},  {GPIO_B, 5, 1, 0, 0},
	        {GPIO_B, 10, 2, 1, 0}, {GPIO_B, 11, 2, 1, 0},  {GPIO_C, 6, 0, 0, 2},  {GPIO_C, 7, 0, 0, 2},
	        {GPIO_C, 8, 0, 0, 2},  {GPIO_C, 9, 0, 0, 2},   {GPIO_C, 10, 1, 0, 0}, {GPIO_C, 11, 0, 0, 2},
	        {GPIO_C, 12, 2, 1, 2},
	};
	static const uint32_t ports[] = {GPIO_A, GPIO_B, GPIO_C},
	                      reset[] = {0xABFFFFFF, 0xFFFFFEBF, 0xFFFFFFFF};
	uint32_t touched[3] = {0, 0, 0};

	(void)state;
	set_up();
	for (unsigned i = 0; i < sizeof(expected) / sizeof(expected[0]); i++) {
		uint32_t port = expected[i].port, n = expected[i].number;

		assert_int_equal(model_get(port + GPIO_MODER) >> (2 * n) & 3, expected[i].mode);
		assert_int_equal(model_get(port + GPIO_PUPDR) >> (2 * n) & 3, expected[i].pull);
		assert_int_equal(model_get(port + GPIO_AFR + n / 8 * 4) >> (4 * (n % 8)) & 15,
		                 expected[i].alternate);
		touched[(port - GPIO_A) / 0x400] |= 3u << (2 * n);
	}
	for (unsigned p = 0; p < 3;
	     p++) /* the analogue pins, the debugger's and all others as reset left them */
		assert_int_equal(model_get(ports[p] + GPIO_MODER) & ~touched[p], reset[p] & ~touched[p]);
}

/* Every input alone: which pin, and which of its levels sets the bit. */
static void inputs(void **state)
{
	static const struct {
		uint32_t port, number, high;
		uint16_t bit;
	} expected[] = {
	        {GPIO_A, 0, 0, WIRE_IO_GATE_UPPER},    {GPIO_A, 1, 0, WIRE_IO_GATE_LOWER},
	        {GPIO_A, 15, 1, WIRE_IO_ESTOP_CLEAR},  {GPIO_C, 6, 1, WIRE_IO_LATCH_CLOSED},
	        {GPIO_C, 7, 0, WIRE_IO_FRAME_DOWN},    {GPIO_C, 8, 1, WIRE_IO_DAMPERS_ENGAGED},
	        {GPIO_C, 9, 1, WIRE_IO_DOOR_CLOSED},   {GPIO_C, 11, 1, WIRE_IO_SUPPLY_GOOD},
	        {GPIO_C, 12, 1, WIRE_IO_PRODUCT_HELD},
	};
	const uint16_t all = 0x3FE0; /* inputs but the IEPE bits */

	(void)state;
	set_up();
	for (unsigned i = 0; i < sizeof(expected) / sizeof(expected[0]); i++) {
		uint32_t idr = expected[i].port + GPIO_IDR, bit = 1u << expected[i].number;
		uint32_t before = model_get(idr);
		uint16_t high, low;

		model_put(idr, before | bit);
		high = pin_io();
		model_put(idr, before & ~bit);
		low = pin_io();
		model_put(idr, before);
		assert_int_equal((high ^ low) & all, expected[i].bit);
		assert_int_equal(((expected[i].high ? high : low) & expected[i].bit), expected[i].bit);
	}
	model_put(GPIO_C + GPIO_IDR, 1u << 7 | 1u << 11);
	assert_int_equal(pin_io() & WIRE_IO_SUPPLY_GOOD, WIRE_IO_SUPPLY_GOOD);
	model_put(PWR_SR2, 1u << 11); /* its own supply is failing */
	assert_int_equal(pin_io() & all, WIRE_IO_ESTOP_CLEAR);
}

/* All wires off: every one reads as what is not safe to go on with, or as what ends the relief. */
static void broken_wires(void **state)
{
	(void)state;
	set_up();
	model_put(GPIO_A + GPIO_IDR, 0);
	model_put(GPIO_C + GPIO_IDR, 0);
	assert_int_equal(pin_io() & 0x3FE0, WIRE_IO_GATE_UPPER | WIRE_IO_GATE_LOWER | WIRE_IO_FRAME_DOWN);
	for (unsigned n = 6; n <= 12; n++) /* pulled down, all but the output */
		assert_int_equal(model_get(GPIO_C + GPIO_PUPDR) >> (2 * n) & 3, n == 10 ? 0 : 2);
	assert_int_equal(model_get(GPIO_A + GPIO_PUPDR) & (3u << 30 | 15), 2u << 30 | 10);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(periods),        cmocka_unit_test(phases),
	        cmocka_unit_test(start_together), cmocka_unit_test(frame_sync),
	        cmocka_unit_test(gates),          cmocka_unit_test(keeper),
	        cmocka_unit_test(clearing),       cmocka_unit_test(pauses),
	        cmocka_unit_test(reset_states),   cmocka_unit_test(on_and_off),
	        cmocka_unit_test(planned_edge),   cmocka_unit_test(past_edge),
	        cmocka_unit_test(cancelled_edge), cmocka_unit_test(latch_pulse),
	        cmocka_unit_test(emergency_stop), cmocka_unit_test(pin_table),
	        cmocka_unit_test(inputs),         cmocka_unit_test(broken_wires),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
