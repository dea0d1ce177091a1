/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Interrupts after every instruction. The answers of a recorded drop stand in for the bench, so that the
 * image does again what it did. A first run surveys it: which polls of the main loop and which runs of
 * control's interrupts are to be walked through, and what the blocks hold. A second
 * one stops at each of them, before each of its instructions, saves the state, lets this instruction take as
 * long as it needs for interrupts to come, goes on until all is at rest again, judges, and goes back to the
 * saved state.
 *
 * Walked through is, for each stretch of code and state of the tower, the longest poll (control: the longest
 * run) that runs it. Not interrupted are the one to four instructions of an IT block, where the emulator
 * cannot stop.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hil/board/chip.h"

enum {
	PLACES = 64 * 1024 / 2, /* of instructions */
	STATES = 16,
	TICKS_MAX = 16384,
	RUNS_MAX = 8 * TICKS_MAX,
	KEPT_MAX = 32,
	REPORTED_MAX = 10,
	HOLD_CLOCKS_MAX = 9 * BOARD_CLOCKS_PER_MS / 2,
	TRIAL_CLOCKS_MAX = 20 * BOARD_CLOCKS_PER_MS,
	WHOLE = 10,     /* polls, the longest, of which every instruction is interrupted ... */
	OTHERS = 10,    /* ... and every so many of the others */
	DOORS = 5,      /* and of all of them for a door */
	DOOR_TICKS = 4, /* until a door is seen: three readings and the tick that follows */
	/* frames, by wire.def */
	BLOCK_S1 = 0x181,
	BLOCK_S2 = 0x281,
	STATUS = 0x682,
	TICK_AT = 2,
	STATUS_AT = 6,
	SAMPLES_AT = 10,
	SAMPLES_BYTES = 54,
	DOOR_CLOSED = 1 << 8,
	LATCH_OPEN = 1 << 0,
	DAMPERS_RELIEVE = 1 << 2,
};

/* Whose instructions: main, the millisecond's control, CAN, a gate. */
enum place { MAIN, CONTROL, CAN, GATE, PLACES_OF_CODE };
static const char *const place_names[] = {"main", "control", "CAN", "gate"};

/* What comes while an instruction stands still. */
enum variant {
	TICK,    /* main: until control has run */
	DOOR,    /* main: until control has seen the door open */
	SAMPLES, /* until both samples' interrupts have run */
	TURN,    /* control: until the next millisecond has begun and its first samples are there */
	EDGE,    /* control, gate: a gate, then as SAMPLES */
	FRAME,   /* CAN: the frame that came comes again, then as SAMPLES */
	VARIANTS
};
static const char *const variant_names[] = {"tick", "door opens", "samples", "turn", "gate's edge", "frame"};
static const bool applies[PLACES_OF_CODE][VARIANTS] = {
        [MAIN] = {[TICK] = true, [DOOR] = true},
        [CONTROL] = {[SAMPLES] = true, [TURN] = true, [EDGE] = true},
        [CAN] = {[SAMPLES] = true, [FRAME] = true},
        [GATE] = {[SAMPLES] = true, [EDGE] = true},
};

/* ---- what comes back with a saved state ---- */

static struct {
	void *at[KEPT_MAX];
	uint8_t *saved[KEPT_MAX];
	size_t bytes[KEPT_MAX];
	unsigned count;
} kept;

void preempt_keep(void *at, size_t bytes)
{
	kept.at[kept.count] = at;
	kept.bytes[kept.count] = bytes;
	kept.saved[kept.count] = malloc(bytes);
	if (kept.saved[kept.count] == NULL || ++kept.count == KEPT_MAX)
		board_fail("no room for a state");
}

static void save(void)
{
	core_save();
	for (unsigned i = 0; i < kept.count; i++)
		memcpy(kept.saved[i], kept.at[i], kept.bytes[i]);
}

