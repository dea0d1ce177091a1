/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Memory that main and control both touch, one of them writing, where main has no lock: all accesses of a
 * whole run.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hil/board/chip.h"

/* Open: where an interrupt of control could come. */
enum { CONTROL_WROTE = 1, CONTROL_READ = 2, MAIN_WROTE_OPEN = 4, MAIN_READ_OPEN = 8 };

static uint8_t touched[BOARD_SRAM_BYTES]; /* who did: the bits above */
static uint32_t by[BOARD_SRAM_BYTES];     /* main's instruction */

/* The samples touch nothing of main's. */
static bool is_control(unsigned exception)
{
	return exception == BOARD_PENDSV || exception == BOARD_FDCAN || exception == BOARD_TIM2;
}

void sharing_access(unsigned depth, uint32_t address, unsigned bytes, bool write)
{
	uint8_t bit = 0;

	if (address - BOARD_SRAM >= BOARD_SRAM_BYTES - bytes)
		return;
	if (depth == 0 && !exception_masks_control())
		bit = write ? MAIN_WROTE_OPEN : MAIN_READ_OPEN;
	else if (depth > 0 && is_control(exception_that_runs()))
		bit = write ? CONTROL_WROTE : CONTROL_READ;
	for (unsigned i = 0; i < bytes; i++) {
		touched[address - BOARD_SRAM + i] |= bit;
		if (depth == 0 && bit != 0)
			by[address - BOARD_SRAM + i] = core_pc();
	}
}

/* Lines of the file: address, bytes, name of what needs no lock. */
static void forget(const char *path)
{
	FILE *file = fopen(path, "r");
	unsigned address, bytes;

	if (file == NULL)
		board_fail("%s cannot be read", path);
	while (fscanf(file, "%x %u %*[^\n]", &address, &bytes) == 2)
		if (address - BOARD_SRAM < BOARD_SRAM_BYTES &&
		    bytes <= BOARD_SRAM_BYTES - (address - BOARD_SRAM))
			memset(touched + (address - BOARD_SRAM), 0, bytes);
	fclose(file);
}

static bool is_shared(uint8_t bits)
{
	return (bits & CONTROL_WROTE && bits & (MAIN_READ_OPEN | MAIN_WROTE_OPEN)) ||
	       (bits & MAIN_WROTE_OPEN && bits & CONTROL_READ);
}

void sharing_judge(const char *path)
{
	bool wrong = false;

	forget(path);
	for (uint32_t i = 0; i < BOARD_SRAM_BYTES; i++) {
		uint32_t begin = i;

		while (i < BOARD_SRAM_BYTES && is_shared(touched[i]))
			i++;
		if (i == begin)
			continue;
		wrong = true;
		printf("0x%08X, %u bytes: control %s, main %s without a lock, at 0x%08X\n",
		       BOARD_SRAM + begin, i - begin, touched[begin] & CONTROL_WROTE ? "writes" : "reads",
		       touched[begin] & MAIN_WROTE_OPEN ? "writes" : "reads", by[begin]);
	}
	if (wrong)
		exit(1);
}
