/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/join.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/assert.h"
#include "common/crc.h"
#include "common/segment.h"
#include "common/wire.h"
#include "common/wire_table.h"
#include "host/record/drop.h"
#include "host/record/told.h"

enum { RING_TICKS = DROP_TICKS_MAX }; /* a power of two, as ticks wrap */
_Static_assert((RING_TICKS & (RING_TICKS - 1)) == 0, "ticks wrap");

struct slot {
	uint32_t tick_ms; /* in the ring; in the window the place tells */
	uint16_t repeated, conflicting, reordered, resent;
	bool held;
	uint8_t data[WIRE_LENGTH_block];
};

struct join {
	/* what came last, by tick modulo RING_TICKS */
	struct slot ring[WIRE_SENSORS][RING_TICKS];
	bool any;
	uint32_t newest_ms;
	bool any_live[WIRE_SENSORS];
	uint32_t newest_live_ms[WIRE_SENSORS];
	uint64_t corrupt;
	struct segment_join segments; /* of classic CAN */
	struct told told;

	/* the capture, by tick after the first */
	struct wire_capture_end end;
	bool end_seen; /* in this run of the tower; a repetition is no news */
	bool has_capture;
	bool settling; /* live blocks may still belong to the capture */
	bool crc_agrees;
	struct slot window[WIRE_SENSORS][DROP_TICKS_MAX];
	uint32_t ticks;
	uint32_t missing; /* blocks */
	uint64_t gaps;

	uint64_t restarts, touched;
	void (*lost)(void *context, enum join_loss what);
	void *context;
};

struct join *join_create(void)
{
	return calloc(1, sizeof(struct join));
}

void join_destroy(struct join *join)
{
	free(join);
}

void join_on_loss(struct join *join, void (*lost)(void *context, enum join_loss what), void *context)
{
	join->lost = lost;
	join->context = context;
}

static void tell_loss(struct join *join, enum join_loss what)
{
	if (join->lost != NULL)
		join->lost(join->context, what);
}

void join_forget_run(struct join *join)
{
	if (join->any) /* else it is empty */
		memset(join->ring, 0, sizeof(join->ring));
	join->any = false;
	join->any_live[0] = join->any_live[1] = false;
	join->end_seen = false;
	join->settling = false;
}

static void restart(struct join *join)
{
	tell_loss(join, JOIN_LOSS_RUN);
	join_forget_run(join);
	join->restarts++;
}

uint32_t join_crc32(const struct join *join)
{
	uint32_t crc = CRC32_INIT;

	for (uint32_t tick = 0; tick < join->ticks; tick++)
		for (unsigned s = 0; s < WIRE_SENSORS; s++)
			crc = crc32(crc, join->window[s][tick].data + WIRE_SAMPLE_OFFSET, WIRE_SAMPLE_BYTES);
	return crc;
}

static void check_crc(struct join *join)
{
	join->crc_agrees = join->missing == 0 && join_crc32(join) == join->end.crc32;
}

/* Puts a block in its slot; true if it was missing there. */
static bool put(struct slot *slot, const struct frame *frame, bool resent, bool reordered)
{
	bool is_new = !slot->held;

	if (is_new) {
		memcpy(slot->data, frame->data, WIRE_LENGTH_block);
		slot->held = true;
	} else {
		slot->repeated++;
		if (memcmp(slot->data + WIRE_SAMPLE_OFFSET, frame->data + WIRE_SAMPLE_OFFSET,
		           WIRE_SAMPLE_BYTES))
			slot->conflicting++;
	}
	slot->resent = (uint16_t)(slot->resent + resent);
	slot->reordered = (uint16_t)(slot->reordered + reordered);
	return is_new;
}

static void put_in_ring(struct join *join, unsigned s, uint32_t tick_ms, const struct frame *frame,
                        bool resent, bool reordered)
{
	struct slot *slot = &join->ring[s][tick_ms % RING_TICKS];

	if (!join->any || (int32_t)(tick_ms - join->newest_ms) > 0)
		join->newest_ms = tick_ms;
	join->any = true;
	if (join->newest_ms - tick_ms >= RING_TICKS)
		return;
	if (slot->tick_ms != tick_ms)
		*slot = (struct slot){.tick_ms = tick_ms};
	put(slot, frame, resent, reordered);
}