static void restore(void)
{
	core_restore();
	for (unsigned i = 0; i < kept.count; i++)
		memcpy(kept.at[i], kept.saved[i], kept.bytes[i]);
}

/* ---- what is followed all the time ---- */

static struct {
	unsigned exception[8]; /* that runs at this depth */
	uint32_t lock_return;  /* where main goes on inside its lock; 0: not on its way there */
	bool locked;
	uint32_t runs[PLACES_OF_CODE]; /* that have begun */
	uint32_t last_tick[2];         /* of S1's and S2's blocks */
	unsigned state;                /* of the tower, as the last block says */
	unsigned gates_handled;        /* calls of app_on_gate */
	bool poll_over;
	unsigned left[BOARD_EXCEPTIONS]; /* handlers that have ended */
} follow;

static struct {
	uint8_t samples[TICKS_MAX][2][SAMPLES_BYTES];
	bool there[TICKS_MAX][2];
	struct longest {
		uint32_t run, instructions;
	} longest[PLACES_OF_CODE][STATES][PLACES];
	uint8_t ran[PLACES_OF_CODE][PLACES]; /* in the run under way */
	uint32_t instructions[PLACES_OF_CODE];
	uint8_t *wanted[PLACES_OF_CODE]; /* by number of the run: not, each of its instructions, some */
	uint32_t wanted_count[PLACES_OF_CODE];
} survey;

static void begin_following(void)
{
	memset(&follow, 0, sizeof(follow));
	follow.last_tick[0] = follow.last_tick[1] = UINT32_MAX; /* the first one is 0 */
}

static enum { SURVEY, WALK, TRIAL } phase;

static struct {
	enum place place;
	uint32_t run, number; /* the instruction of it */
	uint32_t address;
	enum variant variant;
	unsigned depth;
	bool step, stepped; /* one instruction shall run, it has begun: stop at the next */
	uint32_t it_end;
	bool wanted; /* its first instruction is next */
	bool broken;
} walk;

static struct {
	uint64_t points;
	unsigned wrong;
} total;

static void wrong(const char *what, uint32_t value)
{
	if (walk.broken)
		return;
	walk.broken = true;
	if (total.wrong++ < REPORTED_MAX)
		printf("%s %u, before instruction %u at 0x%08X, %s: %s (%u)\n", place_names[walk.place],
		       walk.run, walk.number, walk.address, variant_names[walk.variant], what, value);
}

void preempt_where(void)
{
	if (phase != SURVEY)
		fprintf(stderr, "%s %u, %s instruction %u at 0x%08X, %s\n", place_names[walk.place], walk.run,
		        phase == TRIAL ? "before" : "on the way to", walk.number, walk.address,
		        variant_names[walk.variant]);
}

static enum place place_of(unsigned exception)
{
	return exception == BOARD_PENDSV  ? CONTROL
	       : exception == BOARD_FDCAN ? CAN
	       : exception == BOARD_TIM2  ? GATE
	                                  : PLACES_OF_CODE;
}

static void end_of_run(enum place place, uint32_t run)
{
	for (unsigned i = 0; i < PLACES; i++) {
		struct longest *longest = &survey.longest[place][follow.state][i];

		if (survey.ran[place][i] && longest->instructions < survey.instructions[place])
			*longest = (struct longest){run, survey.instructions[place]};
	}
	memset(survey.ran[place], 0, sizeof(survey.ran[place]));
	survey.instructions[place] = 0;
}

/* A run begins: is it one to be walked through? */
static void begin_of_run(enum place place, unsigned depth)
{
	uint32_t run = follow.runs[place]++;

	if (phase != WALK || run >= RUNS_MAX || !survey.wanted[place][run])
		return;
	walk.place = place;
	walk.run = run;
	walk.depth = depth;
	walk.wanted = true;
	core_pause();
}

static void on_poll(void)
{
	follow.poll_over = true;
	if (phase == SURVEY && follow.runs[MAIN] > 0)
		end_of_run(MAIN, follow.runs[MAIN] - 1);
	begin_of_run(MAIN, 0);
}

