/* SPDX-License-Identifier: GPL-2.0-or-later */
#include <stdio.h>
#include <string.h>
#include <unicorn/unicorn.h>

#include "hil/board/chip.h"

enum {
	UNICORN_EXCEPTION_EXIT = 8,
	POLL = 0, /* tallies: an exception's, or main's: of a poll, between two looks for a frame */
	LOOK = 1,
	LATCH_OPEN = 1 << 0,
	WARNING = 1 << 4,
};

#define RETURN_MASK 0xFFFFFFE0u

struct tally {
	uint64_t calls, sum;
	uint32_t least, most;
};

static struct {
	uc_engine *uc;
	int64_t limit; /* a block that begins then or later waits */
	bool returning, failed;
	unsigned halves; /* of a clock that are left over */
	/* the main loop */
	uint32_t idle; /* the address behind its call of app_poll; 0: not yet known */
	bool at_idle, pass_idle, waiting, interrupted;
	uint8_t before[BOARD_SRAM_BYTES]; /* the memory when the poll before ended */
	unsigned held;                    /* the depth that stands still */
	bool paused;
	uint32_t stopped;     /* the instruction that did not begin; 0: none */
	uint32_t looked;      /* for a frame: main's count then */
	bool armed, released; /* by WARNING, and the latch since it came on */
	struct tally tally[BOARD_EXCEPTIONS];
} core;

/* Of each block of instructions, decoded once. */
static uint8_t block_instructions[BOARD_FLASH_BYTES / 2], block_halfwords[BOARD_FLASH_BYTES / 2];

static const struct core_watch *watch; /* NULL: nobody watches */
static uc_context *saved;

uint32_t core_get(int name)
{
	uint32_t value = 0;

	uc_reg_read(core.uc, name, &value);
	return value;
}

void core_set(int name, uint32_t value)
{
	uc_reg_write(core.uc, name, &value);
}

uint32_t core_pc(void)
{
	return core.uc != NULL ? core_get(UC_ARM_REG_PC) : 0;
}

static void add_tally(unsigned which, uint32_t instructions)
{
	struct tally *tally = &core.tally[which];

	tally->least = tally->calls == 0 || instructions < tally->least ? instructions : tally->least;
	tally->most = instructions > tally->most ? instructions : tally->most;
	tally->sum += instructions;
	tally->calls++;
}

void core_entered(unsigned exception, unsigned depth)
{
	core.interrupted = true;
	if (watch != NULL)
		watch->entered(exception, depth);
	if (exception != BOARD_TIM1 && exception != BOARD_TIM3 && exception != BOARD_TIM4)
		board.woken =
		        true; /* main gets what control, gates and CAN bring, from the samples nothing */
}

void core_left(unsigned exception, unsigned depth, uint32_t instructions)
{
	add_tally(exception, instructions);
	if (watch != NULL)
		watch->left(exception, depth);
}

/* ---- what the processor tells ---- */

static unsigned instructions_in(uint32_t address, uint32_t size)
{
	uint32_t place = (address - BOARD_FLASH) / 2;
	unsigned count = 0;

	if (block_halfwords[place] * 2u == size)
		return block_instructions[place];
	for (uint32_t i = 0; i < size; count++) {
		uint16_t first;

		memcpy(&first, board.flash + (address - BOARD_FLASH) + i, 2);
		i += first >> 11 >= 0x1D ? 4 : 2;
	}
	if (size / 2 <= UINT8_MAX) {
		block_halfwords[place] = (uint8_t)(size / 2);
		block_instructions[place] = (uint8_t)count;
	}
	return count;
}

static void spend(unsigned instructions)
{
	/* none: what starts up waits for time to pass, what runs afterwards for events */
	unsigned cost =
	        board.options.half_clocks == 0 && timer_start_time() < 0 ? 2 : board.options.half_clocks;
	unsigned halves = instructions * cost + core.halves;

	board.now += halves / 2;
	core.halves = halves % 2;
	*exception_instructions() += instructions;
}

/* libunicorn's own idea of where it stopped is the instruction before where that one lies across two pages.
 */
static void stop_before(uint32_t address)
{
	core.stopped = address;
	uc_emu_stop(core.uc);
}