static void put_in_window(struct join *join, unsigned s, uint32_t tick_ms, const struct frame *frame,
                          bool resent, bool reordered)
{
	uint32_t tick = tick_ms - join->end.first_tick_ms;

	if (!resent && join->settling && (int32_t)(tick_ms - join->end.last_tick_ms) > JOIN_FAR_TICKS)
		join->settling = false;
	if (!join->has_capture || tick >= join->ticks || !(resent || join->settling))
		return;
	join->touched++;
	DT_ASSERT(join->ticks <= DROP_TICKS_MAX && join->missing <= WIRE_SENSORS * join->ticks);
	if (put(&join->window[s][tick], frame, resent, reordered)) {
		DT_ASSERT(join->missing > 0);
		join->missing--;
		if (join->missing == 0)
			check_crc(join);
	}
}

/* Keeps up with the tower's clock; true if a newer live block of the sensor was there before. */
static bool follow_live(struct join *join, unsigned s, uint32_t tick_ms)
{
	if (join->any && (int32_t)(join->newest_ms - tick_ms) > JOIN_FAR_TICKS)
		restart(join);
	if (join->any_live[s] && (int32_t)(join->newest_live_ms[s] - tick_ms) > 0)
		return true;
	join->any_live[s] = true;
	join->newest_live_ms[s] = tick_ms;
	return false;
}

static void feed_block(struct join *join, unsigned s, const struct frame *frame, bool resent)
{
	uint32_t tick_ms;
	bool reordered;

	if (wire_check_block(frame)) {
		join->corrupt++;
		return;
	}
	tick_ms = wire_block_tick_ms(frame);
	reordered = !resent && follow_live(join, s, tick_ms);
	put_in_ring(join, s, tick_ms, frame, resent, reordered);
	put_in_window(join, s, tick_ms, frame, resent, reordered);
}

/* Makes the window of ticks first..first+ticks-1 from the ring. */
static void open_window(struct join *join, uint32_t first_ms, uint32_t ticks)
{
	bool before = true;

	DT_ASSERT(ticks <= DROP_TICKS_MAX);
	join->ticks = ticks;
	join->missing = 0;
	join->gaps = 0;
	for (unsigned s = 0; s < WIRE_SENSORS; s++, before = true) {
		for (uint32_t tick = 0; tick < ticks; tick++) {
			const struct slot *slot = &join->ring[s][(first_ms + tick) % RING_TICKS];
			bool held = slot->held && slot->tick_ms == first_ms + tick;

			join->window[s][tick] = held ? *slot : (struct slot){0};
			join->missing += !held;
			join->gaps += before && !held;
			before = held;
		}
	}
}

static bool is_known(const struct join *join, const struct wire_capture_end *end)
{
	return join->end_seen && end->drop_id == join->end.drop_id &&
	       end->first_tick_ms == join->end.first_tick_ms && end->last_tick_ms == join->end.last_tick_ms;
}

bool join_is_news(const struct join *join, const struct frame *frame)
{
	struct wire_capture_end end;

	return frame->id == WIRE_ID_CAPTURE_END && wire_check_capture_end(frame) == 0 &&
	       wire_unpack_capture_end(frame, &end) == 0 && !is_known(join, &end);
}

static int feed_capture_end(struct join *join, const struct frame *frame)
{
	struct wire_capture_end end;
	uint32_t ticks;

	if (wire_check_capture_end(frame) || wire_unpack_capture_end(frame, &end)) {
		join->corrupt++;
		return 0;
	}
	ticks = end.last_tick_ms - end.first_tick_ms + 1;
	if (ticks == 0 || ticks > DROP_TICKS_MAX) {
		join->corrupt++;
		return 0;
	}
	if (is_known(join, &end))
		return 0;
	if (join->has_capture)
		tell_loss(join, JOIN_LOSS_CAPTURE);
	join->end = end;
	told_begin(&join->told, end.drop_id);
	join->end_seen = true;
	join->has_capture = true;
	join->settling = true;
	open_window(join, end.first_tick_ms, ticks);
	check_crc(join);
	return 1;
}

static void feed_heartbeat(struct join *join, const struct frame *frame)
{
	uint32_t incomplete = join->segments.incomplete;
	struct wire_heartbeat heartbeat;

	if (wire_unpack_heartbeat(frame, &heartbeat) != 0 || heartbeat.nmt_state != 0)
		return;
	restart(join);
	/* pieces of a message may not be filled up with those of the next run's, which has the same name */
	memset(&join->segments, 0, sizeof(join->segments));
	join->segments.incomplete = incomplete;
}

