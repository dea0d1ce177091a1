/* SPDX-License-Identifier: GPL-2.0-or-later */
#include <string.h>

#include "hil/board/chip.h"

enum {
	CRYSTAL_MHZ = 40,                /* in place of X3, so that every data rate is exact */
	HSI_COUNTS = 4096 / CRYSTAL_MHZ, /* of 16 MHz in 8 periods of HSE/32 */
	CORE_MHZ = 168,
	LSI_CLOCKS = 5250, /* of 168 MHz in a clock of 32 kHz */
	ESTOP_CLEAR = 9,   /* bit of the inputs */
	LATCH_CLOSED = 5,
};

static struct {
	uint16_t inputs, outputs;
	int64_t kicked; /* negative: the watchdog does not run */
	bool unlocked;
	uint16_t capture;
} chip;

static uint32_t *at(uint32_t address)
{
	return registers_at(address);
}

/* Flags of RCC_CSR, and the mark in RAM that says that the board ran before. */
static void set_cause(enum board_reset cause)
{
	static const uint32_t flags[BOARD_RESETS] = {
	        [BOARD_POWER_ON] = 1u << 27 | 1u << 26,
	        [BOARD_COMMAND] = 1u << 28 | 1u << 26,
	        [BOARD_WATCHDOG] = 1u << 29 | 1u << 26,
	        [BOARD_BROWN_OUT] = 1u << 27 | 1u << 26,
	        [BOARD_PIN] = 1u << 26,
	};

	*at(RCC_CSR) = flags[cause];
}

void system_reset(enum board_reset cause)
{
	static const uint32_t initial[][2] = {
	        {RCC_CR, 0x500},
	        {RCC_CFGR, 5},
	        {RCC_PLLCFGR, 0x1000},
	        {RCC_AHB1ENR, 0x100},
	        {FLASH_ACR, 0x40600},
	        {FLASH_OPTR, 0x400},
	        {PWR_CR5, 0x100},
	        {GPIOA, 0xABFFFFFF},
	        {GPIOA + 0x0C, 0x64000000},
	        {GPIOA + 0x08, 0x0C000000},
	        {GPIOA + GPIO_STEP, 0xFFFFFEBF},
	        {GPIOA + GPIO_STEP + 0x0C, 0x100},
	        {GPIOA + 2 * GPIO_STEP, 0xFFFFFFFF},
	        {IWDG_RLR, 0xFFF},
	};

	for (unsigned i = 0; i < sizeof(initial) / sizeof(initial[0]); i++)
		*at(initial[i][0]) = initial[i][1];
	chip.kicked = -1;
	chip.outputs = 0;
	chip.capture = 0;
	set_cause(cause);
	system_pins(board.now);
}

void system_state(void)
{
	preempt_keep(&chip, sizeof(chip));
}

/* ---- pins ---- */

static const struct drive {
	uint32_t timer; /* 0: the port's own output register */
	uint8_t channel, port, pin, alternate;
	bool pulled_up; /* at the driver */
} drives[SENSORBUS_OUTPUTS] = {
        {TIM5, 0, 1, 2, 2, false},  /* latch open */
        {TIM2, 2, 1, 10, 1, true},  /* magnet hold */
        {TIM2, 3, 1, 11, 1, false}, /* dampers relieve */
        {0, 0, 1, 5, 0, false},     /* camera */
        {0, 0, 2, 10, 0, false},    /* warning */
};

/* Where an input's bit is read: port A, B, C. A closed contact pulls its pin high. */
static const struct sense {
	uint8_t port, pin, bit;
	bool inverted;
} senses[] = {
        {0, 0, 11, true}, {0, 1, 12, true}, {0, 15, 9, false},  {2, 6, 5, false},  {2, 7, 13, true},
        {2, 8, 7, false}, {2, 9, 8, false}, {2, 11, 10, false}, {2, 12, 6, false},
};

static uint32_t gpio(unsigned port, unsigned offset)
{
	return *at(GPIOA + GPIO_STEP * port + offset);
}