static void on_entered(unsigned exception, unsigned depth)
{
	follow.exception[depth] = exception;
	if (place_of(exception) == PLACES_OF_CODE)
		return;
	if (depth == 1 && follow.locked)
		wrong("control interrupts main inside its lock, exception", exception);
	begin_of_run(place_of(exception), depth);
}

static void on_left(unsigned exception, unsigned depth)
{
	enum place place = place_of(exception);

	(void)depth;
	follow.left[exception]++;
	if (phase == SURVEY && place < PLACES_OF_CODE)
		end_of_run(place, follow.runs[place] - 1);
}

static void on_block(unsigned depth, uint32_t address)
{
	enum place place = depth == 0 ? MAIN : place_of(follow.exception[depth]);

	if (phase == SURVEY && place < PLACES_OF_CODE && (address - BOARD_FLASH) / 2 < PLACES)
		survey.ran[place][(address - BOARD_FLASH) / 2] = 1;
}

/* The address behind an IT instruction's block; 0: it is none. */
static uint32_t it_block_end(uint32_t address)
{
	uint16_t code;
	unsigned count;

	memcpy(&code, board.flash + (address - BOARD_FLASH), 2);
	if ((code & 0xFF00) != 0xBF00 || (code & 15) == 0)
		return 0;
	count = 4 - (unsigned)__builtin_ctz(code & 15);
	address += 2;
	for (; count > 0; count--) {
		memcpy(&code, board.flash + (address - BOARD_FLASH), 2);
		address += code >> 11 >= 0x1D ? 4 : 2;
	}
	return address;
}

static void follow_lock(uint32_t address)
{
	if (address == board.lock)
		follow.lock_return = core_register(14) & ~1u;
	else if (address == board.unlock)
		follow.locked = false;
	else if (follow.lock_return != 0 && address == follow.lock_return) {
		follow.locked = true;
		follow.lock_return = 0;
	}
}

static void on_instruction(unsigned depth, uint32_t address)
{
	enum place place = depth == 0 ? MAIN : place_of(follow.exception[depth]);

	if (depth == 0)
		follow_lock(address);
	if (phase == SURVEY && place < PLACES_OF_CODE)
		survey.instructions[place]++;
	if (phase == WALK && walk.step && depth == walk.depth && address >= walk.it_end) {
		if (walk.stepped) {
			walk.it_end = 0;
			walk.address = address;
			core_pause();
			return;
		}
		walk.stepped = true;
		walk.it_end = it_block_end(address);
	}
	follow.gates_handled += address == board.on_gate;
}

/* ---- what must hold ---- */

static uint32_t word_at(const uint8_t *bytes)
{
	uint32_t word;

	memcpy(&word, bytes, sizeof(word));
	return word;
}

static void judge_block(const struct frame *frame, unsigned sensor)
{
	uint32_t tick = word_at(frame->data + TICK_AT), missing = tick - follow.last_tick[sensor] - 1;

	if (phase == SURVEY && tick < TICKS_MAX) {
		memcpy(survey.samples[tick][sensor], frame->data + SAMPLES_AT, SAMPLES_BYTES);
		survey.there[tick][sensor] = true;
	} else if (tick < TICKS_MAX && survey.there[tick][sensor] &&
	           memcmp(survey.samples[tick][sensor], frame->data + SAMPLES_AT, SAMPLES_BYTES) != 0) {
		wrong("other samples than undisturbed, tick", tick);
	}
	if (phase != SURVEY && missing > (walk.variant == TURN && phase == TRIAL ? 1u : 0u))
		wrong("ticks are missing or come twice before tick", tick);
	follow.last_tick[sensor] = tick;
	follow.state = frame->data[STATUS_AT] & 15;
}

