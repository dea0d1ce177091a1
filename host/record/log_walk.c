/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/log_walk.h"

#include <stdlib.h>
#include <string.h>

#include "common/wire_table.h"
#include "host/record/lcm_log.h"
#include "host/record/metadata.h"

enum {
	PLACE_TICKS = 64,           /* between places */
	BEFORE_TICKS = 1500,        /* the fall before the window, from a height of 2.4 m on */
	TAIL_TICKS = 1000,          /* what the tower says of a capture after it */
	TAIL_BYTES_MAX = 512 << 10, /* the same where no block tells the time; more than those ticks take */
};

/* ---- places ---- */

static void note_place(struct log_walk *walk)
{
	struct log_place place = {.at = walk->at}, *last = &walk->place[walk->place_count - 1];

	place.known = join_newest(walk->join, &place.tick_ms);
	if (place.known == last->known && place.tick_ms - last->tick_ms < PLACE_TICKS)
		return;
	if (walk->place_count == LOG_PLACES) {
		walk->place_count--;
		memmove(walk->place, walk->place + 1, walk->place_count * sizeof(place));
	}
	walk->place[walk->place_count++] = place;
}

/* Nothing that is to come needs what stands before. */
static void forget_places(struct log_walk *walk, uint64_t at)
{
	walk->place_count = 1;
	walk->place[0] = (struct log_place){.at = at};
	walk->place[0].known = join_newest(walk->join, &walk->place[0].tick_ms);
}

/* Where to begin reading for blocks from first_ms on and what led to them. */
static uint64_t place_before(const struct log_walk *walk, uint32_t first_ms)
{
	unsigned i = walk->place_count;

	while (i > 1 && !(walk->place[i - 1].known &&
	                  (int32_t)(first_ms - BEFORE_TICKS - walk->place[i - 1].tick_ms) > 0))
		i--;
	return i > 0 ? walk->place[i - 1].at : walk->at;
}

/* ---- captures on their way to the visitor ---- */

static void log_walk_give_held(struct log_walk *walk, bool is_last)
{
	struct log_capture *capture = &walk->held;

	if (!walk->has_held)
		return;
	if (walk->held_is_ended)
		capture->to = walk->ended.to;
	if (is_last) {
		capture->counters.corrupt += walk->corrupt;
		if (walk->held_record != NULL)
			walk->held_record->counters.corrupt += walk->corrupt;
	}
	capture->alone = is_last && capture->number == 1;
	walk->has_held = walk->held_is_ended = false;
	if (walk->result == 0)
		walk->result = walk->visitor->capture(walk->visitor->context, capture, walk->held_record);
	else if (walk->held_record != NULL)
		record_free(walk->held_record);
}

static void log_walk_hold(struct log_walk *walk, const struct log_capture *capture,
                          const struct record *record)
{
	log_walk_give_held(walk, false);
	walk->held = *capture;
	walk->held.number = ++walk->number;
	walk->held.counters.corrupt += walk->corrupt;
	walk->held_record = NULL;
	if (record != NULL) {
		walk->record = *record;
		walk->record.counters.corrupt += walk->corrupt;
		walk->held_record = &walk->record;
	}
	walk->has_held = true;
	walk->corrupt = 0;
}

static bool log_walk_wants(const struct log_walk *walk)
{
	return walk->visitor->wanted == LOG_EVERY || walk->visitor->wanted == walk->number + 1;
}

bool log_walk_may_want(const struct log_walk *walk)
{
	/* one that began and never ended comes before it */
	return log_walk_wants(walk) || (walk->begun && walk->visitor->wanted == walk->number + 2);
}

/* What the join has, with its samples if they are wanted. DT_E_EMPTY only without a capture end. */
static int log_walk_take(struct log_walk *walk, struct log_capture *capture, struct record *record,
                         bool *has_record)
{
	int error = DT_E_EMPTY;

	*has_record = false;
	if (log_walk_wants(walk))
		error = join_take(walk->join, record);
	if (error == 0) {
		log_capture_of_record(record, capture);
		record->time_s = log_capture_time_s(capture);
		*has_record = true;
	} else if (error == DT_E_EMPTY) {
		error = join_skip(walk->join, capture);
	}
	if (error != 0 && error != DT_E_EMPTY && walk->result == 0) {
		walk->result = error;
		walk->no_memory = true;
	}
	return error;
}

