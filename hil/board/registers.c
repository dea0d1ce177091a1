/* SPDX-License-Identifier: GPL-2.0-or-later */
#include <stddef.h>
#include <string.h>

#include "hil/board/chip.h"

/* ---- where they are kept ---- */

static struct part {
	uint32_t base, bytes;
	uint32_t *words;
} parts[] = {
        {0x40000000, 0x31000, (uint32_t[0x31000 / 4]){0}}, {0x48000000, 0x2000, (uint32_t[0x2000 / 4]){0}},
        {0x50000000, 0x1000, (uint32_t[0x1000 / 4]){0}},   {0x50060000, 0x1000, (uint32_t[0x1000 / 4]){0}},
        {0xE000E000u, 0x1000, (uint32_t[0x1000 / 4]){0}},
};

#define PARTS (sizeof(parts) / sizeof(parts[0]))

uint32_t *registers_at(uint32_t address)
{
	for (unsigned i = 0; i < PARTS; i++)
		if (address - parts[i].base < parts[i].bytes)
			return &parts[i].words[(address - parts[i].base) / 4];
	board_fail("no register at 0x%08X", address);
}

void registers_state(void)
{
	for (unsigned i = 0; i < PARTS; i++)
		preempt_keep(parts[i].words, parts[i].bytes);
}

void registers_reset(void)
{
	for (unsigned i = 0; i < PARTS; i++)
		memset(parts[i].words, 0, parts[i].bytes);
}

/* ---- whose clock must be on ---- */

static const struct clocked {
	uint32_t base, bytes, enable, bit;
} clocked[] = {
        {TIM2, 0x400, RCC_APB1ENR1, 0},
        {TIM3, 0x400, RCC_APB1ENR1, 1},
        {TIM4, 0x400, RCC_APB1ENR1, 2},
        {TIM5, 0x400, RCC_APB1ENR1, 3},
        {FDCAN, 0x400, RCC_APB1ENR1, 25},
        {CAN_RAM, CAN_RAM_BYTES, RCC_APB1ENR1, 25},
        {0x40007000, 0x400, RCC_APB1ENR1, 28},
        {TIM1, 0x400, RCC_APB2ENR, 11},
        {TIM17, 0x400, RCC_APB2ENR, 18},
        {DMA1, 0x400, RCC_AHB1ENR, 0},
        {DMAMUX, 0x400, RCC_AHB1ENR, 2},
        {GPIOA, 0x400, RCC_AHB2ENR, 0},
        {GPIOA + GPIO_STEP, 0x400, RCC_AHB2ENR, 1},
        {GPIOA + 2 * GPIO_STEP, 0x400, RCC_AHB2ENR, 2},
        {ADC12, 0x400, RCC_AHB2ENR, 13},
        {ADC345, 0x400, RCC_AHB2ENR, 14},
};

bool registers_clocked(uint32_t address)
{
	for (unsigned i = 0; i < sizeof(clocked) / sizeof(clocked[0]); i++)
		if (address - clocked[i].base < clocked[i].bytes)
			return *registers_at(clocked[i].enable) >> clocked[i].bit & 1;
	/* the random numbers may be asked whether they are on: a peripheral without its clock reads 0 */
	return true;
}

/* ---- what may be written ---- */