/* A fault and a state that has none cannot be told together, nor the other way round. */
static void judge_status(const struct frame *frame)
{
	unsigned state = frame->data[0], fault = frame->data[1];

	if ((state >= 1 && state <= 6 && fault != 0) || ((state == 9 || state == 10) && fault == 0))
		wrong("the status tells a state with another moment's fault, state", state);
}

void preempt_sent(const struct frame *frame)
{
	if (frame->id == BLOCK_S1 || frame->id == BLOCK_S2)
		judge_block(frame, frame->id == BLOCK_S2);
	if (frame->id == STATUS)
		judge_status(frame);
}

static void judge_end(void)
{
	if (board.reset_wanted)
		wrong("the firmware resets itself, cause", board.reset_cause);
	else if (!core_waits())
		wrong("it does not come to rest, depth", core_pc());
	else if (follow.gates_handled != timer_gates())
		wrong("edges of the gates are lost, handled", follow.gates_handled);
	else if (can_waiting() > 0)
		wrong("received frames are left behind", can_waiting());
	else if (walk.variant == DOOR && system_outputs() & (LATCH_OPEN | DAMPERS_RELIEVE))
		wrong("the door is open and the outputs are", system_outputs());
}

/* ---- a trial ---- */

static void inject(void)
{
	if (walk.variant == DOOR)
		plant_inputs_off(DOOR_CLOSED);
	if (walk.variant == EDGE)
		timer_capture(walk.number & 1, timer_us(board.now));
	if (walk.variant == FRAME)
		can_again();
}

static unsigned samples_left(void)
{
	unsigned x = follow.left[BOARD_TIM4], yz = follow.left[BOARD_TIM3];

	return x < yz ? x : yz;
}

static bool held_enough(void)
{
	unsigned control = follow.left[BOARD_PENDSV], turns = follow.left[BOARD_TIM1];

	if (exception_masks_all())
		return true;
	switch (walk.variant) {
	case TICK:
		return control >= 1 || (exception_masks_control() && turns >= 1);
	case DOOR:
		return control >= DOOR_TICKS || (exception_masks_control() && turns >= 1);
	case TURN:
		if (turns == 0) /* those of the millisecond before do not count */
			follow.left[BOARD_TIM3] = follow.left[BOARD_TIM4] = 0;
		return turns >= 1 && samples_left() >= 1;
	default:
		return samples_left() >= 1;
	}
}

static void trial(void)
{
	int64_t begin = board.now;
	unsigned wanted;

	total.points++;
	phase = TRIAL;
	walk.broken = false;
	memset(follow.left, 0, sizeof(follow.left));
	inject();
	core_hold(walk.depth);
	while (!board.over && !board.reset_wanted && !held_enough() && board.now - begin < HOLD_CLOCKS_MAX)
		core_pass();
	if (!board.over && !board.reset_wanted && !held_enough())
		wrong("no interrupt comes through, samples", samples_left());
	core_hold(CORE_HOLDS_NONE);
	wanted = follow.left[BOARD_PENDSV] + (walk.depth == 0 ? 1 : 2);
	if (walk.variant == DOOR && wanted < DOOR_TICKS + 1)
		wanted = DOOR_TICKS + 1;
	while (!board.over && !board.reset_wanted && board.now - begin < TRIAL_CLOCKS_MAX &&
	       !(core_waits() && follow.left[BOARD_PENDSV] >= wanted))
		core_pass();
	if (!board.over)
		judge_end();
	restore();
	phase = WALK;
}

/* The instruction that is next runs, with what interrupts it by itself; false: it was the last. */
static bool one_step(void)
{
	unsigned exception = follow.exception[walk.depth], left = follow.left[exception];
	bool last = false;

	walk.step = true;
	walk.stepped = false;
	walk.address = 0;
	follow.poll_over = false;
	while (walk.address == 0 && !last) {
		core_pass();
		last = board.over || board.reset_wanted ||
		       (walk.depth == 0 ? follow.poll_over || core_waits() : follow.left[exception] != left);
	}
	walk.step = false;
	walk.number++;
	return !last;
}