/* The capture that the join has, complete or never to be. */
static void log_walk_take_capture(struct log_walk *walk)
{
	struct log_capture capture = walk->ended;
	struct record record;
	bool has_record;

	if (log_walk_take(walk, &capture, &record, &has_record) != 0)
		return;
	log_walk_hold(walk, &capture, has_record ? &record : NULL);
	walk->held_is_ended = true;
}

/* What there is of a drop that ends here without a capture end; seen: it was seen to begin. */
static void take_run(struct log_walk *walk, bool seen)
{
	struct log_capture capture = {.time_us = walk->time_us,
	                              .to = walk->at,
	                              .drop_id = walk->begun_drop,
	                              .first_tick_ms = 1,
	                              .parameters = walk->parameters};
	struct record record;
	bool has_record;
	int error = log_walk_take(walk, &capture, &record, &has_record);

	walk->begun = false;
	if (error == 0)
		capture.from = place_before(walk, capture.first_tick_ms);
	else if (error == DT_E_EMPTY && seen)
		capture.from = place_before(walk, 0);
	else
		return;
	log_walk_hold(walk, &capture, has_record ? &record : NULL);
	forget_places(walk, walk->at);
}

static void take_lost(void *context, enum join_loss what)
{
	struct log_walk *walk = context;

	if (join_has_capture(walk->join) && (what == JOIN_LOSS_CAPTURE || walk->begun))
		log_walk_take_capture(walk);
	if (what == JOIN_LOSS_RUN && walk->begun)
		take_run(walk, true);
}

/* A capture ended with this frame. */
static void begin_capture(struct log_walk *walk, bool in_segments)
{
	const struct wire_capture_end *end = join_end(walk->join);
	uint64_t from = in_segments ? walk->end_at : place_before(walk, end->first_tick_ms);

	if (walk->held_is_ended)
		walk->held.to = walk->ended.to;
	walk->held_is_ended = false;
	walk->ended = (struct log_capture){.from = from,
	                                   .to = walk->next,
	                                   .time_us = walk->time_us,
	                                   .drop_id = end->drop_id,
	                                   .last_tick_ms = end->last_tick_ms,
	                                   .parameters = walk->parameters};
	walk->ended_in_run = true;
	walk->begun = false;
}

/* The frame belongs to the last capture. */
static void extend(struct log_walk *walk)
{
	walk->ended.to = walk->tail_at = walk->next;
	walk->tail_open = true;
	forget_places(walk, walk->next);
}

/* What follows a capture belongs to it for a while. */
static void follow_tail(struct log_walk *walk)
{
	uint32_t newest_ms;
	bool over = walk->begun || walk->next - walk->tail_at > TAIL_BYTES_MAX;

	if (!walk->tail_open)
		return;
	if (join_newest(walk->join, &newest_ms))
		over |= (int32_t)(newest_ms - walk->ended.last_tick_ms) > TAIL_TICKS;
	if (over)
		walk->tail_open = false;
	else
		walk->ended.to = walk->next;
}

/* ---- what the frames say ---- */

static void log_walk_note_state(struct log_walk *walk, unsigned state, unsigned drop_id)
{
	if (!wire_state_moving(state) || (walk->ended_in_run && walk->ended.drop_id == drop_id))
		return;
	if (walk->begun && walk->begun_drop != drop_id) {
		if (join_has_capture(walk->join))
			log_walk_take_capture(walk);
		take_run(walk, true);
	}
	walk->begun = true;
	walk->begun_drop = (uint16_t)drop_id;
}

static void note_block(struct log_walk *walk, const struct frame *frame)
{
	struct wire_block block;

	if (walk->begun && frame->data[0] == (walk->begun_drop & 0xFF))
		return;
	if (frame->length != WIRE_LENGTH_block || !wire_state_moving(frame->data[6] & 15u))
		return;
	if (wire_check_block(frame) != 0 || wire_unpack_block(frame, &block) != 0)
		return;
	if (walk->ended_in_run && (int32_t)(block.tick_ms - walk->ended.last_tick_ms) <= 0)
		return; /* late, from before the last capture's end */
	log_walk_note_state(walk, block.status & 15u, block.drop_id);
}

static int log_walk_tell(struct log_walk *walk, struct log_event *event)
{
	if (walk->result == 0 && walk->visitor->event != NULL)
		walk->result = walk->visitor->event(walk->visitor->context, event);
	return walk->result;
}