int join_feed(struct join *join, const struct frame *part)
{
	const struct frame *frame;

	if (part->flags & (FRAME_EXTENDED | FRAME_REMOTE | FRAME_ERROR))
		return 0;
	frame = segment_feed(&join->segments, part);
	if (frame == NULL)
		return 0;
	switch (frame->id) {
	case WIRE_ID_BLOCK_S1:
		feed_block(join, 0, frame, false);
		return 0;
	case WIRE_ID_BLOCK_S2:
		feed_block(join, 1, frame, false);
		return 0;
	case WIRE_ID_RESENT_S1:
		feed_block(join, 0, frame, true);
		return 0;
	case WIRE_ID_RESENT_S2:
		feed_block(join, 1, frame, true);
		return 0;
	case WIRE_ID_HEARTBEAT_TOWER:
		feed_heartbeat(join, frame);
		return 0;
	case WIRE_ID_CAPTURE_END:
		return feed_capture_end(join, frame);
	case WIRE_ID_MEASURED:
	case WIRE_ID_PARAMETER:
		join->corrupt += told_feed(&join->told, frame) != 0;
		return 0;
	default:
		return 0;
	}
}

bool join_has_capture(const struct join *join)
{
	return join->has_capture;
}

bool join_complete(const struct join *join)
{
	return join->has_capture && join->crc_agrees;
}

bool join_told(const struct join *join)
{
	return join->has_capture && told_whole(&join->told, &join->end);
}

bool join_next_gap(const struct join *join, unsigned sensor, uint32_t tick_ms, uint32_t limit,
                   struct record_gap *gap)
{
	uint32_t first_ms = join->end.first_tick_ms;
	uint32_t start = sensor > 0 && (int32_t)(tick_ms - first_ms) > 0 ? tick_ms - first_ms : 0;

	if (!join->has_capture)
		return false;
	for (unsigned s = sensor > 0 ? sensor - 1 : 0; s < WIRE_SENSORS; s++, start = 0) {
		for (uint32_t tick = start; tick < join->ticks; tick++) {
			uint32_t end = tick;

			while (end < join->ticks && end - tick < limit && !join->window[s][end].held)
				end++;
			if (end == tick)
				continue;
			*gap = (struct record_gap){.sensor = s + 1,
			                           .first_tick_ms = first_ms + tick,
			                           .last_tick_ms = first_ms + end - 1};
			return true;
		}
	}
	return false;
}

void join_forget(struct join *join)
{
	if (!join->has_capture)
		return;
	for (unsigned s = 0; s < WIRE_SENSORS; s++)
		for (uint32_t tick = 0; tick < join->ticks; tick++)
			join->window[s][tick].held = false;
	join->missing = WIRE_SENSORS * join->ticks;
	join->crc_agrees = false;
}

/* The longest run of ticks that at least one sensor holds, over holes of less than JOIN_FAR_TICKS; behind the
 * last capture of this run of the tower. */
static uint32_t find_run(const struct join *join, uint32_t *first_ms)
{
	uint32_t first = 0, last = 0, best = 0;
	bool any = false;

	for (uint32_t i = 0; i < RING_TICKS; i++) {
		uint32_t tick_ms = join->newest_ms - RING_TICKS + 1 + i;
		const struct slot *s1 = &join->ring[0][tick_ms % RING_TICKS];
		const struct slot *s2 = &join->ring[1][tick_ms % RING_TICKS];

		if (!(s1->held && s1->tick_ms == tick_ms) && !(s2->held && s2->tick_ms == tick_ms))
			continue;
		if (join->end_seen && (int32_t)(tick_ms - join->end.last_tick_ms) <= 0)
			continue;
		if (!any || tick_ms - last > JOIN_FAR_TICKS)
			first = tick_ms;
		any = true;
		last = tick_ms;
		if (last - first + 1 > best) {
			best = last - first + 1;
			*first_ms = first;
		}
	}
	return best;
}

/* Counts what the window holds; returns the drop number of the last block of it. */
static uint16_t count_slots(const struct join *join, struct record_counters *counters)
{
	uint16_t drop_id = 0;

	for (unsigned s = 0; s < WIRE_SENSORS; s++) {
		for (uint32_t tick = 0; tick < join->ticks; tick++) {
			const struct slot *slot = &join->window[s][tick];

			counters->blocks += slot->held;
			if (slot->held)
				drop_id = (uint16_t)(slot->data[0] | slot->data[1] << 8);
			counters->repeated += slot->repeated;
			counters->conflicting += slot->conflicting;
			counters->reordered += slot->reordered;
			counters->resent += slot->resent;
		}
	}
	counters->corrupt = join->corrupt + join->segments.incomplete;
	counters->gaps = join->gaps;
	return drop_id;
}

