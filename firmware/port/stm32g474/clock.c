/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "firmware/port/stm32g474/clock.h"

#include "firmware/port/stm32g474/registers.h"

enum {
	CRYSTAL_POLLS = 20000, /* 10 ms or more; a crystal takes 2 ms */
	LOCK_POLLS = 2000,
	CAPTURE_POLLS = 1000,
	SETTLE_READS = 100, /* 1 us or more */
	WAIT_STATES = 4,    /* range 1 boost, above 136 MHz (3.3.3) */
	PLL_N = 42,
	PLL_Q = 6,
	PLL_R = 2,
};

/* 16 MHz counts in 8 periods of HSE/32 are 4096 MHz / HSE; the internal oscillator is within 2 %. */
static const struct crystal {
	uint16_t counts_min, counts_max;
	uint8_t pll_m; /* to 8 MHz */
	uint32_t can_source, can_hz;
} crystals[] = {
        {167, 174, 3, RCC_CCIPR_FDCAN_PLLQ, 56000000},
        {100, 105, 5, RCC_CCIPR_FDCAN_HSE, 40000000},
};

static int capture(uint32_t *count)
{
	int result = register_wait(TIM17 + TIM_SR, TIM_CCIF(0), TIM_CCIF(0), CAPTURE_POLLS);

	*count = RD(TIM17 + TIM_CCR(0)); /* clears the flag */
	return result;
}

static int measure_counts(uint32_t *counts)
{
	uint32_t first, second;
	int result;

	register_set(RCC_APB2ENR, RCC_APB2ENR_TIM17);
	(void)RD(RCC_APB2ENR); /* two clocks until the timer can be reached (7.2.17) */
	WR(TIM17 + TIM_OR1, TIM17_OR1_HSE32EN);
	WR(TIM17 + TIM_TISEL, TIM17_TISEL_HSE_32);
	WR(TIM17 + TIM_CCMR1, TIM_CCMR_CAPTURE | TIM_CCMR_CAPTURE_PSC_8);
	WR(TIM17 + TIM_CCER, TIM_CCER_CCE(0));
	WR(TIM17 + TIM_CR1, TIM_CR1_CEN);
	result = capture(&first);
	if (result == 0)
		result = capture(&second);
	if (result == 0)
		*counts = (second - first) & 0xFFFFu;
	WR(TIM17 + TIM_CR1, 0);
	register_change(RCC_APB2ENR, RCC_APB2ENR_TIM17, 0);
	return result;
}

static int find_crystal(const struct crystal **crystal)
{
	uint32_t counts;
	int result;

	register_set(RCC_CR, RCC_CR_HSEON);
	result = register_wait(RCC_CR, RCC_CR_HSERDY, RCC_CR_HSERDY, CRYSTAL_POLLS);
	if (result == 0)
		result = measure_counts(&counts);
	if (result != 0)
		return result;
	for (unsigned i = 0; i < sizeof(crystals) / sizeof(crystals[0]); i++)
		if (counts >= crystals[i].counts_min && counts <= crystals[i].counts_max) {
			*crystal = &crystals[i];
			return 0;
		}
	return DT_E_LINK;
}

static int start_pll(const struct crystal *crystal)
{
	int result;

	WR(RCC_PLLCFGR, RCC_PLLCFGR_SRC_HSE | RCC_PLLCFGR_M(crystal->pll_m) | RCC_PLLCFGR_N(PLL_N) |
	                        RCC_PLLCFGR_Q(PLL_Q) | RCC_PLLCFGR_R(PLL_R));
	register_set(RCC_CR, RCC_CR_PLLON);
	result = register_wait(RCC_CR, RCC_CR_PLLRDY, RCC_CR_PLLRDY, LOCK_POLLS);
	if (result == 0)
		register_set(RCC_PLLCFGR, RCC_PLLCFGR_QEN | RCC_PLLCFGR_REN);
	return result;
}

/* To above 150 MHz by way of half the frequency, the regulator in boost mode (6.1.5). */
static int switch_to_pll(void)
{
	int result;

	register_change(RCC_CFGR, RCC_CFGR_HPRE, RCC_CFGR_HPRE_2);
	register_change(PWR_CR5, PWR_CR5_R1MODE, 0);
	register_change(FLASH_ACR, FLASH_ACR_LATENCY,
	                WAIT_STATES | FLASH_ACR_PRFTEN | FLASH_ACR_ICEN | FLASH_ACR_DCEN);
	result = register_wait(FLASH_ACR, FLASH_ACR_LATENCY, WAIT_STATES, LOCK_POLLS);
	if (result != 0)
		return result;
	register_change(RCC_CFGR, RCC_CFGR_SW, RCC_CFGR_SW_PLL);
	result = register_wait(RCC_CFGR, RCC_CFGR_SWS, RCC_CFGR_SWS_PLL, LOCK_POLLS);
	if (result != 0)
		return result;
	for (unsigned i = 0; i < SETTLE_READS; i++)
		(void)RD(RCC_CFGR);
	register_change(RCC_CFGR, RCC_CFGR_HPRE, 0);
	return 0;
}

int clock_setup(uint32_t *can_hz)
{
	const struct crystal *crystal;
	int result;

	register_set(RCC_APB1ENR1, RCC_APB1ENR1_PWR);
	(void)RD(RCC_APB1ENR1);
	result = find_crystal(&crystal);
	if (result == 0)
		result = start_pll(crystal);
	if (result == 0)
		result = switch_to_pll();
	if (result != 0)
		return result;
	register_set(RCC_CR, RCC_CR_CSSON);
	register_change(RCC_CCIPR, RCC_CCIPR_FDCAN, crystal->can_source);
	*can_hz = crystal->can_hz;
	return 0;
}