static void tell_heartbeats(struct log_walk *walk)
{
	if (walk->heartbeats.count > 0)
		log_walk_tell(walk, &walk->heartbeats);
	walk->heartbeats = (struct log_event){.kind = LOG_HEARTBEATS};
}

static void note_heartbeat(struct log_walk *walk)
{
	struct log_event *beats = &walk->heartbeats;

	if (beats->count++ == 0) {
		beats->at = walk->at;
		beats->first_us = walk->time_us;
	} else if (walk->time_us - beats->time_us > beats->longest_us) {
		beats->longest_us = walk->time_us - beats->time_us;
	}
	beats->time_us = walk->time_us;
}

static void note_fault(struct log_walk *walk, const struct frame *frame)
{
	struct log_event event = {.kind = LOG_FAULT, .at = walk->at, .time_us = walk->time_us};
	struct wire_emcy emcy;

	if (wire_unpack_emcy(frame, &emcy) != 0)
		return;
	event.emcy = emcy.code;
	event.fault = emcy.fault;
	event.tick_ms = emcy.tick_ms;
	log_walk_tell(walk, &event);
}

/* A value read, or one written once the tower has said so. */
static void note_parameter(struct log_walk *walk, const struct frame *frame)
{
	enum { WRITE = 0x23, VALUE = 0x43, WRITTEN = 0x60 };
	struct wire_sdo sdo;

	if (wire_unpack_sdo(frame, &sdo) != 0)
		return;
	if (frame->id == WIRE_ID_SDO_REQUEST) {
		walk->request = sdo;
		return;
	}
	for (unsigned i = 0; i < WIRE_PARAMETERS; i++) {
		bool written = sdo.specifier == WRITTEN && walk->request.specifier == WRITE &&
		               walk->request.index == sdo.index;

		if (wire_parameters[i].index != sdo.index || !(written || sdo.specifier == VALUE))
			continue;
		walk->parameters.known[i] = true;
		walk->parameters.value[i] = written ? walk->request.value : sdo.value;
	}
}

static void note_frame(struct log_walk *walk, const struct frame *frame)
{
	struct wire_heartbeat heartbeat;
	struct wire_status status;
	struct wire_challenge armed;

	switch (frame->id) {
	case WIRE_ID_BLOCK_S1:
	case WIRE_ID_BLOCK_S2:
		walk->live = true;
		note_block(walk, frame);
		break;
	case WIRE_ID_STATUS:
		if (!walk->live && wire_unpack_status(frame, &status) == 0)
			log_walk_note_state(walk, status.state, walk->armed_drop);
		break;
	case WIRE_ID_CHALLENGE:
		if (wire_unpack_challenge(frame, &armed) == 0)
			walk->armed_drop = armed.drop_id;
		break;
	case WIRE_ID_EMCY:
		note_fault(walk, frame);
		break;
	case WIRE_ID_SDO_REQUEST:
	case WIRE_ID_SDO_REPLY:
		note_parameter(walk, frame);
		break;
	case WIRE_ID_HEARTBEAT_TOWER:
		if (wire_unpack_heartbeat(frame, &heartbeat) == 0 && heartbeat.nmt_state != 0)
			note_heartbeat(walk);
		break;
	case WIRE_ID_CAPTURE_END:
		if (frame->length <= 8 && (frame->data[0] & 127u) == 0)
			walk->end_at = walk->at;
		break;
	default:
		break;
	}
}

static void start_again(struct log_walk *walk)
{
	struct log_event event = {.kind = LOG_START, .at = walk->at, .time_us = walk->time_us};

	tell_heartbeats(walk);
	log_walk_tell(walk, &event);
	walk->parameters = (struct log_capture_parameters){0};
	walk->ended_in_run = walk->tail_open = walk->begun = walk->live = false;
	forget_places(walk, walk->at);
}

void log_walk_frame(struct log_walk *walk, const struct frame *frame)
{
	uint64_t restarts = join_restarts(walk->join), touched = join_touched(walk->join);
	bool in_segments = frame->length <= 8;
	int ended;

	if (frame->flags & (FRAME_EXTENDED | FRAME_REMOTE | FRAME_ERROR))
		return;
	note_place(walk);
	note_frame(walk, frame);
	if (join_complete(walk->join) && join_is_news(walk->join, frame))
		log_walk_take_capture(walk); /* nothing more comes of it */
	ended = join_feed(walk->join, frame);
	if (join_restarts(walk->join) != restarts)
		start_again(walk);
	if (ended)
		begin_capture(walk, in_segments);
	follow_tail(walk);
	if (join_has_capture(walk->join) && (ended || join_touched(walk->join) != touched))
		extend(walk);
	else if (frame->id == WIRE_ID_CAPTURE_END && !in_segments)
		forget_places(walk, walk->next); /* it came again */
	/* as soon as it is complete with what follows its end, as a live host does */
	if (join_complete(walk->join) && (join_told(walk->join) || frame->id == WIRE_ID_CHALLENGE))
		log_walk_take_capture(walk);
}

