/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "hil/bench_private.h"
#include "hil/random.h"

enum {
	SECOND_BEAT_MS = 100,
	FORGED_PER_MS = 2,
};

void bench_verb(struct bench *bench, const struct event *event)
{
	struct wire_command command = event->command;
	struct frame frame;

	script_verb(&bench->script, event->second ? SCRIPT_SESSION_SECOND : SCRIPT_SESSION, &command);
	if (event->forged)
		command.argument = event->command.argument;
	wire_pack_command(&frame, WIRE_ID_COMMAND, &command);
	bench_from_host(bench, &frame);
}

/* ---- a second host ---- */

static void beat_second(struct bench *bench)
{
	struct frame frame;

	if (!bench_in_span(bench, EVENT_HOST_SECOND) || bench_now_ms(bench) % SECOND_BEAT_MS != 0)
		return;
	script_heartbeat(&frame, SCRIPT_SESSION_SECOND, wire_hash());
	bench_from_host(bench, &frame);
}

/* ---- a recording that is played again ---- */

static bool is_arm(const struct frame *frame)
{
	struct wire_command command;

	return frame->id == WIRE_ID_COMMAND && wire_unpack_command(frame, &command) == 0 &&
	       command.op == WIRE_OP_ARM;
}

void bench_keep(struct bench *bench, const struct frame *frame)
{
	struct tape *tape = &bench->tape;

	if (tape->replayed || tape->count == BENCH_TAPE_FRAMES || (tape->count == 0 && !is_arm(frame)))
		return;
	tape->frame[tape->count] = *frame;
	tape->ms[tape->count++] = bench_now_ms(bench);
}

void bench_replay_start(struct bench *bench)
{
	struct tape *tape = &bench->tape;

	tape->replayed = true;
	tape->next = 0;
	tape->late_ms = tape->count > 0 ? bench_now_ms(bench) - tape->ms[0] : 0;
}

static void replay(struct bench *bench)
{
	struct tape *tape = &bench->tape;

	if (!bench_in_span(bench, EVENT_HOST_REPLAY))
		return;
	for (; tape->next < tape->count && tape->ms[tape->next] + tape->late_ms <= bench_now_ms(bench);
	     tape->next++)
		bench_from_host(bench, &tape->frame[tape->next]);
}

/* ---- commands that nobody meant ---- */

/* What a host would send, with another argument, a flipped bit of it or somebody else's name. */
static void forge_one(struct bench *bench)
{
	static const uint8_t ops[] = {WIRE_OP_ARM,    WIRE_OP_RELEASE, WIRE_OP_RELEASE,
	                              WIRE_OP_ACCEPT, WIRE_OP_DISCARD, 0x63};
	uint64_t dice = random_next(&bench->dice);
	struct wire_command command = {.op = ops[dice % sizeof(ops)], .sequence = (uint8_t)(dice >> 8)};
	struct frame frame;

	script_verb(&bench->script, dice >> 16 & 1 ? SCRIPT_SESSION : SCRIPT_SESSION_SECOND, &command);
	if (dice >> 17 & 1)
		command.argument ^= 1u << (dice >> 18 & 31);
	else
		command.argument = (uint32_t)(dice >> 32);
	if ((dice >> 23 & 3) == 0)
		command.host = (uint16_t)(dice >> 40);
	wire_pack_command(&frame, WIRE_ID_COMMAND, &command);
	bench_from_host(bench, &frame);
}

void bench_foreign(struct bench *bench)
{
	beat_second(bench);
	replay(bench);
	for (unsigned i = 0; i < FORGED_PER_MS && bench_in_span(bench, EVENT_HOST_FORGE); i++)
		forge_one(bench);
}
