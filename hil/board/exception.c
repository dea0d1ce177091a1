/* SPDX-License-Identifier: GPL-2.0-or-later */
#include <string.h>
#include <unicorn/unicorn.h>

#include "hil/board/chip.h"

enum {
	ENTRY_CLOCKS = 12,
	TAIL_CLOCKS = 6,
	FRAME_BYTES = 32,
	DEPTH_MAX = 8,
	LOWEST = 256, /* below every priority */
};

#define RETURN_THREAD 0xFFFFFFF9u
#define RETURN_HANDLER 0xFFFFFFF1u

static struct {
	uint64_t lines, pending, enabled;
	unsigned depth; /* 0: main */
	struct level {
		unsigned exception, priority;
		uint32_t instructions; /* its own, what interrupted it not counted */
	} level[DEPTH_MAX];
	uint32_t lowest_stack;
} nest;

void exception_state(void)
{
	preempt_keep(&nest, sizeof(nest));
}

void exception_open(void)
{
	nest.lowest_stack = BOARD_CCM + BOARD_STACK_BYTES;
}

void exception_reset(void)
{
	nest.lines = nest.pending = 0;
	nest.enabled = 1u << BOARD_PENDSV;
	nest.depth = 0;
	nest.level[0] = (struct level){0};
}

void exception_enable(uint64_t exceptions)
{
	nest.enabled |= exceptions;
}

unsigned exception_depth(void)
{
	return nest.depth;
}

unsigned exception_that_runs(void)
{
	return nest.level[nest.depth].exception;
}

uint32_t *exception_instructions(void)
{
	return &nest.level[nest.depth].instructions;
}

uint32_t exception_stack(void)
{
	return BOARD_CCM + BOARD_STACK_BYTES - nest.lowest_stack;
}

bool exception_masks_all(void)
{
	return core_get(UC_ARM_REG_PRIMASK) & 1;
}

static unsigned priority_of(unsigned exception)
{
	if (exception == BOARD_PENDSV)
		return *registers_at(SCB_SHPR3) >> 16 & 0xF0;
	return *registers_at(NVIC_IPR + (exception - 16) / 4 * 4) >> (8 * (exception % 4)) & 0xF0;
}

void exception_line(unsigned exception, bool high)
{
	uint64_t bit = 1ull << exception;

	if (high && !(nest.lines & bit))
		nest.pending |= bit;
	nest.lines = high ? nest.lines | bit : nest.lines & ~bit;
}

void exception_pend(unsigned exception)
{
	nest.pending |= 1ull << exception;
}

/* The exception that is to be taken now, 0: none. Of equal ones the lowest number. */
unsigned exception_next(void)
{
	uint64_t ready = nest.pending & nest.enabled;
	unsigned best = 0, best_priority = nest.depth ? nest.level[nest.depth].priority : LOWEST, base;

	for (; ready != 0; ready &= ready - 1) {
		unsigned exception = (unsigned)__builtin_ctzll(ready), priority = priority_of(exception);

		if (priority < best_priority) {
			best = exception;
			best_priority = priority;
		}
	}
	if (best == 0 || core_get(UC_ARM_REG_PRIMASK) & 1)
		return 0;
	base = core_get(UC_ARM_REG_BASEPRI) & 0xF0;
	return base != 0 && best_priority >= base ? 0 : best;
}

static uint32_t *stack_at(uint32_t address)
{
	if (address - BOARD_CCM >= BOARD_STACK_BYTES)
		board_fail("the stack is at 0x%08X", address);
	return (uint32_t *)(void *)(board.ccm + (address - BOARD_CCM));
}

static const int stacked[] = {UC_ARM_REG_R0,  UC_ARM_REG_R1, UC_ARM_REG_R2, UC_ARM_REG_R3,
                              UC_ARM_REG_R12, UC_ARM_REG_LR, UC_ARM_REG_PC};

static void push_frame(void)
{
	uint32_t sp = core_get(UC_ARM_REG_SP), place = (sp - FRAME_BYTES) & ~7u, *frame = stack_at(place);

	for (unsigned i = 0; i < 7; i++)
		frame[i] = core_get(stacked[i]);
	frame[7] = core_get(UC_ARM_REG_XPSR) | 1u << 24;
	if (sp & 4)
		frame[7] |= 1u << 9;
	else
		frame[7] &= ~(1u << 9);
	core_set(UC_ARM_REG_SP, place);
	if (place < nest.lowest_stack)
		nest.lowest_stack = place;
}

static void pop_frame(void)
{
	uint32_t sp = core_get(UC_ARM_REG_SP), frame[8];

	memcpy(frame, stack_at(sp), sizeof(frame));
	core_set(UC_ARM_REG_SP, sp + FRAME_BYTES + (frame[7] >> 9 & 1) * 4);
	for (unsigned i = 0; i < 6; i++)
		core_set(stacked[i], frame[i]);
	core_set(UC_ARM_REG_XPSR, frame[7] & ~(1u << 9));
	core_set(UC_ARM_REG_PC, frame[6] | 1);
}

/* The handler's first instruction is next; its frame is on the stack. */
static void enter_handler(unsigned exception)
{
	uint32_t vector;

	memcpy(&vector, board.flash + (*registers_at(SCB_VTOR) - BOARD_FLASH) + 4 * exception, 4);
	if (!(vector & 1) || nest.depth + 1 == DEPTH_MAX)
		board_fail("exception %u has the vector 0x%08X, %u deep", exception, vector, nest.depth);
	nest.pending &= ~(1ull << exception);
	core_set(UC_ARM_REG_LR, nest.depth ? RETURN_HANDLER : RETURN_THREAD);
	core_set(UC_ARM_REG_XPSR, (core_get(UC_ARM_REG_XPSR) & 0xF80F0000) | 1u << 24 | exception);
	core_set(UC_ARM_REG_PC, vector);
	nest.level[++nest.depth] = (struct level){exception, priority_of(exception), 0};
	core_entered(exception, nest.depth);
}

void exception_leave(void)
{
	const struct level *level = &nest.level[nest.depth];
	uint32_t pc = core_get(UC_ARM_REG_PC) | 1, expected = nest.depth > 1 ? RETURN_HANDLER : RETURN_THREAD;
	unsigned next;

	if (nest.depth == 0 || pc != expected)
		board_fail("a return with 0x%08X, %u deep", pc, nest.depth);
	if (nest.lines >> level->exception & 1)
		nest.pending |= 1ull << level->exception;
	nest.depth--;
	core_left(level->exception, nest.depth + 1, level->instructions);
	next = exception_next();
	if (next != 0) {
		board.now += board.options.half_clocks > 0 ? TAIL_CLOCKS : 0;
		enter_handler(next);
		return;
	}
	board.now += board.options.half_clocks > 0 ? ENTRY_CLOCKS : 0;
	pop_frame();
}

void exception_take(void)
{
	unsigned next = exception_next();

	if (next == 0)
		return;
	board.now += board.options.half_clocks > 0 ? ENTRY_CLOCKS : 0;
	push_frame();
	enter_handler(next);
}

bool exception_masks_control(void)
{
	uint32_t base = core_get(UC_ARM_REG_BASEPRI) & 0xF0;

	return exception_masks_all() || (base != 0 && priority_of(BOARD_PENDSV) >= base);
}