static void fill_from_window(const struct join *join, struct record *record)
{
	for (unsigned s = 0; s < WIRE_SENSORS; s++) {
		for (uint32_t tick = 0; tick < join->ticks; tick++) {
			const struct slot *slot = &join->window[s][tick];
			struct frame frame = {.length = WIRE_LENGTH_block, .flags = FRAME_FD};
			struct wire_block block;

			memcpy(frame.data, slot->data, sizeof(slot->data));
			if (!slot->held || wire_unpack_block(&frame, &block))
				continue;
			drop_put(record, s + 1, tick, 1, block.x, block.y, block.z);
		}
	}
	record->drop_id = count_slots(join, &record->counters);
}

static void fill_from_end(const struct join *join, struct record *record)
{
	record->drop_id = join->end.drop_id;
	record->marks = join->end.marks;
	if (!(record->marks & WIRE_MARK_NO_IMPACT))
		record->trigger_s = join->end.trigger_us / 1e6;
	if (join->end.frame_speed_mm_s)
		record->frame_speed_m_s = join->end.frame_speed_mm_s / 1e3;
	record->crc32 = join->end.crc32;
	record->camera_frame = join->end.camera_frame;
	record->crc_known = true;
	record->parameters_crc32 = join->end.parameters_crc32;
	record->trigger_us = join->end.trigger_us;
	record->seal_known = true;
	record->seal = join->end.seal;
}

/* The capture's window, or one of the longest run; false when there is no block for one. */
static bool find_window(struct join *join, uint32_t *first_ms)
{
	uint32_t run;

	*first_ms = join->end.first_tick_ms;
	if (join->has_capture)
		return true;
	run = join->any ? find_run(join, first_ms) : 0;
	if (run > 0)
		open_window(join, *first_ms, run);
	return run > 0;
}

static void make_room(struct join *join)
{
	if (!join->has_capture)
		join_forget_run(join);
	join->has_capture = false;
	join->corrupt = 0;
	join->segments.incomplete = 0;
}

int join_take(struct join *join, struct record *record)
{
	uint32_t first_ms;
	struct record drop;
	int error;

	if (!find_window(join, &first_ms) || join->missing == WIRE_SENSORS * join->ticks)
		return DT_E_EMPTY;
	error = drop_open(&drop, first_ms, first_ms + join->ticks - 1);
	if (error)
		return error;
	fill_from_window(join, &drop);
	if (join->has_capture) {
		fill_from_end(join, &drop);
		told_fill(&join->told, &join->end, &drop);
	}
	drop.crc_agrees = join->crc_agrees;
	error = drop_close(&drop);
	if (error)
		return error;
	strcpy(drop.format, "live");
	make_room(join);
	*record = drop;
	return 0;
}

int join_skip(struct join *join, struct log_capture *capture)
{
	const struct wire_capture_end *end = &join->end;
	uint32_t first_ms;

	if (!find_window(join, &first_ms))
		return DT_E_EMPTY;
	capture->counters = (struct record_counters){0};
	capture->drop_id = count_slots(join, &capture->counters);
	capture->first_tick_ms = first_ms;
	capture->last_tick_ms = first_ms + join->ticks - 1;
	capture->ended = join->has_capture;
	if (join->has_capture)
		capture->drop_id = end->drop_id;
	capture->marks = join->has_capture ? end->marks : 0;
	capture->crc32 = join->has_capture ? end->crc32 : 0;
	capture->frame_speed_mm_s = join->has_capture ? end->frame_speed_mm_s : 0;
	capture->crc_agrees = join->has_capture && join->crc_agrees;
	capture->seal_known = join->has_capture; /* an end that does not agree ends no capture */
	capture->seal_agrees = join->has_capture && !told_is_altered(&join->told, end);
	capture->seal = join->has_capture ? end->seal : 0;
	make_room(join);
	return 0;
}

const struct wire_capture_end *join_end(const struct join *join)
{
	return join->has_capture ? &join->end : NULL;
}

bool join_newest(const struct join *join, uint32_t *tick_ms)
{
	if (join->any)
		*tick_ms = join->newest_ms;
	return join->any;
}

uint64_t join_restarts(const struct join *join)
{
	return join->restarts;
}

uint64_t join_touched(const struct join *join)
{
	return join->touched;
}
