/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "hil/observe.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/wire_table.h"

#define BURST_G 30
#define BURST_QUIET_S 0.010 /* apart by this, two spells are two */
#define IMPACT_SPAN_S 0.400
#define STATUS_ALONE_S 0.050 /* so long without a live block, the status message tells the state */
#define RELEASE_SPAN_US 2000 /* a latch that opens later than this was not asked to */

enum { WHOLE_SET = (1u << WIRE_PARAMETERS) - 1 };
_Static_assert(WIRE_PARAMETERS < 31, "a bit each");

static void take_note(struct observe *observe, struct observe_notes *notes, uint32_t number)
{
	if (notes->count < OBSERVE_NOTES)
		notes->note[notes->count] = (struct observe_note){number, observe->now_s};
	notes->count++;
}

static void begin_blocks(struct observe *observe)
{
	memset(observe->blocks, 0, sizeof(observe->blocks));
	for (unsigned s = 0; s < WIRE_SENSORS; s++)
		observe->blocks[s].last = -1;
}

void observe_init(struct observe *observe, const struct scene *scene, double tower_rate)
{
	memset(observe, 0, sizeof(*observe));
	observe->tower_rate = tower_rate;
	observe->planned_travel_m = scene->tower_separation_m;
	observe->state = observe->fault = UINT8_MAX;
	observe->block_s = -1;
	observe->hash = 0xCBF29CE484222325u;
	observe->truth = (struct tower_truth){NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, false, false};
	observe->release_us = observe->latch_us = observe->latch_s = observe->warning_ms = NAN;
	observe->relieve_s = observe->dropout_first_us = NAN;
	observe->event_s = observe->reaction_ms = NAN;
	hazard_init(&observe->hazard, scene->tower_dampers_m);
	begin_blocks(observe);
}

/* ---- who lost which block ---- */

/* Blocks the tower says it never sent are gaps too. */
static int64_t blocks_error(const struct observe *observe)
{
	int64_t error = observe->counter[WIRE_COUNTER_frames_dropped];

	for (unsigned s = 0; s < WIRE_SENSORS; s++) {
		const struct observe_blocks *blocks = &observe->blocks[s];

		for (int64_t tick = 0; tick < OBSERVE_TICKS; tick++)
			error += blocks->sent[tick] && tick <= blocks->last;
		for (int64_t tick = 0; tick <= blocks->last; tick++)
			error -= blocks->received[tick];
		error -= blocks->gaps;
	}
	return error;
}

static double all_gaps(const struct observe *observe)
{
	double gaps = observe->gaps_before;

	for (unsigned s = 0; s < WIRE_SENSORS; s++)
		gaps += (double)observe->blocks[s].gaps;
	return gaps;
}

static double all_blocks(const struct observe *observe)
{
	double blocks = observe->blocks_before;

	for (unsigned s = 0; s < WIRE_SENSORS; s++)
		for (unsigned tick = 0; tick < OBSERVE_TICKS; tick++)
			blocks += observe->blocks[s].sent[tick];
	return blocks;
}

void observe_reset(struct observe *observe)
{
	observe->resets++;
	observe->blocks_error += blocks_error(observe);
	observe->gaps_before = all_gaps(observe);
	observe->blocks_before = all_blocks(observe);
	begin_blocks(observe);
	memset(observe->has_counter, 0, sizeof(observe->has_counter));
	memset(observe->counter, 0, sizeof(observe->counter));
	observe->sent = observe->given = 0;
	hazard_reset(&observe->hazard);
}

static int observe_block_sensor(const struct frame *frame)
{
	if (frame->id == WIRE_ID_BLOCK_S1)
		return 0;
	return frame->id == WIRE_ID_BLOCK_S2 ? 1 : -1;
}

