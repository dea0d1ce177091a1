/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "hil/monitor.h"

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

static void take_note(struct monitor *monitor, struct monitor_notes *notes, uint32_t number)
{
	if (notes->count < MONITOR_NOTES)
		notes->note[notes->count] = (struct monitor_note){number, monitor->now_s};
	notes->count++;
}

static void begin_blocks(struct monitor *monitor)
{
	memset(monitor->blocks, 0, sizeof(monitor->blocks));
	for (unsigned s = 0; s < WIRE_SENSORS; s++)
		monitor->blocks[s].last = -1;
}

void monitor_init(struct monitor *monitor, const struct scene *scene, double tower_rate)
{
	memset(monitor, 0, sizeof(*monitor));
	monitor->tower_rate = tower_rate;
	monitor->planned_travel_m = scene->tower_separation_m;
	monitor->state = monitor->fault = UINT8_MAX;
	monitor->block_s = -1;
	monitor->hash = 0xCBF29CE484222325u;
	monitor->truth = (struct tower_truth){NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, false, false};
	monitor->release_us = monitor->latch_us = monitor->latch_s = monitor->warning_ms = NAN;
	monitor->relieve_s = monitor->dropout_first_us = NAN;
	monitor->event_s = monitor->reaction_ms = NAN;
	hazard_init(&monitor->hazard, scene->tower_dampers_m);
	begin_blocks(monitor);
}

/* ---- who lost which block ---- */

/* Blocks the tower says it never sent are gaps too. */
static int64_t blocks_error(const struct monitor *monitor)
{
	int64_t error = monitor->counter[WIRE_COUNTER_frames_dropped];

	for (unsigned s = 0; s < WIRE_SENSORS; s++) {
		const struct monitor_blocks *blocks = &monitor->blocks[s];

		for (int64_t tick = 0; tick < MONITOR_TICKS; tick++)
			error += blocks->sent[tick] && tick <= blocks->last;
		for (int64_t tick = 0; tick <= blocks->last; tick++)
			error -= blocks->received[tick];
		error -= blocks->gaps;
	}
	return error;
}

static double all_gaps(const struct monitor *monitor)
{
	double gaps = monitor->gaps_before;

	for (unsigned s = 0; s < WIRE_SENSORS; s++)
		gaps += (double)monitor->blocks[s].gaps;
	return gaps;
}

static double all_blocks(const struct monitor *monitor)
{
	double blocks = monitor->blocks_before;

	for (unsigned s = 0; s < WIRE_SENSORS; s++)
		for (unsigned tick = 0; tick < MONITOR_TICKS; tick++)
			blocks += monitor->blocks[s].sent[tick];
	return blocks;
}

void monitor_reset(struct monitor *monitor)
{
	monitor->resets++;
	monitor->blocks_error += blocks_error(monitor);
	monitor->gaps_before = all_gaps(monitor);
	monitor->blocks_before = all_blocks(monitor);
	begin_blocks(monitor);
	memset(monitor->has_counter, 0, sizeof(monitor->has_counter));
	memset(monitor->counter, 0, sizeof(monitor->counter));
	monitor->sent = monitor->given = 0;
	hazard_reset(&monitor->hazard);
}

static int monitor_block_sensor(const struct frame *frame)
{
	if (frame->id == WIRE_ID_BLOCK_S1)
		return 0;
	return frame->id == WIRE_ID_BLOCK_S2 ? 1 : -1;
}