/* Counted from ARMED until the latch opens. */
static void on_look(void)
{
	uint16_t outputs = system_outputs();

	if (core.armed && !(outputs & LATCH_OPEN))
		add_tally(LOOK, *exception_instructions() - core.looked);
	core.released = outputs & WARNING && (core.released || outputs & LATCH_OPEN);
	core.armed = outputs & WARNING && !core.released;
	core.looked = *exception_instructions();
}

static void on_block(uc_engine *uc, uint64_t address64, uint32_t size, void *unused)
{
	uint32_t address = (uint32_t)address64;

	(void)uc, (void)unused;
	if (address - BOARD_FLASH >= BOARD_FLASH_BYTES) /* a return, which the processor reports next */
		return;
	if (exception_depth() == 0 && address == board.app_poll && core.idle == 0) {
		core.idle = core_get(UC_ARM_REG_LR) & ~1u;
		*exception_instructions() = 0; /* of the start */
	}
	if (exception_depth() == 0 && address == core.idle && !core.pass_idle) {
		core.at_idle = true;
		stop_before(address);
		return;
	}
	if (exception_depth() == 0 && address == board.look)
		on_look();
	if (board.now >= core.limit || exception_next() != 0) {
		stop_before(address);
		return;
	}
	core.pass_idle = false;
	if (watch != NULL)
		watch->block(exception_depth(), address);
	else
		spend(instructions_in(address, size));
}

static void on_access(uc_engine *uc, int type, uint64_t address, int size, int64_t value, void *unused)
{
	(void)uc, (void)value, (void)unused;
	watch->access(exception_depth(), (uint32_t)address, (unsigned)size, type == UC_MEM_WRITE);
}

/* Only where somebody watches: it takes twice the time. */
static void on_instruction(uc_engine *uc, uint64_t address, uint32_t size, void *unused)
{
	(void)uc, (void)size, (void)unused;
	if (core.paused || core.stopped != 0 || address - BOARD_FLASH >= BOARD_FLASH_BYTES)
		return;
	watch->instruction(exception_depth(), (uint32_t)address);
	if (core.paused)
		stop_before((uint32_t)address);
	else
		spend(1);
}

static void on_interrupt(uc_engine *uc, uint32_t number, void *unused)
{
	(void)unused;
	if (number == UNICORN_EXCEPTION_EXIT && exception_depth() > 0 &&
	    (core_get(UC_ARM_REG_PC) & RETURN_MASK) == RETURN_MASK)
		core.returning = true;
	else
		board_fail("exception %u of the processor", number);
	uc_emu_stop(uc);
}

static int64_t earlier(int64_t a, int64_t b)
{
	return a < b ? a : b;
}

static int64_t next_event(void)
{
	return earlier(earlier(timer_next(), plant_next()), earlier(sampling_next(), system_next()));
}

static uint64_t on_read(uc_engine *uc, uint64_t offset, unsigned size, void *base)
{
	uint32_t address = (uint32_t)(uintptr_t)base + (uint32_t)offset;

	(void)uc;
	if (size != 4)
		board_fail("0x%08X is read with %u bytes", address, size);
	if (address >= 0xE000E000u)
		return *registers_at(address);
	return registers_read(address);
}

static void write_core(uint32_t address, uint32_t value)
{
	registers_check_write(address, value);
	board.wrote = true;
	if (address == NVIC_ISER)
		exception_enable((uint64_t)value << 16);
	if (address == SCB_ICSR) {
		exception_pend(BOARD_PENDSV);
		return;
	}
	if (address == SCB_AIRCR && value == 0x05FA0004) {
		board.reset_wanted = true;
		board.reset_cause = BOARD_COMMAND;
		core.limit = 0;
	}
	*registers_at(address) = value;
}

static void on_write(uc_engine *uc, uint64_t offset, unsigned size, uint64_t value, void *base)
{
	uint32_t address = (uint32_t)(uintptr_t)base + (uint32_t)offset;

	(void)uc;
	if (size != 4)
		board_fail("0x%08X is written with %u bytes", address, size);
	if (address >= 0xE000E000u)
		write_core(address, (uint32_t)value);
	else
		registers_write(address, (uint32_t)value);
	if (address < 0x40020000) /* a timer: what comes next may have changed */
		core.limit = earlier(core.limit, next_event());
}

/* ---- set-up ---- */

static void must(uc_err error, const char *what)
{
	if (error != UC_ERR_OK)
		board_fail("%s: %s", what, uc_strerror(error));
}