void observe_at_host(struct observe *observe, const struct frame *frame)
{
	int sensor = observe_block_sensor(frame);
	struct wire_block block;
	struct observe_blocks *blocks;

	if (sensor < 0 || wire_check_block(frame) != 0 || wire_unpack_block(frame, &block) != 0 ||
	    block.tick_ms >= OBSERVE_TICKS)
		return;
	blocks = &observe->blocks[sensor];
	if (blocks->received[block.tick_ms])
		return;
	blocks->received[block.tick_ms] = 1;
	if ((int64_t)block.tick_ms > blocks->last) {
		blocks->gaps += (int64_t)block.tick_ms - blocks->last - 1;
		blocks->last = block.tick_ms;
	} else {
		blocks->gaps--; /* late, not lost */
	}
}

/* ---- what the firmware says ---- */

void observe_event(struct observe *observe, double now_s)
{
	observe->event_s = now_s;
	observe->reaction_ms = NAN;
}

/* A state that answers what went wrong: a fault, keep out, or disarmed. */
static bool answers(uint8_t before, uint8_t state)
{
	return state == WIRE_STATE_FAULT_HELD || state == WIRE_STATE_FAULT_MOVING ||
	       state == WIRE_STATE_KEEP_OUT ||
	       (state == WIRE_STATE_SAFE && (before == WIRE_STATE_READY || before == WIRE_STATE_ARMED));
}

static void observe_note_state(struct observe *observe, uint8_t state, double tower_s)
{
	hazard_state(&observe->hazard, state, &observe->truth, tower_s);
	if (state == observe->state)
		return;
	if (isnan(observe->reaction_ms) && answers(observe->state, state))
		observe->reaction_ms = 1e3 * (observe->now_s - observe->event_s);
	observe->state = state;
	take_note(observe, &observe->path, state);
}

static void see_block(struct observe *observe, unsigned sensor, const struct frame *frame, double tick_s)
{
	struct wire_block block;

	if (wire_check_block(frame) != 0 || wire_unpack_block(frame, &block) != 0)
		return;
	if (block.tick_ms < OBSERVE_TICKS)
		observe->blocks[sensor].sent[block.tick_ms] = 1;
	observe->block_s = observe->now_s;
	/* a block that has waited says what was */
	observe_note_state(observe, block.status & WIRE_STATUS_STATE,
	                   tick_s + 1e-3 * block.tick_ms * observe->tower_rate);
	if (sensor == 0)
		hazard_block(&observe->hazard, block.status & WIRE_STATUS_STATE, block.io);
}

static void see_status(struct observe *observe, const struct frame *frame, double tower_s)
{
	struct wire_status status;

	if (wire_unpack_status(frame, &status) != 0)
		return;
	observe->fault = status.fault;
	observe->was_ready |= status.state == WIRE_STATE_READY;
	if (observe->was_ready)
		observe->checks |= status.checks;
	if (observe->block_s < 0 || observe->now_s - observe->block_s > STATUS_ALONE_S)
		observe_note_state(observe, status.state, tower_s);
}

static void see_emcy(struct observe *observe, const struct frame *frame)
{
	struct wire_emcy emcy;

	if (wire_unpack_emcy(frame, &emcy) != 0)
		return;
	take_note(observe, &observe->emcy, emcy.fault);
	observe->emcy_is_wrong |= emcy.code != wire_fault_emcy(emcy.fault);
}

static void see_reply(struct observe *observe, const struct frame *frame)
{
	struct wire_reply reply;

	if (wire_unpack_reply(frame, &reply) != 0)
		return;
	take_note(observe, &observe->replies, reply.state);
	if (reply.op == WIRE_OP_CLEAR && reply.result == 0)
		hazard_acknowledged(&observe->hazard);
	if (reply.result != 0)
		take_note(observe, &observe->refused, (uint32_t)(int32_t)reply.result);
}

static void see_sdo(struct observe *observe, const struct frame *frame)
{
	struct wire_sdo sdo;

	if (wire_unpack_sdo(frame, &sdo) == 0 && sdo.specifier == 0x80)
		take_note(observe, &observe->aborts, sdo.value);
}

static void keep_worst(int64_t *worst, int64_t error)
{
	if (llabs(error) > llabs(*worst))
		*worst = error;
}

/* Both ends count to the same frame, but for those that waited in the firmware's queue before this one: so
 * many more have come than it says. */
