/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "firmware/port/stm32g474/random.h"

#include "firmware/port/stm32g474/registers.h"

enum {
	OSCILLATOR_POLLS = 2000, /* it takes 6 us */
	READY_POLLS = 2000,      /* four numbers take 10 us, the first ones after a start 20 */
	PIPELINE_WORDS = 12,
	TRIES = 3,
};

static uint32_t last; /* never given out again */

static int random_start(void)
{
	int result;

	register_set(RCC_CRRCR, RCC_CRRCR_HSI48ON);
	result = register_wait(RCC_CRRCR, RCC_CRRCR_HSI48RDY, RCC_CRRCR_HSI48RDY, OSCILLATOR_POLLS);
	if (result != 0)
		return result;
	register_change(RCC_CCIPR, RCC_CCIPR_CLK48, 0);
	register_set(RCC_AHB2ENR, RCC_AHB2ENR_RNG);
	(void)RD(RCC_AHB2ENR);
	WR(RNG_CR, RNG_CR_RNGEN);
	return 0;
}

/* What the pipeline holds may come of the bad noise. */
static void random_restart(void)
{
	WR(RNG_SR, 0);
	WR(RNG_CR, 0);
	WR(RNG_CR, RNG_CR_RNGEN);
	for (unsigned i = 0; i < PIPELINE_WORDS; i++)
		(void)RD(RNG_DR);
}

static int read_one(uint32_t *number)
{
	int result = register_wait(RNG_SR, RNG_SR_DRDY, RNG_SR_DRDY, READY_POLLS);

	if (result != 0)
		return result;
	*number = RD(RNG_DR);
	if (RD(RNG_SR) & (RNG_SR_CECS | RNG_SR_SECS | RNG_SR_CEIS | RNG_SR_SEIS))
		return DT_E_SYSTEM;
	return *number == 0 || *number == last ? DT_E_SYSTEM : 0;
}

int random_number(uint32_t *value)
{
	uint32_t number = 0;

	if ((RD(RNG_CR) & RNG_CR_RNGEN) == 0 && random_start() != 0)
		return DT_E_SYSTEM;
	for (unsigned i = 0; i < TRIES; i++) {
		if (read_one(&number) == 0) {
			last = number;
			*value = number;
			return 0;
		}
		random_restart();
	}
	return DT_E_SYSTEM;
}