/* `count` registers `step` apart: the bits that exist, and values of one field that are sensible here. */
static const struct legal {
	uint32_t address, bits;
	uint16_t count, step;
	uint32_t field;
	uint16_t values, value[4]; /* of the field, from its lowest bit; 0: any */
} legal[] = {
        /* timers */
        {TIM1 + TIM_CR1, 0x1, 1, 0, 0x1, 1, {1}},
        {TIM1 + TIM_CR2, 0x70, 1, 0, 0x70, 1, {1}},
        {TIM1 + TIM_DIER, 0x1, 1, 0, 0, 0, {0}},
        {TIM1 + TIM_SR, 0xFFFFFFFF, 1, 0, 0, 0, {0}},
        {TIM1 + TIM_EGR, 0x1, 1, 0, 0x1, 1, {1}},
        {TIM1 + TIM_CCMR1, 0x70, 1, 0, 0x70, 1, {6}},
        {TIM1 + TIM_CCER, 0x1, 1, 0, 0, 0, {0}},
        {TIM1 + TIM_CNT, 0xFFFF, 5, 4, 0, 0, {0}}, /* CNT, PSC, ARR, RCR, CCR1 */
        {TIM1 + TIM_BDTR, 0x8000, 1, 0, 0x8000, 1, {1}},
        {TIM2 + TIM_SMCR, 0x0030FFFF, 1, 0, 0x77, 1, {6}},
        {TIM2 + TIM_DIER, 0x6, 1, 0, 0, 0, {0}},
        {TIM2 + TIM_SR, 0xFFFFFFFF, 1, 0, 0, 0, {0}},
        {TIM2 + TIM_EGR, 0x1, 1, 0, 0x1, 1, {1}},
        {TIM2 + TIM_CCMR1, 0xFFFF, 1, 0, 0x0303, 1, {0x101}},
        {TIM2 + TIM_CCMR2, 0x0101F0F0, 1, 0, 0x0070, 4, {0, 2, 4, 5}},
        {TIM2 + TIM_CCER, 0x3333, 1, 0, 0, 0, {0}},
        {TIM2 + TIM_CNT, 0xFFFFFFFF, 3, 4, 0, 0, {0}},
        {TIM2 + TIM_CCR + 8, 0xFFFFFFFF, 2, 4, 0, 0, {0}},
        {TIM3 + TIM_SMCR, 0x00000007, 1, 0, 0x7, 1, {6}},
        {TIM3 + TIM_CR2, 0x70, 1, 0, 0x70, 1, {2}},
        {TIM3 + TIM_DIER, 0x2, 1, 0, 0, 0, {0}},
        {TIM3 + TIM_SR, 0xFFFFFFFF, 1, 0, 0, 0, {0}},
        {TIM3 + TIM_CNT, 0xFFFF, 3, 4, 0, 0, {0}},
        {TIM3 + TIM_CCR, 0xFFFF, 1, 0, 0, 0, {0}},
        {TIM4 + TIM_SMCR, 0x00000007, 1, 0, 0x7, 1, {6}},
        {TIM4 + TIM_CR2, 0x70, 1, 0, 0x70, 1, {2}},
        {TIM4 + TIM_DIER, 0x2, 1, 0, 0, 0, {0}},
        {TIM4 + TIM_SR, 0xFFFFFFFF, 1, 0, 0, 0, {0}},
        {TIM4 + TIM_CNT, 0xFFFF, 3, 4, 0, 0, {0}},
        {TIM4 + TIM_CCR, 0xFFFF, 1, 0, 0, 0, {0}},
        {TIM5 + TIM_CR1, 0x1, 1, 0, 0x1, 1, {1}},
        {TIM5 + TIM_SMCR, 0x0000FF08, 1, 0, 0, 0, {0}},
        {TIM5 + TIM_SR, 0xFFFFFFFF, 1, 0, 0, 0, {0}},
        {TIM5 + TIM_EGR, 0x1, 1, 0, 0x1, 1, {1}},
        {TIM5 + TIM_CCMR1, 0x0001FFF0, 1, 0, 0x70, 4, {0, 2, 4, 5}},
        {TIM5 + TIM_CCER, 0x33, 1, 0, 0, 0, {0}},
        {TIM5 + TIM_CNT, 0xFFFFFFFF, 3, 4, 0, 0, {0}},
        {TIM5 + TIM_CCR, 0xFFFFFFFF, 1, 0, 0, 0, {0}},
        {TIM5 + TIM_AF1, 0x3C000, 1, 0, 0x3C000, 1, {8}},
        {TIM17 + TIM_CR1, 0x1, 1, 0, 0, 0, {0}},
        {TIM17 + TIM_CCMR1, 0xFF, 1, 0, 0xFF, 1, {0xD}},
        {TIM17 + TIM_CCER, 0x1, 1, 0, 0, 0, {0}},
        {TIM17 + TIM_TISEL, 0xF, 1, 0, 0xF, 1, {3}},
        {TIM17 + TIM_OR1, 0x1, 1, 0, 0, 0, {0}},
        /* watchdog, power, flash, clocks */
        {IWDG_KR, 0xFFFF, 1, 0, 0, 0, {0}},
        {IWDG_PR, 0x7, 1, 0, 0x7, 1, {2}},
        {IWDG_RLR, 0xFFF, 1, 0, 0xFFF, 1, {127}},
        {PWR_CR2, 0xF, 1, 0, 0xF, 1, {13}},
        {PWR_CR5, 0x100, 1, 0, 0, 0, {0}},
        {FLASH_ACR, 0x4070F, 1, 0, 0xF, 1, {4}},
        {RCC_CR, 0x010B0500 | 1u << 25 | 1u << 17, 1, 0, 0x100, 1, {1}},
        {RCC_CFGR, 0xFF, 1, 0, 0xF0, 2, {0, 8}},
        {RCC_PLLCFGR, 0x07F07FFB | 1u << 12, 1, 0, 0x3, 1, {3}},
        {RCC_AHB1ENR, 0x105, 1, 0, 0, 0, {0}},
        {RCC_AHB2ENR, 0x04006007, 1, 0, 0, 0, {0}},
        {RCC_APB1ENR1, 0x1200000F, 1, 0, 0, 0, {0}},
        {RCC_APB2ENR, 0x00040800, 1, 0, 0, 0, {0}},
        {RCC_CCIPR, 0x0F000000, 1, 0, 0x0C000000, 1, {0}},
        {RCC_CSR, 0xFF800000, 1, 0, 0, 0, {0}},
        {RCC_CRRCR, 0x3, 1, 0, 0, 0, {0}},
        {RNG_CR, 0x4, 1, 0, 0, 0, {0}},
        {RNG_SR, 0x0, 1, 0, 0, 0, {0}},
        /* pins: mode, speed, pull, set and reset, alternates; the debugger's pins stay */
        {GPIOA, 0xFFFFFFFF, 1, 0, 0x3C000000, 1, {10}},
        {GPIOA + 0x08, 0xFFFFFFFF, 2, 4, 0, 0, {0}},
        {GPIOA + 0x20, 0xFFFFFFFF, 2, 4, 0, 0, {0}},
        {GPIOA + GPIO_STEP, 0xFFFFFFFF, 1, 0, 0, 0, {0}},
        {GPIOA + GPIO_STEP + 0x08, 0xFFFFFFFF, 2, 4, 0, 0, {0}},
        {GPIOA + GPIO_STEP + 0x18, 0x00200020, 1, 0, 0, 0, {0}},
        {GPIOA + GPIO_STEP + 0x20, 0xFFFFFFFF, 2, 4, 0, 0, {0}},
        {GPIOA + 2 * GPIO_STEP, 0xFFFFFFFF, 1, 0, 0, 0, {0}},
        {GPIOA + 2 * GPIO_STEP + 0x08, 0xFFFFFFFF, 2, 4, 0, 0, {0}},
        {GPIOA + 2 * GPIO_STEP + 0x18, 0x04000400, 1, 0, 0, 0, {0}},
        {GPIOA + 2 * GPIO_STEP + 0x20, 0xFFFFFFFF, 2, 4, 0, 0, {0}},
        /* converters and their memory access */
        {ADC12 + 0x00, 0x7FF, 2, 0x100, 0, 0, {0}},
        {ADC12 + 0x08, 0xB000003F, 2, 0x100, 0, 0, {0}},
        {ADC12 + 0x0C, 0x800007E0, 2, 0x100, 0xC00, 1, {1}},
        {ADC12 + 0x10, 0x1FD, 2, 0x100, 0, 0, {0}},
        {ADC12 + 0x14, 0x3FFFFFFF, 2, 0x100, 0, 0, {0}},
        {ADC12 + 0x18, 0x07FFFFFF, 2, 0x100, 0, 0, {0}},
        {ADC12 + 0x30, 0x1F7DF7CF, 2, 0x100, 0, 0, {0}},
        {ADC12 + 0x34, 0x1F7DF7DF, 2, 0x100, 0, 0, {0}},
        {ADC12 + 0x308, 0x01FFEF1F, 1, 0, 0x1F, 1, {6}},
        {ADC345 + 0x00, 0x7FF, 2, 0x100, 0, 0, {0}},
        {ADC345 + 0x08, 0xB000003F, 2, 0x100, 0, 0, {0}},
        {ADC345 + 0x0C, 0x800007E0, 2, 0x100, 0xC00, 1, {1}},
        {ADC345 + 0x10, 0x1FD, 2, 0x100, 0, 0, {0}},
        {ADC345 + 0x14, 0x3FFFFFFF, 2, 0x100, 0, 0, {0}},
        {ADC345 + 0x18, 0x07FFFFFF, 2, 0x100, 0, 0, {0}},
        {ADC345 + 0x30, 0x1F7DF7CF, 2, 0x100, 0, 0, {0}},
        {ADC345 + 0x34, 0x1F7DF7DF, 2, 0x100, 0, 0, {0}},
        {ADC345 + 0x308, 0x01FFEF1F, 1, 0, 0x1F, 1, {6}},
        {DMA1 + 0x04, 0xFFFFFFFF, 1, 0, 0, 0, {0}},
        {DMA1 + 0x08, 0x3AA1, 2, 0x14, 0, 0, {0}},
        {DMA1 + 0x0C, 0xFFFF, 2, 0x14, 0, 0, {0}},
        {DMA1 + 0x10, 0xFFFFFFFC, 2, 0x14, 0, 0, {0}},
        {DMA1 + 0x14, 0xFFFFFFFC, 2, 0x14, 0, 0, {0}},
        {DMAMUX, 0x7F, 2, 4, 0x7F, 2, {5, 37}},
        /* CAN */
        {FDCAN + 0x0C, 0x009F1FFF, 1, 0, 0, 0, {0}},
        {FDCAN + 0x18, 0x307, 1, 0, 0, 0, {0}},
        {FDCAN + 0x1C, 0xFFFFFF7F, 1, 0, 0, 0, {0}},
        {FDCAN + 0x48, 0x7F7F, 1, 0, 0, 0, {0}},
        {FDCAN + 0x50, 0x00FFFFFF, 1, 0, 0, 0, {0}},
        {FDCAN + 0x54, 0x00FFFFFF, 1, 0, 0, 0, {0}},
        {FDCAN + 0x58, 0x7F, 1, 0, 0x7F, 1, {0}},
        {FDCAN + 0x5C, 0x3, 1, 0, 0x3, 1, {1}},
        {FDCAN + 0x80, 0x0F1F033F, 1, 0, 0x3F, 1, {0x2B}},
        {FDCAN + 0x94, 0x7, 1, 0, 0, 0, {0}},
        {FDCAN + 0xC0, 0x01000000, 1, 0, 0, 0, {0}},
        {FDCAN + 0xCC, 0x7, 1, 0, 0, 0, {0}},
        {FDCAN + 0x100, 0xF, 1, 0, 0, 0, {0}},
        {CAN_RAM, 0xFFFFFFFF, CAN_RAM_BYTES / 4, 4, 0, 0, {0}},
        /* the core's own */
        {NVIC_ISER, 0xFFFFFFFF, 1, 0, 0, 0, {0}},
        {NVIC_IPR, 0xF0F0F0F0, 8, 4, 0, 0, {0}},
        {SCB_ICSR, 1u << 28, 1, 0, 0, 0, {0}},
        {SCB_VTOR, 0xFFFFFE00, 1, 0, 0, 0, {0}},
        {SCB_AIRCR, 0xFFFF0004, 1, 0, 0, 0, {0}},
        {SCB_SHPR3, 0xF0F00000, 1, 0, 0, 0, {0}},
        {SCB_SHCSR, 0x00070000, 1, 0, 0, 0, {0}},
        {MPU_CTRL, 0x7, 1, 0, 0x7, 1, {1}},
        {MPU_RBAR, 0xFFFFFFFF, 1, 0, 0, 0, {0}},
        {MPU_RASR, 0x173FFF3F, 1, 0, 0, 0, {0}},
};

