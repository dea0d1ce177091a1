/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_UNIT_STM32G474_MODEL_H
#define DT_TESTS_UNIT_STM32G474_MODEL_H
/*
 * The registers of the STM32G474 on the host: what is written is kept and logged; a test says through two
 * hooks what the hardware makes of it. Shows order and encoding, never clocks, pins or timing.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
	MODEL_WORDS = 1024, /* registers at most */
	MODEL_LOG = 4096,
	MODEL_READS_MAX = 200000, /* more is a loop without an end */
};

struct model {
	uint32_t address[MODEL_WORDS], value[MODEL_WORDS];
	unsigned count;
	struct {
		uint32_t address, value;
	} log[MODEL_LOG]; /* writes in their order */
	int writes;
	unsigned reads;
	int held;        /* register_hold without register_release */
	uint32_t masked; /* by register_mask */
	int masks;
	int barrier_at; /* writes before the last register_barrier */
	/* What a read gives, and what a write leaves; NULL: the value kept, the value written. */
	uint32_t (*on_read)(uint32_t address, uint32_t kept);
	uint32_t (*on_write)(uint32_t address, uint32_t written, uint32_t kept);
};

extern struct model model;

void model_init(void);

/* Without hooks and log. */
uint32_t model_get(uint32_t address);
void model_put(uint32_t address, uint32_t value);

/* Index in the log of the first write to the address from index `from` on with (value & mask) == bits; -1:
 * none. */
int model_find(uint32_t address, uint32_t mask, uint32_t bits, int from);

/* How many writes to the address. */
int model_count(uint32_t address);

#endif
