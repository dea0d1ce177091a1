/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "firmware/port/stm32g474/output.h"

#include "common/wire.h"
#include "firmware/port/stm32g474/registers.h"

static const struct channel {
	uint16_t output;
	uint32_t timer;
	uint8_t number; /* from 0 */
} channels[] = {
        {WIRE_IO_LATCH_OPEN, TIM5, 0},
        {WIRE_IO_MAGNET_HOLD, TIM2, 2},
        {WIRE_IO_DAMPERS_RELIEVE, TIM2, 3},
};

#define CHANNELS (sizeof(channels) / sizeof(channels[0]))

static void set_mode(const struct channel *channel, uint32_t mode)
{
	unsigned shift = 8u * (channel->number % 2u);

	register_change(channel->timer + (channel->number < 2 ? TIM_CCMR1 : TIM_CCMR2),
	                TIM_CCMR_MODE << shift, mode << shift);
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

static void set_on(const struct channel *channel)
{
	set_mode(channel, TIM_CCMR_MODE_ON);
	if (channel->output == WIRE_IO_LATCH_OPEN)
		off_at(channel, RD(channel->timer + TIM_CNT) + OUTPUT_LATCH_US);
}

void output_setup(void)
{
	for (unsigned i = 0; i < CHANNELS; i++) {
		const struct channel *channel = &channels[i];

		set_mode(channel,
		         channel->output == WIRE_IO_MAGNET_HOLD ? TIM_CCMR_MODE_ON : TIM_CCMR_MODE_OFF);
		register_set(channel->timer + TIM_CCER, TIM_CCER_CCE(channel->number));
	}
}

void output_set(uint16_t on, uint16_t off)
{
	uint32_t held = register_hold();

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

	for (unsigned i = 0; i < CHANNELS; i++)
		if ((output & channels[i].output) && channels[i].timer == TIM2)
			result = off_at(&channels[i], time_us);
	register_release(held);
	return result;
}

void output_off_cancel(uint16_t output)
{
	uint32_t held = register_hold();

	for (unsigned i = 0; i < CHANNELS; i++)
		if ((output & channels[i].output) && channels[i].timer == TIM2)
			set_mode(&channels[i], TIM_CCMR_MODE_FROZEN);
	register_release(held);
}