static void map_registers(uint32_t base, size_t size)
{
	void *user = (void *)(uintptr_t)base;

	must(uc_mmio_map(core.uc, base, size, on_read, user, on_write, user), "registers");
}

static void hook(int type, void *function)
{
	uc_hook handle;

	must(uc_hook_add(core.uc, &handle, type, function, NULL, 1, 0), "hook");
}

void core_open(void)
{
	static _Alignas(4096) uint8_t flash[BOARD_FLASH_BYTES], sram[BOARD_SRAM_BYTES], ccm[BOARD_CCM_BYTES];

	board.flash = memset(flash, 0xFF, sizeof(flash));
	board.sram = sram;
	board.ccm = ccm;
	exception_open();
	must(uc_open(UC_ARCH_ARM, UC_MODE_THUMB | UC_MODE_MCLASS, &core.uc), "emulator");
	must(uc_ctl_set_cpu_model(core.uc, UC_CPU_ARM_CORTEX_M4), "processor");
	must(uc_mem_map_ptr(core.uc, BOARD_FLASH, sizeof(flash), UC_PROT_READ | UC_PROT_EXEC, flash),
	     "flash");
	must(uc_mem_map_ptr(core.uc, BOARD_SRAM, sizeof(sram), UC_PROT_READ | UC_PROT_WRITE, sram), "SRAM");
	must(uc_mem_map_ptr(core.uc, BOARD_CCM, BOARD_STACK_BYTES, UC_PROT_READ | UC_PROT_WRITE, ccm),
	     "stack");
	map_registers(0x40000000, 0x31000);
	map_registers(0x48000000, 0x2000);
	map_registers(0x50000000, 0x1000);
	map_registers(0x50060000, 0x1000);
	map_registers(0xE000E000u, 0x1000);
	hook(UC_HOOK_BLOCK, (void *)(uintptr_t)on_block);
	hook(UC_HOOK_INTR, (void *)(uintptr_t)on_interrupt);
}

static void core_reset(void)
{
	static const int others[] = {
	        UC_ARM_REG_R0,  UC_ARM_REG_R1,      UC_ARM_REG_R2,      UC_ARM_REG_R3,
	        UC_ARM_REG_R4,  UC_ARM_REG_R5,      UC_ARM_REG_R6,      UC_ARM_REG_R7,
	        UC_ARM_REG_R8,  UC_ARM_REG_R9,      UC_ARM_REG_R10,     UC_ARM_REG_R11,
	        UC_ARM_REG_R12, UC_ARM_REG_PRIMASK, UC_ARM_REG_BASEPRI, UC_ARM_REG_CONTROL};
	uint32_t vector[2];

	memcpy(vector, board.flash, sizeof(vector));
	for (unsigned i = 0; i < sizeof(others) / sizeof(others[0]); i++)
		core_set(others[i], 0);
	core_set(UC_ARM_REG_XPSR, 1u << 24);
	core_set(UC_ARM_REG_LR, 0xFFFFFFFFu);
	core_set(UC_ARM_REG_SP, vector[0]);
	core_set(UC_ARM_REG_PC, vector[1]);
	core.at_idle = core.pass_idle = core.waiting = false;
	core.idle = 0;
}

static void set_mark(enum board_reset cause)
{
	uint8_t kept = (uint8_t)board.options.kept;
	uint32_t mark[3] = {0x52554E21u, ~0x52554E21u, 0xC35A0000u | (uint32_t)(uint8_t)~kept << 8 | kept};

	if (cause != BOARD_POWER_ON)
		memcpy(board.sram + (board.mark - BOARD_SRAM), mark, sizeof(mark));
}

void core_hold(unsigned depth)
{
	core.held = depth;
}

void core_pause(void)
{
	core.paused = true;
}

uint32_t core_register(unsigned number)
{
	return core_get(number == 14 ? UC_ARM_REG_LR : UC_ARM_REG_R0 + (int)number);
}

void core_state(void)
{
	preempt_keep(&core, sizeof(core));
}

void core_save(void)
{
	if (saved == NULL)
		must(uc_context_alloc(core.uc, &saved), "context");
	must(uc_context_save(core.uc, saved), "context");
}

void core_restore(void)
{
	must(uc_context_restore(core.uc, saved), "context");
}

static void boot(enum board_reset cause)
{
	board.reset_wanted = board.hung = false;
	registers_reset();
	timer_reset();
	system_reset(cause);
	sampling_reset();
	can_reset();
	plant_reset();
	exception_reset();
	core_reset();
}

