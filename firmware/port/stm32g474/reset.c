/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "firmware/port/stm32g474/reset.h"

#include "firmware/port/stm32g474/registers.h"

enum {
	WATCHDOG_COUNTS = 128,
	WATCHDOG_POLLS = 20000, /* the registers follow within 5 clocks of 32 kHz */
};

#define MARK_RUNNING 0x52554E21u
#define MARK_CRASHED 0x43525348u
#define KEPT 0xC35A0000u

static void set_mark(struct reset_mark *mark, uint32_t word)
{
	mark->word = word;
	mark->inverse = ~word;
}

static bool has_mark(const struct reset_mark *mark, uint32_t word)
{
	return mark->word == word && mark->inverse == ~word;
}

enum port_reset reset_cause(struct reset_mark *mark)
{
	uint32_t flags = RD(RCC_CSR);
	bool crashed = has_mark(mark, MARK_CRASHED);
	bool survived = crashed || has_mark(mark, MARK_RUNNING);

	WR(RCC_CSR, flags | RCC_CSR_RMVF);
	set_mark(mark, MARK_RUNNING);
	if (!survived)
		mark->kept = 0;
	if (flags & RCC_CSR_IWDGRSTF)
		return PORT_RESET_WATCHDOG;
	if (flags & RCC_CSR_SFTRSTF)
		return crashed ? PORT_RESET_WATCHDOG : PORT_RESET_COMMAND;
	if (!survived)
		return PORT_RESET_POWER_ON;
	return flags & RCC_CSR_BORRSTF ? PORT_RESET_BROWN_OUT : PORT_RESET_PIN;
}

/* One store: a reset finds either this byte or the one before. */
void reset_keep(struct reset_mark *mark, uint8_t byte)
{
	mark->kept = KEPT | (uint32_t)(uint8_t)~byte << 8 | byte;
}

uint8_t reset_kept(const struct reset_mark *mark)
{
	uint32_t kept = mark->kept;
	uint8_t byte = (uint8_t)kept;

	return kept == (KEPT | (uint32_t)(uint8_t)~byte << 8 | byte) ? byte : 0;
}

void reset_by_command(void)
{
	WR(SCB_AIRCR, SCB_AIRCR_SYSRESETREQ);
}

void reset_by_crash(struct reset_mark *mark)
{
	set_mark(mark, MARK_CRASHED);
	WR(SCB_AIRCR, SCB_AIRCR_SYSRESETREQ);
}

int watchdog_start(void)
{
	int result;

	WR(IWDG_KR, IWDG_KR_START);
	WR(IWDG_KR, IWDG_KR_ACCESS);
	WR(IWDG_PR, IWDG_PR_16);
	WR(IWDG_RLR, WATCHDOG_COUNTS - 1);
	result = register_wait(IWDG_SR, IWDG_SR_BUSY, 0, WATCHDOG_POLLS);
	watchdog_kick();
	return result;
}

void watchdog_kick(void)
{
	WR(IWDG_KR, IWDG_KR_RELOAD);
}

void supply_watch(void)
{
	WR(PWR_CR2, PWR_CR2_PLS_2V9 | PWR_CR2_PVDE);
}

bool supply_good(void)
{
	return (RD(PWR_SR2) & PWR_SR2_PVDO) == 0;
}

bool brown_out_set(void)
{
	return (RD(FLASH_OPTR) & FLASH_OPTR_BOR_LEV) == FLASH_OPTR_BOR_LEV_4;
}
