/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "firmware/port/stm32g474/output.h"

#include <stdbool.h>

#include "common/wire.h"
#include "firmware/port/stm32g474/registers.h"

static const struct channel {
	uint16_t output;
	uint32_t timer;
	uint8_t number; /* from 0 */
	bool pulse;     /* which the emergency stop ends */
} channels[] = {
        {WIRE_IO_LATCH_OPEN, TIM5, 0, true},
        {WIRE_IO_MAGNET_HOLD, TIM2, 2, false},
        {WIRE_IO_DAMPERS_RELIEVE, TIM2, 3, true},
};

#define CHANNELS (sizeof(channels) / sizeof(channels[0]))

static void change_mode(const struct channel *channel, uint32_t mask, uint32_t bits)
{
	unsigned shift = 8u * (channel->number % 2u);

	register_change(channel->timer + (channel->number < 2 ? TIM_CCMR1 : TIM_CCMR2), mask << shift,
	                bits << shift);
}

static void set_mode(const struct channel *channel, uint32_t mode)
{
	change_mode(channel, TIM_CCMR_MODE, mode);
}

/* The time first, then the mode that heeds it. A time that is reached in between is made up for. */
static int off_at(const struct channel *channel, uint32_t time_us)
{
	if ((int32_t)(time_us - RD(channel->timer + TIM_CNT)) < 0) {
		set_mode(channel, TIM_CCMR_MODE_OFF);
		return 1;
	}
	WR(channel->timer + TIM_CCR(channel->number), time_us);
	set_mode(channel, TIM_CCMR_MODE_OFF_AT_MATCH);
	if ((int32_t)(time_us - RD(channel->timer + TIM_CNT)) <= 0)
		set_mode(channel, TIM_CCMR_MODE_OFF);
	return 0;
}

/* A forced level is not cleared by the emergency stop, one that waits for its end is. */
static void set_on(const struct channel *channel)
{
	set_mode(channel, TIM_CCMR_MODE_ON);
	if (channel->pulse)
		off_at(channel, RD(channel->timer + TIM_CNT) + OUTPUT_PULSE_US);
}

void output_setup(void)
{
	for (unsigned i = 0; i < CHANNELS; i++) {
		const struct channel *channel = &channels[i];

		set_mode(channel, channel->pulse ? TIM_CCMR_MODE_OFF : TIM_CCMR_MODE_ON);
		change_mode(channel, TIM_CCMR_CLEAR, channel->pulse ? TIM_CCMR_CLEAR : 0);
		register_set(channel->timer + TIM_CCER, TIM_CCER_CCE(channel->number));
	}
}

void output_set(uint16_t on, uint16_t off)
{
	uint32_t held = register_hold();

#pragma GCC unroll 4
	for (unsigned i = 0; i < CHANNELS; i++)
		if (on & channels[i].output)
			set_on(&channels[i]);
		else if (off & channels[i].output)
			set_mode(&channels[i], TIM_CCMR_MODE_OFF);
	register_release(held);
}

int output_off_at(uint16_t output, uint32_t time_us)
{
	uint32_t held = register_hold();
	int result = 0;

#pragma GCC unroll 4
	for (unsigned i = 0; i < CHANNELS; i++)
		if ((output & channels[i].output) && channels[i].timer == TIM2)
			result = off_at(&channels[i], time_us);
	register_release(held);
	return result;
}

void output_off_cancel(uint16_t output)
{
	uint32_t held = register_hold();

#pragma GCC unroll 4
	for (unsigned i = 0; i < CHANNELS; i++)
		if ((output & channels[i].output) && channels[i].timer == TIM2)
			set_mode(&channels[i], TIM_CCMR_MODE_FROZEN);
	register_release(held);
}