static void see_counter(struct observe *observe, const struct frame *frame)
{
	struct wire_counter counter;

	if (wire_unpack_counter(frame, &counter) != 0 || counter.index >= WIRE_COUNTERS)
		return;
	observe->counter[counter.index] = counter.value;
	observe->has_counter[counter.index] = true;
	if (counter.index == WIRE_COUNTER_frames_sent)
		keep_worst(&observe->sent_error, (int64_t)counter.value - (int64_t)observe->sent);
	if (counter.index == WIRE_COUNTER_frames_received)
		keep_worst(&observe->given_error, (int64_t)counter.value - (int64_t)observe->given);
}

static void see_capture_end(struct observe *observe, const struct frame *frame, double tick_s)
{
	struct wire_capture_end end;

	observe->tail_bad += wire_check_capture_end(frame) != 0;
	if (wire_unpack_capture_end(frame, &end) != 0)
		return;
	if (observe->captures == 0 || end.drop_id != observe->capture.drop_id ||
	    end.first_tick_ms != observe->capture.first_tick_ms || end.crc32 != observe->capture.crc32) {
		observe->captures++;
		observe->tail = (struct observe_tail){.has_value = 0};
	}
	observe->capture = end;
	observe->capture_first_s = tick_s + 1e-3 * end.first_tick_ms * observe->tower_rate;
}

/* ---- what a drop has measured of its tower ---- */

static void keep_largest(double *worst, double error)
{
	if (fabs(error) > *worst)
		*worst = fabs(error);
}

static void judge_measured(struct observe *observe, const struct wire_measured *measured)
{
	const struct tower_truth *truth = &observe->truth;

	if (measured->separation_um != UINT32_MAX) {
		observe->separated++;
		keep_largest(&observe->separation_error_um,
		             measured->separation_um - 1e6 * truth->separation_travel_m);
	}
	if (measured->dropout_us != UINT16_MAX) {
		keep_largest(&observe->dropout_error_us,
		             measured->dropout_us - 1e6 * (truth->separation_s - truth->magnet_off_s));
		if (isnan(observe->dropout_first_us))
			observe->dropout_first_us = measured->dropout_us;
	}
	if (measured->latch_delay_us != UINT16_MAX)
		keep_largest(&observe->latch_delay_error_us,
		             measured->latch_delay_us - 1e6 * (truth->latch_open_s - observe->latch_s));
}

static void end_tail(struct observe *observe)
{
	const struct observe_tail *tail = &observe->tail;

	if (!tail->has_measured || tail->has_value != WHOLE_SET)
		return;
	if (wire_parameters_crc32(tail->value) == observe->capture.parameters_crc32)
		observe->tails++;
	else
		observe->tail_bad++;
}

static void see_measured(struct observe *observe, const struct frame *frame)
{
	struct observe_tail *tail = &observe->tail;
	struct wire_measured measured;

	observe->tail_bad += wire_check_measured(frame) != 0;
	if (wire_unpack_measured(frame, &measured) != 0 || tail->has_measured)
		return;
	observe->tail_bad += measured.drop_id != observe->capture.drop_id;
	tail->measured = measured;
	tail->has_measured = true;
	judge_measured(observe, &measured);
	end_tail(observe);
}

static void see_parameter(struct observe *observe, const struct frame *frame)
{
	struct observe_tail *tail = &observe->tail;
	struct wire_parameter parameter;
	unsigned i = 0;

	if (wire_unpack_parameter(frame, &parameter) != 0)
		return;
	while (i < WIRE_PARAMETERS && wire_parameters[i].index != parameter.index)
		i++;
	observe->tail_bad += i == WIRE_PARAMETERS || parameter.drop_id != observe->capture.drop_id;
	if (i == WIRE_PARAMETERS || tail->has_value >> i & 1)
		return;
	tail->value[i] = parameter.value;
	tail->has_value |= 1u << i;
	end_tail(observe);
}

static void add_hash(struct observe *observe, const void *bytes, size_t count)
{
	const uint8_t *p = bytes;

	for (size_t i = 0; i < count; i++)
		observe->hash = (observe->hash ^ p[i]) * 0x100000001B3u;
}