static bool drive_level(const struct drive *drive)
{
	unsigned mode = gpio(drive->port, 0) >> (2 * drive->pin) & 3;
	unsigned alternate = gpio(drive->port, drive->pin < 8 ? 0x20 : 0x24) >> (4 * (drive->pin % 8)) & 15;

	if (drive->timer == 0 && mode == 1)
		return gpio(drive->port, 0x14) >> drive->pin & 1;
	if (drive->timer != 0 && mode == 2 && alternate == drive->alternate &&
	    timer_drives(drive->timer, drive->channel))
		return timer_level(drive->timer, drive->channel);
	return drive->pulled_up;
}

void system_pins(int64_t time)
{
	for (unsigned i = 0; i < SENSORBUS_OUTPUTS; i++) {
		bool level = drive_level(&drives[i]);

		if (level == (chip.outputs >> i & 1))
			continue;
		chip.outputs ^= (uint16_t)(1u << i);
		if (timer_start_time() >= 0)
			plant_edge(i, timer_us(time));
	}
}

uint16_t system_outputs(void)
{
	return chip.outputs;
}

void system_inputs(uint16_t inputs)
{
	chip.inputs = inputs;
	timer_estop(!(inputs >> ESTOP_CLEAR & 1));
	system_pins(board.now);
}

static uint32_t input_data(unsigned port)
{
	uint32_t data = 0;

	for (unsigned i = 0; i < sizeof(senses) / sizeof(senses[0]); i++)
		if (senses[i].port == port && (chip.inputs >> senses[i].bit & 1) != senses[i].inverted)
			data |= 1u << senses[i].pin;
	for (unsigned i = 0; i < SENSORBUS_OUTPUTS; i++)
		if (drives[i].port == port && chip.outputs >> i & 1)
			data |= 1u << drives[i].pin;
	return data;
}

/* ---- clocks ---- */

static unsigned pll_mhz(void)
{
	uint32_t p = *at(RCC_PLLCFGR);

	if ((p & 3) != 3)
		return 16 / ((p >> 4 & 15) + 1) * (p >> 8 & 127);
	return CRYSTAL_MHZ * (p >> 8 & 127) / ((p >> 4 & 15) + 1);
}

uint32_t system_can_hz(void)
{
	uint32_t source = *at(RCC_CCIPR) >> 24 & 3;
	unsigned q = ((*at(RCC_PLLCFGR) >> 21 & 3) + 1) * 2;

	if (source == 1 && !(*at(RCC_PLLCFGR) >> 20 & 1))
		return 0;
	return source == 0 ? CRYSTAL_MHZ * 1000000u : source == 1 ? pll_mhz() * 1000000u / q : 0;
}

static void write_cr(uint32_t value)
{
	if (value >> 24 & 1 && !(value >> 16 & 1))
		board_fail("the PLL is started without the crystal");
	*at(RCC_CR) = (value & ~(1u << 17 | 1u << 25)) | (value >> 16 & 1) << 17 | (value >> 24 & 1) << 25;
}

static void write_cfgr(uint32_t value)
{
	unsigned r = ((*at(RCC_PLLCFGR) >> 25 & 3) + 1) * 2;
	bool whole = (value >> 4 & 15) == 0;

	if ((value & 3) == 3) {
		if (!(*at(RCC_CR) >> 25 & 1) || !(*at(RCC_PLLCFGR) >> 24 & 1))
			board_fail("the core is switched to a PLL that does not run");
		if (pll_mhz() / r != CORE_MHZ)
			board_fail("the core is switched to %u MHz, expected 168", pll_mhz() / r);
		if ((*at(FLASH_ACR) & 15) < 4 || *at(PWR_CR5) >> 8 & 1)
			board_fail("the core is switched to 168 MHz with %u wait states, %s boost",
			           *at(FLASH_ACR) & 15, *at(PWR_CR5) >> 8 & 1 ? "without" : "with");
		if (whole && (*at(RCC_CFGR) & 3) != 3)
			board_fail("the core is switched to 168 MHz without the step of half of it");
	}
	*at(RCC_CFGR) = (value & ~0xCu) | (value & 3) << 2;
}

