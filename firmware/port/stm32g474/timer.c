/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "firmware/port/stm32g474/timer.h"

#include "firmware/port/stm32g474/registers.h"

enum {
	TICK_PRESCALER = 7,
	US_PRESCALER = 168,
	BEFORE_TICK_US = TIMER_LEAD / US_PRESCALER,
	KEEPER = 1, /* channel of TIM5 */
};

/* 8 samples 32 clocks apart delay an edge by 1.5 us. */
#define CAPTURE (TIM_CCMR_CAPTURE | TIM_CCMR_FILTER_32_8)
#define ESTOP_CLEARS (TIM_SMCR_OCCS_ETRF | TIM_SMCR_ETF_32_8 | TIM_SMCR_ETP_LOW)

static void set_up_tick(void)
{
	WR(TIM1 + TIM_PSC, TICK_PRESCALER - 1);
	WR(TIM1 + TIM_ARR, TIMER_COUNTS_PER_MS - 1);
	WR(TIM1 + TIM_CCR(0), TIMER_COUNTS_PER_MS / 2);
	WR(TIM1 + TIM_CCMR1, TIM_CCMR_MODE_PWM1);
	WR(TIM1 + TIM_CCER, TIM_CCER_CCE(0));
	WR(TIM1 + TIM_BDTR, TIM_BDTR_MOE);
	WR(TIM1 + TIM_EGR, TIM_EGR_UG); /* takes the prescaler over */
	WR(TIM1 + TIM_CNT, TIMER_COUNTS_PER_MS - TIMER_LEAD / TICK_PRESCALER);
	WR(TIM1 + TIM_SR, 0);
	WR(TIM1 + TIM_DIER, TIM_UIF);
	WR(TIM1 + TIM_CR2, TIM_CR2_MMS_ENABLE);
}

static void set_up_time(void)
{
	WR(TIM2 + TIM_PSC, US_PRESCALER - 1);
	WR(TIM2 + TIM_ARR, UINT32_MAX);
	WR(TIM2 + TIM_CCMR1, CAPTURE | CAPTURE << 8);
	WR(TIM2 + TIM_CCER, TIM_CCER_FALLING(0) | TIM_CCER_CCE(0) | TIM_CCER_FALLING(1) | TIM_CCER_CCE(1));
	WR(TIM2 + TIM_EGR, TIM_EGR_UG);
	WR(TIM2 + TIM_CNT, 0u - BEFORE_TICK_US);
	WR(TIM2 + TIM_SR, 0);
	WR(TIM2 + TIM_DIER, TIM_CCIF(0) | TIM_CCIF(1));
	WR(TIM2 + TIM_SMCR, ESTOP_CLEARS | TIM_SMCR_TRIGGER_ITR0);
}

/* One clock before its first trigger. */
static void set_up_trigger(uint32_t timer, uint32_t clocks, uint32_t scanned)
{
	WR(timer + TIM_ARR, clocks - 1);
	WR(timer + TIM_CCR(0), scanned);
	WR(timer + TIM_CNT, clocks - 1);
	WR(timer + TIM_SR, 0);
	WR(timer + TIM_DIER, TIM_CCIF(0));
	WR(timer + TIM_CR2, TIM_CR2_MMS_UPDATE);
	WR(timer + TIM_SMCR, TIM_SMCR_TRIGGER_ITR0);
}

static void set_up_pulse(void)
{
	WR(TIM5 + TIM_PSC, US_PRESCALER - 1);
	WR(TIM5 + TIM_ARR, UINT32_MAX);
	WR(TIM5 + TIM_CCMR1, CAPTURE << 8 * KEEPER);
	WR(TIM5 + TIM_CCER, TIM_CCER_FALLING(KEEPER) | TIM_CCER_CCE(KEEPER));
	WR(TIM5 + TIM_AF1, TIM5_AF1_ETRSEL_TIM2_ETR);
	WR(TIM5 + TIM_SMCR, ESTOP_CLEARS);
	WR(TIM5 + TIM_EGR, TIM_EGR_UG);
	WR(TIM5 + TIM_CR1, TIM_CR1_CEN);
}

void timer_setup(void)
{
	register_set(RCC_APB1ENR1, RCC_APB1ENR1_TIM2345);
	register_set(RCC_APB2ENR, RCC_APB2ENR_TIM1);
	(void)RD(RCC_APB2ENR);
	set_up_tick();
	set_up_time();
	set_up_trigger(TIM3, TIMER_YZ_CLOCKS, TIMER_YZ_SCANNED);
	set_up_trigger(TIM4, TIMER_X_CLOCKS, TIMER_X_SCANNED);
	set_up_pulse();
}

void timer_start(void)
{
	WR(TIM1 + TIM_CR1, TIM_CR1_CEN);
}

uint32_t timer_us(void)
{
	return RD(TIM2 + TIM_CNT);
}

uint32_t timer_counts(void)
{
	return RD(TIM1 + TIM_CNT);
}

void timer_pause_us(uint32_t us)
{
	uint32_t start = RD(TIM5 + TIM_CNT);
	uint32_t polls = us * US_PRESCALER; /* a poll takes a clock or more: an end without the timer too */

	while (polls-- > 0 && RD(TIM5 + TIM_CNT) - start <= us) {
	}
}

bool timer_gate(unsigned gate, uint32_t *time_us)
{
	if ((RD(TIM2 + TIM_SR) & TIM_CCIF(gate)) == 0)
		return false;
	*time_us = RD(TIM2 + TIM_CCR(gate)); /* clears the flag */
	WR(TIM2 + TIM_SR, ~TIM_CCOF(gate));
	return true;
}

bool timer_keeper(uint32_t *time_us)
{
	uint32_t captured, held, ago;

	if ((RD(TIM5 + TIM_SR) & TIM_CCIF(KEEPER)) == 0)
		return false;
	captured = RD(TIM5 + TIM_CCR(KEEPER)); /* clears the flag */
	WR(TIM5 + TIM_SR, ~TIM_CCOF(KEEPER));
	held = register_hold();
	ago = RD(TIM5 + TIM_CNT) - captured;
	*time_us = RD(TIM2 + TIM_CNT) - ago;
	register_release(held);
	return true;
}

void timer_clear_tick(void)
{
	WR(TIM1 + TIM_SR, ~TIM_UIF);
}

void timer_clear_yz(void)
{
	WR(TIM3 + TIM_SR, ~TIM_CCIF(0));
}

void timer_clear_x(void)
{
	WR(TIM4 + TIM_SR, ~TIM_CCIF(0));
}