static void see_message(struct observe *observe, const struct frame *frame, double tick_s, double tower_s)
{
	int sensor = observe_block_sensor(frame);

	if (sensor >= 0)
		see_block(observe, (unsigned)sensor, frame, tick_s);
	else if (frame->id == WIRE_ID_STATUS)
		see_status(observe, frame, tower_s);
	else if (frame->id == WIRE_ID_EMCY)
		see_emcy(observe, frame);
	else if (frame->id == WIRE_ID_REPLY)
		see_reply(observe, frame);
	else if (frame->id == WIRE_ID_SDO_REPLY)
		see_sdo(observe, frame);
	else if (frame->id == WIRE_ID_COUNTER)
		see_counter(observe, frame);
	else if (frame->id == WIRE_ID_CAPTURE_END)
		see_capture_end(observe, frame, tick_s);
	else if (frame->id == WIRE_ID_MEASURED)
		see_measured(observe, frame);
	else if (frame->id == WIRE_ID_PARAMETER)
		see_parameter(observe, frame);
}

void observe_from_firmware(struct observe *observe, const struct frame *frame, double tick_s, double tower_s)
{
	const struct frame *message = segment_feed(&observe->segments, frame);
	uint32_t head[3] = {(uint32_t)lrint(observe->now_s * 1e6), frame->id,
	                    (uint32_t)frame->flags << 8 | frame->length};

	add_hash(observe, head, sizeof(head));
	add_hash(observe, frame->data, frame->length);
	if (message != NULL)
		see_message(observe, message, tick_s, tower_s);
	observe->sent++;
}

void observe_to_firmware(struct observe *observe, const struct frame *frame, double now_us)
{
	struct wire_command command;

	observe->given++;
	if (frame->id == WIRE_ID_COMMAND && wire_unpack_command(frame, &command) == 0 &&
	    command.op == WIRE_OP_RELEASE)
		observe->release_us = now_us;
}

/* ---- what the outputs did, what the tower did ---- */

void observe_edge(struct observe *observe, unsigned bit, bool on, double edge_us, double tower_s)
{
	uint16_t mask = (uint16_t)(1u << bit);
	bool asked = edge_us - observe->release_us <= RELEASE_SPAN_US; /* false for NAN */

	if (mask == WIRE_IO_DAMPERS_RELIEVE && !on && isnan(observe->relieve_s))
		observe->relieve_s = tower_s;
	if (mask == WIRE_IO_LATCH_OPEN && on) {
		observe->latch_us = edge_us - observe->release_us;
		observe->latch_s = tower_s;
		observe->warning_ms = 1e3 * (tower_s - observe->hazard.warning_s);
		observe->relieve_s = NAN;
	}
	hazard_edge(&observe->hazard, mask, on, asked, tower_s);
}

static void see_truth(struct observe *observe, const struct tower_truth *truth)
{
	observe->truth.frame_away = truth->frame_away;
	observe->truth.frame_moving = truth->frame_moving;
	if (isnan(truth->latch_open_s) && isnan(truth->separation_s))
		return;
	if (isfinite(truth->impact_s) && truth->impact_s != observe->truth.impact_s) {
		observe->impacts++;
		observe->peak_x = 0;
		observe->bursts = 0;
		observe->burst_end_s = -1;
	}
	observe->truth = *truth;
}

static void see_codes(struct observe *observe, unsigned group, const int16_t codes[6], double tower_s)
{
	int x = group & SENSORBUS_X ? abs(codes[3]) : 0, y = group & SENSORBUS_YZ ? abs(codes[4]) : 0;

	if (!(tower_s - observe->truth.impact_s <= IMPACT_SPAN_S)) /* NAN fails too */
		return;
	if (x > observe->peak_x)
		observe->peak_x = x;
	if (x <= BURST_G * WIRE_COUNTS_PER_G && y <= BURST_G * WIRE_COUNTS_PER_G)
		return;
	observe->bursts += observe->burst_end_s < 0 || tower_s - observe->burst_end_s > BURST_QUIET_S;
	observe->burst_end_s = tower_s;
}