/* ---- running ---- */

/* All that is due, in the order of the times. */
static void run_events(void)
{
	while (!board.over && !board.reset_wanted && next_event() <= board.now) {
		if (plant_next() <= board.now)
			plant_event();
		timer_event();
		if (sampling_next() <= board.now)
			sampling_event();
		system_event();
	}
}

/* A poll is over: one that was not interrupted, wrote no register and left the memory as it found it would do
 * the same again until something comes. */
static bool was_idle(void)
{
	bool quiet = !core.interrupted && !board.wrote, same;

	add_tally(POLL, *exception_instructions());
	if (!quiet)
		return false;
	same = memcmp(core.before, board.sram, sizeof(core.before)) == 0;
	if (!same)
		memcpy(core.before, board.sram, sizeof(core.before));
	return same;
}

bool core_waits(void)
{
	return core.waiting && !board.woken && exception_depth() == 0;
}

static void begin_poll(void)
{
	core.looked -= *exception_instructions();
	*exception_instructions() = 0;
	core.interrupted = board.wrote = board.woken = core.waiting = false;
	core.pass_idle = true;
	if (watch != NULL)
		watch->poll();
}

/* The main loop is between two polls. Time goes on to what comes next, where nothing else can happen; the
 * memory that the samples' interrupts write is none that main reads. */
static void idle(void)
{
	core.at_idle = false;
	if (!board.hung && (core.waiting ? board.woken : !was_idle())) {
		begin_poll();
		return;
	}
	if (!core.waiting)
		board.woken = false;
	core.waiting = true;
	while (!board.over && !board.reset_wanted && (board.hung || !board.woken) && exception_next() == 0) {
		board.now = next_event();
		run_events();
	}
}

static void run_processor(void)
{
	uc_err error;

	core.limit = next_event();
	core.stopped = 0;
	error = uc_emu_start(core.uc, core_get(UC_ARM_REG_PC) | 1, 0xFFFFFFFE, 0, 0);
	if (error != UC_ERR_OK && !core.returning)
		board_fail("%s", uc_strerror(error));
	if (core.stopped != 0)
		core_set(UC_ARM_REG_PC, core.stopped | 1);
}

void core_boot(const struct core_watch *watching)
{
	if (watching != NULL && watch == NULL) {
		hook(UC_HOOK_CODE, (void *)(uintptr_t)on_instruction);
		if (watching->access != NULL)
			hook(UC_HOOK_MEM_READ | UC_HOOK_MEM_WRITE, (void *)(uintptr_t)on_access);
	}
	watch = watching;
	core.held = CORE_HOLDS_NONE;
	set_mark(board.options.cause);
	boot(board.options.cause);
}

void core_pass(void)
{
	core.paused = false;
	run_events();
	if (board.over || board.reset_wanted)
		return;
	exception_take();
	if (core.paused)
		return;
	if (exception_depth() == core.held) { /* as if this instruction took so long */
		board.now = next_event();
		return;
	}
	run_processor();
	if (core.returning) {
		core.returning = false;
		exception_leave();
	} else if (core.at_idle) {
		idle();
	}
}

void core_run(void)
{
	core_boot(NULL);
	while (!board.over) {
		core_pass();
		if (board.reset_wanted)
			boot(board.reset_cause);
	}
}

void core_report(const char *path)
{
	static const char *const names[BOARD_EXCEPTIONS] = {
	        [POLL] = "poll",       [LOOK] = "look",       [BOARD_PENDSV] = "control",
	        [BOARD_FDCAN] = "can", [BOARD_TIM1] = "turn", [BOARD_TIM2] = "gate",
	        [BOARD_TIM3] = "yz",   [BOARD_TIM4] = "x",
	};
	FILE *file = fopen(path, "ae");

	if (file == NULL)
		board_fail("%s cannot be written", path);
	for (unsigned i = 0; i < BOARD_EXCEPTIONS; i++)
		if (names[i] != NULL)
			fprintf(file, "%s %llu %u %u %llu\n", names[i],
			        (unsigned long long)core.tally[i].calls, core.tally[i].least,
			        core.tally[i].most, (unsigned long long)core.tally[i].sum);
	fprintf(file, "stack 1 %u %u 0\n", exception_stack(), exception_stack());
	fclose(file);
}