void log_walk_drop(struct log_walk *walk, struct record *record)
{
	struct log_capture capture = {.from = walk->at, .to = walk->next, .time_us = walk->time_us};
	bool wanted;

	log_capture_of_record(record, &capture);
	record->time_s = log_capture_time_s(&capture);
	if (walk->begun && walk->begun_drop != record->drop_id)
		take_run(walk, true);
	wanted = log_walk_wants(walk);
	walk->begun = false;
	join_forget_run(walk->join);
	walk->ended.drop_id = record->drop_id;
	walk->ended.last_tick_ms = record->last_tick_ms;
	walk->ended_in_run = true;
	log_walk_hold(walk, &capture, wanted ? record : NULL);
	forget_places(walk, walk->next);
	if (!wanted)
		record_free(record);
}

void log_walk_sealed(struct log_walk *walk)
{
	if (!walk->has_held)
		return;
	walk->held.to = walk->next;
	forget_places(walk, walk->next);
	if (walk->held_record != NULL)
		walk->held_record->file_sealed = true;
}

int log_walk_told(struct log_walk *walk, const char *name, const char *value)
{
	const struct metadata_entry *entry = metadata_find(name);
	struct record unwanted = {.file = ""};

	if (entry == NULL || entry->of_drop)
		return DT_E_FORMAT;
	return metadata_parse(walk->has_held && walk->held_record != NULL ? walk->held_record : &unwanted,
	                      entry, value);
}

void log_walk_altered(struct log_walk *walk, const char *found, const char *expected)
{
	unsigned digits = 0;

	while (digits < 64 && memchr("0123456789abcdef", expected[digits], 16) != NULL)
		digits++;
	if (digits < 64)
		walk->result =
		        source_refuse(walk->message, DT_E_CORRUPT, walk->file, 0,
		                      "altered: the seal of its drop is no SHA-256, expected %s", found);
	else
		walk->result = source_refuse(
		        walk->message, DT_E_CORRUPT, walk->file, 0,
		        "altered: the SHA-256 of its drop is %s, expected %.64s as it says itself", found,
		        expected);
}

/* ---- the walk ---- */

bool log_is(struct log_file *log)
{
	return lcm_log_is(log) || candump_is(log);
}

const char *log_format(struct log_file *log)
{
	return lcm_log_is(log) ? "lcm" : "candump";
}

static void log_walk_end(struct log_walk *walk)
{
	walk->at = walk->next;
	if (join_has_capture(walk->join))
		log_walk_take_capture(walk);
	if (walk->begun || walk->number == 0)
		take_run(walk, walk->begun);
	log_walk_give_held(walk, true);
	tell_heartbeats(walk);
}

int log_walk(struct log_file *log, uint64_t from, uint64_t to, struct log_visitor *visitor,
             struct log_contents *contents, char message[READ_MESSAGE_MAX])
{
	struct log_walk *walk = calloc(1, sizeof(*walk));
	int result;

	*contents = (struct log_contents){0};
	if (walk != NULL)
		walk->join = join_create();
	if (walk == NULL || walk->join == NULL) {
		free(walk);
		return source_no_memory(message, log->file);
	}
	walk->visitor = visitor;
	walk->contents = contents;
	walk->file = log->file;
	walk->message = message;
	walk->at = walk->next = from;
	walk->heartbeats.kind = LOG_HEARTBEATS;
	forget_places(walk, from);
	join_on_loss(walk->join, take_lost, walk);
	(lcm_log_is(log) ? read_lcm : read_candump)(walk, log, from, to);
	result = walk->result != 0 ? walk->result : log_file_error(log, message);
	if (result != 0)
		walk->result = result;
	log_walk_end(walk);
	if (result == 0)
		result = walk->result;
	contents->captures = walk->number;
	if (walk->no_memory)
		source_refuse(message, result, log->file, 0, "%s", error_text(result));
	join_destroy(walk->join);
	free(walk);
	return result;
}