static void write_pllcfgr(uint32_t value)
{
	uint32_t outputs = 1u << 20 | 1u << 24;

	if (*at(RCC_CR) >> 24 & 1 && (value ^ *at(RCC_PLLCFGR)) & ~outputs)
		board_fail("the PLL is set while it runs");
	*at(RCC_PLLCFGR) = value;
}

/* ---- watchdog ---- */

static void write_watchdog(uint32_t address, uint32_t value)
{
	if (address == IWDG_KR) {
		if (value == 0xAAAA || value == 0xCCCC)
			chip.kicked = value == 0xCCCC || chip.kicked >= 0 ? board.now : -1;
		chip.unlocked = value == 0x5555;
		return;
	}
	if (!chip.unlocked)
		board_fail("the watchdog is set without its key");
	*at(address) = value;
}

int64_t system_next(void)
{
	if (chip.kicked < 0)
		return BOARD_NEVER;
	return chip.kicked + ((int64_t)*at(IWDG_RLR) + 1) * (4 << *at(IWDG_PR)) * LSI_CLOCKS;
}

void system_event(void)
{
	if (system_next() > board.now)
		return;
	board.reset_wanted = true;
	board.reset_cause = BOARD_WATCHDOG;
}

/* ---- registers ---- */

/* The crystal against the internal oscillator: a capture is there whenever the timer is asked. */
static bool measure_read(uint32_t address, uint32_t *value)
{
	bool set_up = *at(TIM17 + TIM_CR1) & 1 && *at(TIM17 + TIM_CCER) & 1 &&
	              *at(TIM17 + TIM_CCMR1) == 0xD && *at(TIM17 + TIM_TISEL) == 3 &&
	              *at(TIM17 + TIM_OR1) == 1 && *at(RCC_CR) >> 17 & 1;

	if (address == TIM17 + TIM_SR)
		*value = set_up ? 2 : 0;
	if (address == TIM17 + TIM_CCR)
		*value = chip.capture = (uint16_t)(chip.capture + HSI_COUNTS);
	return true;
}

bool system_read(uint32_t address, uint32_t *value)
{
	*value = *at(address);
	if (address - TIM17 < 0x400)
		return measure_read(address, value);
	if (address >= GPIOA && address < GPIOA + 3 * GPIO_STEP && (address & 0x3FF) == 0x10)
		*value = input_data((address - GPIOA) / GPIO_STEP);
	if (address == RNG_SR)
		*value = *at(RNG_CR) >> 2 & 1 && *at(RCC_CRRCR) & 1;
	if (address == RNG_DR)
		*value = plant_random();
	return true;
}

void system_write(uint32_t address, uint32_t value)
{
	if (address >= GPIOA && address < GPIOA + 3 * GPIO_STEP) {
		uint32_t *data = at((address & ~0x3FFu) + 0x14);

		*at(address) = value;
		if ((address & 0x3FF) == 0x18)
			*data = (*data & ~(value >> 16)) | (value & 0xFFFF);
		system_pins(board.now);
		return;
	}
	switch (address) {
	case RCC_CR:
		write_cr(value);
		break;
	case RCC_CFGR:
		write_cfgr(value);
		break;
	case RCC_PLLCFGR:
		write_pllcfgr(value);
		break;
	case RCC_CSR:
		*at(RCC_CSR) = value >> 23 & 1 ? 0 : *at(RCC_CSR);
		break;
	case RCC_CRRCR:
		*at(RCC_CRRCR) = value & 1 ? 3 : 0;
		break;
	case IWDG_KR:
	case IWDG_PR:
	case IWDG_RLR:
		write_watchdog(address, value);
		break;
	default:
		*at(address) = value;
	}
}