void observe_sample(struct observe *observe, unsigned group, const struct sensorbus_answer *answer,
                    const struct tower_truth *truth, double tower_s)
{
	hazard_sample(&observe->hazard, answer->inputs, answer->captures, truth, tower_s);
	see_truth(observe, truth);
	see_codes(observe, group, answer->codes, tower_s);
}

/* ---- the numbers ---- */

static void capture_results(const struct observe *observe, double results[SCENARIO_RESULTS])
{
	const struct wire_capture_end *capture = &observe->capture;

	if (observe->captures == 0)
		return;
	results[SCENARIO_frame_mm_s] = capture->frame_speed_mm_s;
	results[SCENARIO_window_ms] = (double)capture->last_tick_ms - capture->first_tick_ms + 1;
	results[SCENARIO_trigger_us] =
	        1e6 * (observe->capture_first_s - observe->truth.impact_s) + capture->trigger_us;
}

static void tail_results(const struct observe *observe, double results[SCENARIO_RESULTS])
{
	const struct wire_measured *measured = &observe->tail.measured;
	bool dropped = observe->tail.has_measured && measured->dropout_us != UINT16_MAX;

	results[SCENARIO_tail_errors] = observe->tail_bad + (double)observe->captures - observe->tails;
	results[SCENARIO_measured] = observe->separated;
	results[SCENARIO_separation_error_um] = observe->separation_error_um;
	results[SCENARIO_dropout_error_us] = observe->dropout_error_us;
	results[SCENARIO_latch_delay_error_us] = observe->latch_delay_error_us;
	if (dropped) {
		results[SCENARIO_dropout_us] = measured->dropout_us;
		results[SCENARIO_dropout_trend_us] = measured->dropout_us - observe->dropout_first_us;
	}
	if (observe->tail.has_measured) {
		results[SCENARIO_dropout_used_us] = measured->dropout_used_us;
		results[SCENARIO_acceleration_mm_s2] = measured->acceleration_mm_s2;
	}
}

void observe_results(const struct observe *observe, double results[SCENARIO_RESULTS])
{
	const struct tower_truth *truth = &observe->truth;

	results[SCENARIO_captures] = observe->captures;
	results[SCENARIO_impacts] = observe->impacts;
	results[SCENARIO_resets] = observe->resets;
	results[SCENARIO_gaps] = all_gaps(observe);
	results[SCENARIO_gaps_permille] = 1e3 * all_gaps(observe) / all_blocks(observe);
	results[SCENARIO_separation_mm] = 1e3 * truth->separation_travel_m;
	results[SCENARIO_impact_m_s] = truth->impact_speed_m_s;
	results[SCENARIO_impact_deg] = truth->angle_deg;
	results[SCENARIO_latch_edge_us] = observe->latch_us;
	results[SCENARIO_magnet_edge_us] = 1e6 * (truth->separation_travel_m - observe->planned_travel_m) /
	                                   truth->frame_speed_at_separation_m_s;
	results[SCENARIO_damper_edge_us] = 1e6 * (observe->relieve_s - truth->frame_down_s);
	capture_results(observe, results);
	results[SCENARIO_s2x_peak_g] = observe->impacts ? (double)observe->peak_x / WIRE_COUNTS_PER_G : NAN;
	results[SCENARIO_s2_bursts] = observe->impacts ? (double)observe->bursts : NAN;
	results[SCENARIO_warning_ms] = observe->warning_ms;
	tail_results(observe, results);
	results[SCENARIO_reaction_ms] = observe->reaction_ms;
	results[SCENARIO_unbraked] = observe->hazard.unbraked;
	results[SCENARIO_unsafe] = hazard_count(&observe->hazard) + observe->emcy_is_wrong;
	results[SCENARIO_ledger_sent] = (double)observe->sent_error;
	results[SCENARIO_ledger_received] = (double)observe->given_error;
	results[SCENARIO_ledger_blocks] = (double)(observe->blocks_error + blocks_error(observe));
}
