/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/unit/stm32g474_model.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firmware/port/stm32g474/registers.h"

struct model model;

static void fail(const char *what, uint32_t address)
{
	fprintf(stderr, "register model: %s at 0x%08x\n", what, address);
	abort();
}

static uint32_t *word(uint32_t address)
{
	unsigned i;

	if (address % 4 != 0)
		fail("unaligned", address);
	for (i = 0; i < model.count; i++)
		if (model.address[i] == address)
			return &model.value[i];
	if (i == MODEL_WORDS)
		fail("no room", address);
	model.address[model.count] = address;
	return &model.value[model.count++];
}

void model_init(void)
{
	memset(&model, 0, sizeof(model));
}

uint32_t model_get(uint32_t address)
{
	return *word(address);
}

void model_put(uint32_t address, uint32_t value)
{
	*word(address) = value;
}

int model_find(uint32_t address, uint32_t mask, uint32_t bits, int from)
{
	for (int i = from; i < model.writes; i++)
		if (model.log[i].address == address && (model.log[i].value & mask) == bits)
			return i;
	return -1;
}

int model_count(uint32_t address)
{
	int count = 0;

	for (int i = 0; i < model.writes; i++)
		count += model.log[i].address == address;
	return count;
}

uint32_t RD(uint32_t address)
{
	uint32_t kept = *word(address);

	if (++model.reads > MODEL_READS_MAX)
		fail("read without an end", address);
	return model.on_read != NULL ? model.on_read(address, kept) : kept;
}

void WR(uint32_t address, uint32_t value)
{
	uint32_t kept = *word(address);

	if (model.writes == MODEL_LOG)
		fail("written without an end", address);
	model.log[model.writes].address = address;
	model.log[model.writes++].value = value;
	*word(address) = model.on_write != NULL ? model.on_write(address, value, kept) : value;
}

uint32_t register_hold(void)
{
	return (uint32_t)model.held++;
}

void register_release(uint32_t mask)
{
	model.held = (int)mask;
}

void register_mask(uint32_t priority)
{
	model.masked = priority;
	model.masks++;
}

void register_barrier(void)
{
	model.barrier_at = model.writes;
}