enum { NOT_WANTED, EACH, SOME };

static unsigned stride(void)
{
	return board.options.every * (survey.wanted[walk.place][walk.run] == SOME ? OTHERS : 1) *
	       (walk.variant == DOOR ? DOORS : 1);
}

static void walk_through(void)
{
	walk.wanted = false;
	walk.number = 0;
	walk.address = core_pc();
	do {
		bool saved = false;

		for (walk.variant = 0; walk.variant < VARIANTS; walk.variant++) {
			if (!applies[walk.place][walk.variant] || walk.number % stride() != 0)
				continue;
			if (!saved)
				save();
			saved = true;
			trial();
		}
	} while (total.wrong < REPORTED_MAX && one_step());
	walk.wanted = false; /* one that began on the way */
}

/* ---- both runs ---- */

static struct core_watch watch = {on_poll, on_block, on_instruction, on_entered, on_left, NULL};

/* Of the runs that are wanted the longest ones whole. */
static void shorten(uint32_t *lengths)
{
	for (unsigned i = 0; i < WHOLE; i++) {
		uint32_t best = 0;

		for (uint32_t run = 1; run < RUNS_MAX; run++)
			if (lengths[run] > lengths[best])
				best = run;
		lengths[best] = 0;
		survey.wanted[MAIN][best] = EACH;
	}
}

static void choose(void)
{
	static uint32_t lengths[RUNS_MAX];

	for (enum place place = MAIN; place < PLACES_OF_CODE; place++) {
		unsigned turn = 0;

		survey.wanted[place] = calloc(RUNS_MAX, 1);
		if (survey.wanted[place] == NULL)
			board_fail("no room");
		for (unsigned i = 0; i < STATES * PLACES; i++) {
			const struct longest *longest = &survey.longest[place][i / PLACES][i % PLACES];

			if ((board.options.only != NULL &&
			     strcmp(board.options.only, place_names[place]) != 0) ||
			    longest->instructions == 0 || longest->run >= RUNS_MAX ||
			    survey.wanted[place][longest->run])
				continue;
			survey.wanted[place][longest->run] = place == MAIN ? SOME : EACH;
			survey.wanted_count[place]++;
			if (place == MAIN)
				lengths[longest->run] = longest->instructions;
		}
		if (place == MAIN)
			shorten(lengths);
		for (uint32_t run = 0; run < RUNS_MAX; run++)
			if (survey.wanted[place][run] && turn++ % board.options.shares != board.options.share)
				survey.wanted[place][run] = NOT_WANTED;
	}
}

void preempt_run(void)
{
	core_state();
	exception_state();
	registers_state();
	system_state();
	timer_state();
	sampling_state();
	can_state();
	plant_state();
	preempt_keep(&board, sizeof(board));
	preempt_keep(&follow, sizeof(follow));
	preempt_keep(board.sram, BOARD_SRAM_BYTES);
	preempt_keep(board.ccm, BOARD_CCM_BYTES);
	if (board.options.shared != NULL)
		watch.access = sharing_access;
	begin_following();
	core_boot(&watch);
	while (!board.over && !board.reset_wanted)
		core_pass();
	if (board.reset_wanted)
		board_fail("the firmware resets itself, undisturbed");
	if (board.options.shared != NULL) {
		sharing_judge(board.options.shared);
		return;
	}
	choose();
	begin_following();
	board.over = false;
	phase = WALK;
	core_boot(&watch);
	while (!board.over && !board.reset_wanted && total.wrong < REPORTED_MAX) {
		core_pass();
		if (walk.wanted)
			walk_through();
	}
	printf("%llu points, of %u polls, %u runs of control, %u of CAN, %u of a gate: %u wrong\n",
	       (unsigned long long)total.points, survey.wanted_count[MAIN], survey.wanted_count[CONTROL],
	       survey.wanted_count[CAN], survey.wanted_count[GATE], total.wrong);
	if (total.wrong > 0)
		exit(1);
}