static const struct legal *find_legal(uint32_t address)
{
	for (unsigned i = 0; i < sizeof(legal) / sizeof(legal[0]); i++) {
		uint32_t ahead = address - legal[i].address, step = legal[i].step ? legal[i].step : 4;

		if (ahead % step == 0 && ahead / step < legal[i].count)
			return &legal[i];
	}
	return NULL;
}

static bool is_known(const struct legal *row, uint32_t value)
{
	uint32_t lowest = row->field & (~row->field + 1);

	for (unsigned i = 0; i < row->values; i++)
		if ((value & row->field) / lowest == row->value[i])
			return true;
	return row->values == 0;
}

void registers_check_write(uint32_t address, uint32_t value)
{
	const struct legal *row = find_legal(address);

	if (row == NULL)
		board_fail("0x%08X is written to 0x%08X, which is not in the table of registers", value,
		           address);
	if (!registers_clocked(address))
		board_fail("0x%08X is written to 0x%08X, whose clock is off", value, address);
	if (value & ~row->bits)
		board_fail("0x%08X is written to 0x%08X, which has the bits 0x%08X", value, address,
		           row->bits);
	if (!is_known(row, value))
		board_fail("0x%08X is written to 0x%08X: not a value for the field 0x%08X", value, address,
		           row->field);
}

/* ---- to whom they belong ---- */

uint32_t registers_read(uint32_t address)
{
	uint32_t value;

	if (!registers_clocked(address))
		board_fail("0x%08X is read, whose clock is off", address);
	if (timer_read(address, &value) || can_read(address, &value) || sampling_read(address, &value))
		return value;
	(void)system_read(address, &value);
	return value;
}

void registers_write(uint32_t address, uint32_t value)
{
	registers_check_write(address, value);
	board.wrote |= address != IWDG_KR;
	if (address - TIM2 < 0x1000 || address - TIM1 < 0x400)
		timer_write(address, value);
	else if (address - FDCAN < 0x400 || address - CAN_RAM < CAN_RAM_BYTES)
		can_write(address, value);
	else if (address - DMA1 < 0x1000 || (address >= ADC12 && address - ADC12 < 0x1000))
		sampling_write(address, value);
	else
		system_write(address, value);
}