void monitor_at_host(struct monitor *monitor, const struct frame *frame)
{
	int sensor = monitor_block_sensor(frame);
	struct wire_block block;
	struct monitor_blocks *blocks;

	if (sensor < 0 || wire_check_block(frame) != 0 || wire_unpack_block(frame, &block) != 0 ||
	    block.tick_ms >= MONITOR_TICKS)
		return;
	blocks = &monitor->blocks[sensor];
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

void monitor_event(struct monitor *monitor, double now_s)
{
	monitor->event_s = now_s;
	monitor->reaction_ms = NAN;
}

/* A state that answers what went wrong: a fault, keep out, or disarmed. */
static bool answers(uint8_t before, uint8_t state)
{
	return state == WIRE_STATE_FAULT_HELD || state == WIRE_STATE_FAULT_MOVING ||
	       state == WIRE_STATE_KEEP_OUT ||
	       (state == WIRE_STATE_SAFE && (before == WIRE_STATE_READY || before == WIRE_STATE_ARMED));
}

static void monitor_note_state(struct monitor *monitor, uint8_t state, double tower_s)
{
	hazard_state(&monitor->hazard, state, &monitor->truth, tower_s);
	if (state == monitor->state)
		return;
	if (isnan(monitor->reaction_ms) && answers(monitor->state, state))
		monitor->reaction_ms = 1e3 * (monitor->now_s - monitor->event_s);
	monitor->state = state;
	take_note(monitor, &monitor->path, state);
}

static void see_block(struct monitor *monitor, unsigned sensor, const struct frame *frame, double tick_s)
{
	struct wire_block block;

	if (wire_check_block(frame) != 0 || wire_unpack_block(frame, &block) != 0)
		return;
	if (block.tick_ms < MONITOR_TICKS)
		monitor->blocks[sensor].sent[block.tick_ms] = 1;
	monitor->block_s = monitor->now_s;
	/* a block that has waited says what was */
	monitor_note_state(monitor, block.status & WIRE_STATUS_STATE,
	                   tick_s + 1e-3 * block.tick_ms * monitor->tower_rate);
	if (sensor == 0)
		hazard_block(&monitor->hazard, block.status & WIRE_STATUS_STATE, block.io);
}

static void see_status(struct monitor *monitor, const struct frame *frame, double tower_s)
{
	struct wire_status status;

	if (wire_unpack_status(frame, &status) != 0)
		return;
	monitor->fault = status.fault;
	monitor->was_ready |= status.state == WIRE_STATE_READY;
	if (monitor->was_ready)
		monitor->checks |= status.checks;
	if (monitor->block_s < 0 || monitor->now_s - monitor->block_s > STATUS_ALONE_S)
		monitor_note_state(monitor, status.state, tower_s);
}

static void see_emcy(struct monitor *monitor, const struct frame *frame)
{
	struct wire_emcy emcy;

	if (wire_unpack_emcy(frame, &emcy) != 0)
		return;
	take_note(monitor, &monitor->emcy, emcy.fault);
	monitor->emcy_is_wrong |= emcy.code != wire_fault_emcy(emcy.fault);
}

static void see_reply(struct monitor *monitor, const struct frame *frame)
{
	struct wire_reply reply;

	if (wire_unpack_reply(frame, &reply) != 0)
		return;
	take_note(monitor, &monitor->replies, reply.state);
	if (reply.op == WIRE_OP_CLEAR && reply.result == 0)
		hazard_acknowledged(&monitor->hazard);
	if (reply.result != 0)
		take_note(monitor, &monitor->refused, (uint32_t)(int32_t)reply.result);
}

static void see_sdo(struct monitor *monitor, const struct frame *frame)
{
	struct wire_sdo sdo;

	if (wire_unpack_sdo(frame, &sdo) == 0 && sdo.specifier == 0x80)
		take_note(monitor, &monitor->aborts, sdo.value);
}

static void keep_worst(int64_t *worst, int64_t error)
{
	if (llabs(error) > llabs(*worst))
		*worst = error;
}

/* Both ends count to the same frame, but for those that waited in the firmware's queue before this one: so
 * many more have come than it says. */
static void see_counter(struct monitor *monitor, const struct frame *frame)
{
	struct wire_counter counter;

	if (wire_unpack_counter(frame, &counter) != 0 || counter.index >= WIRE_COUNTERS)
		return;
	monitor->counter[counter.index] = counter.value;
	monitor->has_counter[counter.index] = true;
	if (counter.index == WIRE_COUNTER_frames_sent)
		keep_worst(&monitor->sent_error, (int64_t)counter.value - (int64_t)monitor->sent);
	if (counter.index == WIRE_COUNTER_frames_received)
		keep_worst(&monitor->given_error, (int64_t)counter.value - (int64_t)monitor->given);
}

static void see_capture_end(struct monitor *monitor, const struct frame *frame, double tick_s)
{
	struct wire_capture_end end;

	monitor->tail_bad += wire_check_capture_end(frame) != 0;
	if (wire_unpack_capture_end(frame, &end) != 0)
		return;
	if (monitor->captures == 0 || end.drop_id != monitor->capture.drop_id ||
	    end.first_tick_ms != monitor->capture.first_tick_ms || end.crc32 != monitor->capture.crc32) {
		monitor->captures++;
		monitor->tail = (struct monitor_tail){.has_value = 0};
	}
	monitor->capture = end;
	monitor->capture_first_s = tick_s + 1e-3 * end.first_tick_ms * monitor->tower_rate;
}

/* ---- what a drop has measured of its tower ---- */

static void keep_largest(double *worst, double error)
{
	if (fabs(error) > *worst)
		*worst = fabs(error);
}

static void judge_measured(struct monitor *monitor, const struct wire_measured *measured)
{
	const struct tower_truth *truth = &monitor->truth;

	if (measured->separation_um != UINT32_MAX) {
		monitor->separated++;
		keep_largest(&monitor->separation_error_um,
		             measured->separation_um - 1e6 * truth->separation_travel_m);
	}
	if (measured->dropout_us != UINT16_MAX) {
		keep_largest(&monitor->dropout_error_us,
		             measured->dropout_us - 1e6 * (truth->separation_s - truth->magnet_off_s));
		if (isnan(monitor->dropout_first_us))
			monitor->dropout_first_us = measured->dropout_us;
	}
	if (measured->latch_delay_us != UINT16_MAX)
		keep_largest(&monitor->latch_delay_error_us,
		             measured->latch_delay_us - 1e6 * (truth->latch_open_s - monitor->latch_s));
}

static void end_tail(struct monitor *monitor)
{
	const struct monitor_tail *tail = &monitor->tail;

	if (!tail->has_measured || tail->has_value != WHOLE_SET)
		return;
	if (wire_parameters_crc32(tail->value) == monitor->capture.parameters_crc32)
		monitor->tails++;
	else
		monitor->tail_bad++;
}

static void see_measured(struct monitor *monitor, const struct frame *frame)
{
	struct monitor_tail *tail = &monitor->tail;
	struct wire_measured measured;

	monitor->tail_bad += wire_check_measured(frame) != 0;
	if (wire_unpack_measured(frame, &measured) != 0 || tail->has_measured)
		return;
	monitor->tail_bad += measured.drop_id != monitor->capture.drop_id;
	tail->measured = measured;
	tail->has_measured = true;
	judge_measured(monitor, &measured);
	end_tail(monitor);
}

static void see_parameter(struct monitor *monitor, const struct frame *frame)
{
	struct monitor_tail *tail = &monitor->tail;
	struct wire_parameter parameter;
	unsigned i = 0;

	if (wire_unpack_parameter(frame, &parameter) != 0)
		return;
	while (i < WIRE_PARAMETERS && wire_parameters[i].index != parameter.index)
		i++;
	monitor->tail_bad += i == WIRE_PARAMETERS || parameter.drop_id != monitor->capture.drop_id;
	if (i == WIRE_PARAMETERS || tail->has_value >> i & 1)
		return;
	tail->value[i] = parameter.value;
	tail->has_value |= 1u << i;
	end_tail(monitor);
}

static void add_hash(struct monitor *monitor, const void *bytes, size_t count)
{
	const uint8_t *p = bytes;

	for (size_t i = 0; i < count; i++)
		monitor->hash = (monitor->hash ^ p[i]) * 0x100000001B3u;
}

static void see_message(struct monitor *monitor, const struct frame *frame, double tick_s, double tower_s)
{
	int sensor = monitor_block_sensor(frame);

	if (sensor >= 0)
		see_block(monitor, (unsigned)sensor, frame, tick_s);
	else if (frame->id == WIRE_ID_STATUS)
		see_status(monitor, frame, tower_s);
	else if (frame->id == WIRE_ID_EMCY)
		see_emcy(monitor, frame);
	else if (frame->id == WIRE_ID_REPLY)
		see_reply(monitor, frame);
	else if (frame->id == WIRE_ID_SDO_REPLY)
		see_sdo(monitor, frame);
	else if (frame->id == WIRE_ID_COUNTER)
		see_counter(monitor, frame);
	else if (frame->id == WIRE_ID_CAPTURE_END)
		see_capture_end(monitor, frame, tick_s);
	else if (frame->id == WIRE_ID_MEASURED)
		see_measured(monitor, frame);
	else if (frame->id == WIRE_ID_PARAMETER)
		see_parameter(monitor, frame);
}

void monitor_from_firmware(struct monitor *monitor, const struct frame *frame, double tick_s, double tower_s)
{
	const struct frame *message = segment_feed(&monitor->segments, frame);
	uint32_t head[3] = {(uint32_t)lrint(monitor->now_s * 1e6), frame->id,
	                    (uint32_t)frame->flags << 8 | frame->length};

	add_hash(monitor, head, sizeof(head));
	add_hash(monitor, frame->data, frame->length);
	if (message != NULL)
		see_message(monitor, message, tick_s, tower_s);
	monitor->sent++;
}

void monitor_to_firmware(struct monitor *monitor, const struct frame *frame, double now_us)
{
	struct wire_command command;

	monitor->given++;
	if (frame->id == WIRE_ID_COMMAND && wire_unpack_command(frame, &command) == 0 &&
	    command.op == WIRE_OP_RELEASE)
		monitor->release_us = now_us;
}

/* ---- what the outputs did, what the tower did ---- */

void monitor_edge(struct monitor *monitor, unsigned bit, bool on, double edge_us, double tower_s)
{
	uint16_t mask = (uint16_t)(1u << bit);
	bool asked = edge_us - monitor->release_us <= RELEASE_SPAN_US; /* false for NAN */

	if (mask == WIRE_IO_DAMPERS_RELIEVE && !on && isnan(monitor->relieve_s))
		monitor->relieve_s = tower_s;
	if (mask == WIRE_IO_LATCH_OPEN && on) {
		monitor->latch_us = edge_us - monitor->release_us;
		monitor->latch_s = tower_s;
		monitor->warning_ms = 1e3 * (tower_s - monitor->hazard.warning_s);
		monitor->relieve_s = NAN;
	}
	hazard_edge(&monitor->hazard, mask, on, asked, tower_s);
}

static void see_truth(struct monitor *monitor, const struct tower_truth *truth)
{
	monitor->truth.frame_away = truth->frame_away;
	monitor->truth.frame_moving = truth->frame_moving;
	if (isnan(truth->latch_open_s) && isnan(truth->separation_s))
		return;
	if (isfinite(truth->impact_s) && truth->impact_s != monitor->truth.impact_s) {
		monitor->impacts++;
		monitor->peak_x = 0;
		monitor->bursts = 0;
		monitor->burst_end_s = -1;
	}
	monitor->truth = *truth;
}

static void see_codes(struct monitor *monitor, unsigned group, const int16_t codes[6], double tower_s)
{
	int x = group & SENSORBUS_X ? abs(codes[3]) : 0, y = group & SENSORBUS_YZ ? abs(codes[4]) : 0;

	if (!(tower_s - monitor->truth.impact_s <= IMPACT_SPAN_S)) /* NAN fails too */
		return;
	if (x > monitor->peak_x)
		monitor->peak_x = x;
	if (x <= BURST_G * WIRE_COUNTS_PER_G && y <= BURST_G * WIRE_COUNTS_PER_G)
		return;
	monitor->bursts += monitor->burst_end_s < 0 || tower_s - monitor->burst_end_s > BURST_QUIET_S;
	monitor->burst_end_s = tower_s;
}

void monitor_sample(struct monitor *monitor, unsigned group, const struct sensorbus_answer *answer,
                    const struct tower_truth *truth, double tower_s)
{
	hazard_sample(&monitor->hazard, answer->inputs, answer->captures, truth, tower_s);
	see_truth(monitor, truth);
	see_codes(monitor, group, answer->codes, tower_s);
}

/* ---- the numbers ---- */

static void capture_results(const struct monitor *monitor, double results[SCENARIO_RESULTS])
{
	const struct wire_capture_end *capture = &monitor->capture;

	if (monitor->captures == 0)
		return;
	results[SCENARIO_frame_mm_s] = capture->frame_speed_mm_s;
	results[SCENARIO_window_ms] = (double)capture->last_tick_ms - capture->first_tick_ms + 1;
	results[SCENARIO_trigger_us] =
	        1e6 * (monitor->capture_first_s - monitor->truth.impact_s) + capture->trigger_us;
}

static void tail_results(const struct monitor *monitor, double results[SCENARIO_RESULTS])
{
	const struct wire_measured *measured = &monitor->tail.measured;
	bool dropped = monitor->tail.has_measured && measured->dropout_us != UINT16_MAX;

	results[SCENARIO_tail_errors] = monitor->tail_bad + (double)monitor->captures - monitor->tails;
	results[SCENARIO_measured] = monitor->separated;
	results[SCENARIO_separation_error_um] = monitor->separation_error_um;
	results[SCENARIO_dropout_error_us] = monitor->dropout_error_us;
	results[SCENARIO_latch_delay_error_us] = monitor->latch_delay_error_us;
	if (dropped) {
		results[SCENARIO_dropout_us] = measured->dropout_us;
		results[SCENARIO_dropout_trend_us] = measured->dropout_us - monitor->dropout_first_us;
	}
	if (monitor->tail.has_measured) {
		results[SCENARIO_dropout_used_us] = measured->dropout_used_us;
		results[SCENARIO_acceleration_mm_s2] = measured->acceleration_mm_s2;
	}
}

void monitor_results(const struct monitor *monitor, double results[SCENARIO_RESULTS])
{
	const struct tower_truth *truth = &monitor->truth;

	results[SCENARIO_captures] = monitor->captures;
	results[SCENARIO_impacts] = monitor->impacts;
	results[SCENARIO_resets] = monitor->resets;
	results[SCENARIO_gaps] = all_gaps(monitor);
	results[SCENARIO_gaps_permille] = 1e3 * all_gaps(monitor) / all_blocks(monitor);
	results[SCENARIO_separation_mm] = 1e3 * truth->separation_travel_m;
	results[SCENARIO_impact_m_s] = truth->impact_speed_m_s;
	results[SCENARIO_impact_deg] = truth->angle_deg;
	results[SCENARIO_latch_edge_us] = monitor->latch_us;
	results[SCENARIO_magnet_edge_us] = 1e6 * (truth->separation_travel_m - monitor->planned_travel_m) /
	                                   truth->frame_speed_at_separation_m_s;
	results[SCENARIO_damper_edge_us] = 1e6 * (monitor->relieve_s - truth->frame_down_s);
	capture_results(monitor, results);
	results[SCENARIO_s2x_peak_g] = monitor->impacts ? (double)monitor->peak_x / WIRE_COUNTS_PER_G : NAN;
	results[SCENARIO_s2_bursts] = monitor->impacts ? (double)monitor->bursts : NAN;
	results[SCENARIO_warning_ms] = monitor->warning_ms;
	tail_results(monitor, results);
	results[SCENARIO_reaction_ms] = monitor->reaction_ms;
	results[SCENARIO_unbraked] = monitor->hazard.unbraked;
	results[SCENARIO_unsafe] = hazard_count(&monitor->hazard) + monitor->emcy_is_wrong;
	results[SCENARIO_ledger_sent] = (double)monitor->sent_error;
	results[SCENARIO_ledger_received] = (double)monitor->given_error;
	results[SCENARIO_ledger_blocks] = (double)(monitor->blocks_error + blocks_error(monitor));
}
