/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/lcm_codec.h"

#include <endian.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/crc.h"
#include "common/wire.h"
#include "host/base/checksum.h"
#include "host/record/drop.h"

static int lcm_codec_block_sensor(uint32_t id)
{
	switch (id) {
	case WIRE_ID_BLOCK_S1:
	case WIRE_ID_RESENT_S1:
		return 1;
	case WIRE_ID_BLOCK_S2:
	case WIRE_ID_RESENT_S2:
		return 2;
	default:
		return 0;
	}
}

int lcm_codec_block(const struct frame *frame, droptower_block *block)
{
	int sensor = lcm_codec_block_sensor(frame->id);
	int error = sensor ? wire_check_block(frame) : DT_E_UNKNOWN;
	struct wire_block wire;

	if (!error)
		error = wire_unpack_block(frame, &wire);
	if (error)
		return error;
	*block = (droptower_block){
	        .utime = frame->time_us,
	        .drop_id = wire.drop_id,
	        .tick_ms = wire.tick_ms,
	        .sensor = (int8_t)sensor,
	        .resent = frame->id == WIRE_ID_RESENT_S1 || frame->id == WIRE_ID_RESENT_S2,
	        .status = wire.status,
	        .io = wire.io,
	};
	memcpy(block->x, wire.x, sizeof(wire.x));
	memcpy(block->y, wire.y, sizeof(wire.y));
	memcpy(block->z, wire.z, sizeof(wire.z));
	return 0;
}

static bool lcm_codec_fits(int64_t value, int64_t max)
{
	return value >= 0 && value <= max;
}

int lcm_codec_frame(const droptower_block *block, struct frame *frame)
{
	static const uint32_t ids[2][2] = {{WIRE_ID_BLOCK_S1, WIRE_ID_RESENT_S1},
	                                   {WIRE_ID_BLOCK_S2, WIRE_ID_RESENT_S2}};
	struct wire_block wire = {
	        .drop_id = (uint16_t)block->drop_id,
	        .tick_ms = (uint32_t)block->tick_ms,
	        .status = (uint8_t)block->status,
	        .io = (uint16_t)block->io,
	};

	if (block->sensor < 1 || block->sensor > WIRE_SENSORS ||
	    !lcm_codec_fits(block->drop_id, UINT16_MAX) || !lcm_codec_fits(block->tick_ms, UINT32_MAX) ||
	    !lcm_codec_fits(block->status, UINT8_MAX) || !lcm_codec_fits(block->io, UINT16_MAX))
		return DT_E_RANGE;
	memcpy(wire.x, block->x, sizeof(wire.x));
	memcpy(wire.y, block->y, sizeof(wire.y));
	memcpy(wire.z, block->z, sizeof(wire.z));
	frame->time_us = block->utime;
	wire_pack_block(frame, ids[block->sensor - 1][block->resent != 0], &wire);
	wire_seal_block(frame);
	return 0;
}

int lcm_codec_state(const struct frame *frame, droptower_state *state)
{
	struct wire_status status;
	int error = frame->id == WIRE_ID_STATUS ? wire_unpack_status(frame, &status) : DT_E_UNKNOWN;

	if (error)
		return error;
	state->state = status.state;
	state->fault = status.fault;
	state->checks = status.checks;
	state->io = status.io;
	return 0;
}

static void fill_message(const struct record *record, droptower_drop *drop)
{
	const struct record_counters *counters = &record->counters;

	drop->drop_id = record->drop_id;
	drop->marks = record->marks;
	drop->first_tick_ms = record->first_tick_ms;
	drop->last_tick_ms = record->last_tick_ms;
	drop->trigger_us = isnan(record->trigger_s) ? record->trigger_us : llround(record->trigger_s * 1e6);
	if (isnan(record->trigger_s) && !(record->crc_known && (record->marks & WIRE_MARK_NO_IMPACT)))
		drop->trigger_us = -1;
	drop->crc32 = record->crc32;
	drop->crc_known = record->crc_known;
	drop->crc_agrees = record->crc_agrees;
	drop->frame_speed_mm_s =
	        isnan(record->frame_speed_m_s) ? 0 : (int32_t)lround(record->frame_speed_m_s * 1e3);
	drop->camera_frame = record->camera_frame;
	drop->seal_known = record->seal_known;
	drop->seal = record->seal;
	drop->parameters_crc32 = record->parameters_crc32;
	drop->parameters_held = (int32_t)record->parameters_held;
	for (unsigned i = 0; i < WIRE_PARAMETERS; i++)
		drop->parameter[i] = record->parameters_held >> i & 1u ? record->parameters[i] : 0;
	drop->blocks = (int64_t)counters->blocks;
	drop->repeated = (int64_t)counters->repeated;
	drop->reordered = (int64_t)counters->reordered;
	drop->corrupt = (int64_t)counters->corrupt;
	drop->gaps = (int64_t)counters->gaps;
	drop->resent = (int64_t)counters->resent;
	drop->conflicting = (int64_t)counters->conflicting;
}

static void fill_measured(const struct record *record, droptower_drop *drop)
{
	const struct wire_measured *measured = &record->measured;

	drop->measured_known = record->measured_known;
	drop->dropout_us = measured->dropout_us;
	drop->dropout_used_us = measured->dropout_used_us;
	drop->separation_mm_s = measured->separation_mm_s;
	drop->separation_um = measured->separation_um;
	drop->acceleration_mm_s2 = measured->acceleration_mm_s2;
	drop->latch_delay_us = measured->latch_delay_us;
	drop->clock_ppm = measured->clock_ppm;
	drop->trigger_latency_us = measured->trigger_latency_us;
}

/* Zero where not all of them are filled. */
static int16_t *samples_room(int32_t count, bool zero)
{
	return zero ? calloc((size_t)count, sizeof(int16_t)) : malloc((size_t)count * sizeof(int16_t));
}

static bool lcm_codec_allocate(droptower_drop *drop, bool zero)
{
	size_t gaps = (size_t)drop->gap_count + 1 + WIRE_SENSORS;

	drop->gap_sensor = calloc(gaps, sizeof(*drop->gap_sensor));
	drop->gap_first_tick_ms = calloc(gaps, sizeof(*drop->gap_first_tick_ms));
	drop->gap_last_tick_ms = calloc(gaps, sizeof(*drop->gap_last_tick_ms));
	drop->s1_x = samples_room(drop->x_count, zero);
	drop->s1_y = samples_room(drop->yz_count, zero);
	drop->s1_z = samples_room(drop->yz_count, zero);
	drop->s2_x = samples_room(drop->x_count, zero);
	drop->s2_y = samples_room(drop->yz_count, zero);
	drop->s2_z = samples_room(drop->yz_count, zero);
	return drop->gap_sensor && drop->gap_first_tick_ms && drop->gap_last_tick_ms && drop->s1_x &&
	       drop->s1_y && drop->s1_z && drop->s2_x && drop->s2_y && drop->s2_z;
}

void lcm_codec_free_drop(droptower_drop *drop)
{
	free(drop->gap_sensor);
	free(drop->gap_first_tick_ms);
	free(drop->gap_last_tick_ms);
	free(drop->s1_x);
	free(drop->s1_y);
	free(drop->s1_z);
	free(drop->s2_x);
	free(drop->s2_y);
	free(drop->s2_z);
	*drop = (droptower_drop){0};
}

int lcm_codec_drop(const struct record *record, int64_t utime, droptower_drop *drop)
{
	droptower_drop message = {.utime = utime};

	if (!record->is_drop)
		return DT_E_ARGUMENT;
	fill_message(record, &message);
	fill_measured(record, &message);
	message.gap_count = (int32_t)record->gap_count;
	message.x_count = (int32_t)(drop_ticks(record) * WIRE_X_PER_TICK);
	message.yz_count = (int32_t)(drop_ticks(record) * WIRE_YZ_PER_TICK);
	if (!lcm_codec_allocate(&message, true)) {
		lcm_codec_free_drop(&message);
		return DT_E_MEMORY;
	}
	for (size_t i = 0; i < record->gap_count; i++) {
		message.gap_sensor[i] = (int8_t)record->gaps[i].sensor;
		message.gap_first_tick_ms[i] = record->gaps[i].first_tick_ms;
		message.gap_last_tick_ms[i] = record->gaps[i].last_tick_ms;
	}
	for (uint32_t tick = 0; tick < drop_ticks(record); tick++) {
		size_t x = (size_t)tick * WIRE_X_PER_TICK, yz = (size_t)tick * WIRE_YZ_PER_TICK;

		drop_get(record, 1, tick, message.s1_x + x, message.s1_y + yz, message.s1_z + yz);
		drop_get(record, 2, tick, message.s2_x + x, message.s2_y + yz, message.s2_z + yz);
	}
	*drop = message;
	return 0;
}

/* Beyond, a double is not every whole number, and what one format holds another could not. */
static bool counters_fit(const droptower_drop *drop)
{
	const int64_t counters[] = {drop->blocks, drop->repeated, drop->reordered,  drop->corrupt,
	                            drop->gaps,   drop->resent,   drop->conflicting};

	for (size_t i = 0; i < sizeof(counters) / sizeof(counters[0]); i++)
		if (!lcm_codec_fits(counters[i], (int64_t)1 << 53))
			return false;
	return true;
}

static bool parameters_fit(const droptower_drop *drop)
{
	for (unsigned i = 0; i < WIRE_PARAMETERS; i++)
		if (!lcm_codec_fits(drop->parameter[i], UINT32_MAX))
			return false;
	return lcm_codec_fits(drop->parameters_held, RECORD_PARAMETERS_ALL);
}

static bool measured_fits(const droptower_drop *drop)
{
	return lcm_codec_fits(drop->dropout_us, UINT16_MAX) &&
	       lcm_codec_fits(drop->dropout_used_us, UINT16_MAX) &&
	       lcm_codec_fits(drop->separation_mm_s, UINT16_MAX) &&
	       lcm_codec_fits(drop->separation_um, UINT32_MAX) &&
	       lcm_codec_fits(drop->acceleration_mm_s2, UINT16_MAX) &&
	       lcm_codec_fits(drop->latch_delay_us, UINT16_MAX) &&
	       lcm_codec_fits(drop->trigger_latency_us, UINT16_MAX);
}

static bool message_fits(const droptower_drop *drop)
{
	int64_t ticks;

	if (!lcm_codec_fits(drop->first_tick_ms, UINT32_MAX) ||
	    !lcm_codec_fits(drop->last_tick_ms, UINT32_MAX))
		return false;
	ticks = (uint32_t)(drop->last_tick_ms - drop->first_tick_ms + 1);
	return lcm_codec_fits(drop->drop_id, UINT16_MAX) && lcm_codec_fits(drop->marks, UINT16_MAX) &&
	       counters_fit(drop) && drop->gap_count <= ticks + 2 * WIRE_SENSORS &&
	       drop->trigger_us <= UINT32_MAX && lcm_codec_fits(drop->crc32, UINT32_MAX) &&
	       lcm_codec_fits(drop->seal, UINT32_MAX) && lcm_codec_fits(drop->parameters_crc32, UINT32_MAX) &&
	       parameters_fit(drop) && measured_fits(drop) &&
	       lcm_codec_fits(drop->frame_speed_mm_s, UINT16_MAX) &&
	       drop->x_count == ticks * WIRE_X_PER_TICK && drop->yz_count == ticks * WIRE_YZ_PER_TICK;
}

static bool lcm_codec_in_gap(const droptower_drop *drop, unsigned sensor, uint32_t tick_ms)
{
	for (int32_t i = 0; i < drop->gap_count; i++)
		if (drop->gap_sensor[i] == (int)sensor &&
		    tick_ms - (uint32_t)drop->gap_first_tick_ms[i] <=
		            (uint32_t)drop->gap_last_tick_ms[i] - (uint32_t)drop->gap_first_tick_ms[i])
			return true;
	return false;
}

static void take_measured(const droptower_drop *drop, struct record *record)
{
	record->measured_known = drop->measured_known != 0;
	record->measured = (struct wire_measured){
	        .drop_id = (uint16_t)drop->drop_id,
	        .dropout_us = (uint16_t)drop->dropout_us,
	        .dropout_used_us = (uint16_t)drop->dropout_used_us,
	        .separation_mm_s = (uint16_t)drop->separation_mm_s,
	        .separation_um = (uint32_t)drop->separation_um,
	        .acceleration_mm_s2 = (uint16_t)drop->acceleration_mm_s2,
	        .latch_delay_us = (uint16_t)drop->latch_delay_us,
	        .clock_ppm = drop->clock_ppm,
	        .trigger_latency_us = (uint16_t)drop->trigger_latency_us,
	};
}

static void fill_record(const droptower_drop *drop, struct record *record)
{
	record->drop_id = (uint16_t)drop->drop_id;
	record->marks = (uint16_t)drop->marks;
	if (drop->trigger_us >= 0)
		record->trigger_us = (uint32_t)drop->trigger_us;
	if (drop->trigger_us >= 0 && !(record->marks & WIRE_MARK_NO_IMPACT))
		record->trigger_s = (double)drop->trigger_us / 1e6;
	if (drop->frame_speed_mm_s)
		record->frame_speed_m_s = drop->frame_speed_mm_s / 1e3;
	record->crc32 = (uint32_t)drop->crc32;
	record->camera_frame = drop->camera_frame;
	record->crc_known = drop->crc_known != 0;
	record->seal_known = record->crc_known && drop->seal_known != 0;
	record->seal = (uint32_t)drop->seal;
	record->parameters_crc32 = (uint32_t)drop->parameters_crc32;
	record->parameters_held = (uint32_t)drop->parameters_held;
	for (unsigned i = 0; i < WIRE_PARAMETERS; i++)
		record->parameters[i] = (uint32_t)drop->parameter[i];
	take_measured(drop, record);
	record->counters = (struct record_counters){
	        .blocks = (uint64_t)drop->blocks,
	        .repeated = (uint64_t)drop->repeated,
	        .reordered = (uint64_t)drop->reordered,
	        .corrupt = (uint64_t)drop->corrupt,
	        .gaps = (uint64_t)drop->gaps,
	        .resent = (uint64_t)drop->resent,
	        .conflicting = (uint64_t)drop->conflicting,
	};
}

/* ---- the CRC-32 of the samples, as the tower sent them ---- */

static inline uint8_t *put_counts(uint8_t *at, const int16_t *counts, unsigned count)
{
	if (htole16(1) == 1) /* so are ours: as they stand, which are two stores instead of ten */
		return (uint8_t *)memcpy(at, counts, sizeof(*counts) * count) + sizeof(*counts) * count;
	for (unsigned i = 0; i < count; i++) {
		*at++ = (uint8_t)counts[i];
		*at++ = (uint8_t)((uint16_t)counts[i] >> 8);
	}
	return at;
}

/* Of a drop without gaps: many ticks at once, and from the message, not from what is made of it. */
static bool samples_agree(const droptower_drop *drop)
{
	enum { TICKS = 64 };
	uint8_t bytes[TICKS * WIRE_SENSORS * WIRE_SAMPLE_BYTES], *at = bytes;
	uint32_t crc = CRC32_INIT;

	for (int32_t x = 0, yz = 0; x < drop->x_count; x += WIRE_X_PER_TICK, yz += WIRE_YZ_PER_TICK) {
		at = put_counts(at, drop->s1_x + x, WIRE_X_PER_TICK);
		at = put_counts(at, drop->s1_y + yz, WIRE_YZ_PER_TICK);
		at = put_counts(at, drop->s1_z + yz, WIRE_YZ_PER_TICK);
		at = put_counts(at, drop->s2_x + x, WIRE_X_PER_TICK);
		at = put_counts(at, drop->s2_y + yz, WIRE_YZ_PER_TICK);
		at = put_counts(at, drop->s2_z + yz, WIRE_YZ_PER_TICK);
		if (at == bytes + sizeof(bytes)) {
			crc = checksum_crc32(crc, bytes, sizeof(bytes));
			at = bytes;
		}
	}
	return checksum_crc32(crc, bytes, (size_t)(at - bytes)) == (uint32_t)drop->crc32;
}

/* Blocks in no gap. */
static uint32_t held_blocks(const droptower_drop *drop, const struct record *record)
{
	uint32_t held = 0;

	if (drop->gap_count == 0)
		return WIRE_SENSORS * drop_ticks(record);
	for (uint32_t tick = 0; tick < drop_ticks(record); tick++)
		for (unsigned sensor = 1; sensor <= WIRE_SENSORS; sensor++)
			held += !lcm_codec_in_gap(drop, sensor, record->first_tick_ms + tick);
	return held;
}

int lcm_codec_outline(const droptower_drop *drop, struct record *record)
{
	struct record filled;
	int error;

	if (!message_fits(drop))
		return DT_E_RANGE;
	error = drop_open_unheld(&filled, (uint32_t)drop->first_tick_ms, (uint32_t)drop->last_tick_ms);
	if (error)
		return error;
	fill_record(drop, &filled);
	filled.crc_agrees = drop->gap_count == 0 && samples_agree(drop);
	drop_close_unheld(&filled, held_blocks(drop, &filled));
	*record = filled;
	return 0;
}

/* All of a sensor's that are in no gap, those that follow on each other at once. */
static void take_blocks(const droptower_drop *drop, unsigned sensor, struct record *record)
{
	const int16_t *x = sensor == 1 ? drop->s1_x : drop->s2_x, *y = sensor == 1 ? drop->s1_y : drop->s2_y,
	              *z = sensor == 1 ? drop->s1_z : drop->s2_z;
	uint32_t tick = 0, end;

	for (; tick < drop_ticks(record); tick = end + 1) {
		size_t first = (size_t)tick * WIRE_YZ_PER_TICK;

		end = tick;
		while (end < drop_ticks(record) &&
		       !lcm_codec_in_gap(drop, sensor, record->first_tick_ms + end))
			end++;
		drop_put(record, sensor, tick, end - tick, x + (size_t)tick * WIRE_X_PER_TICK, y + first,
		         z + first);
	}
}

int lcm_codec_record(const droptower_drop *drop, struct record *record)
{
	struct record filled;
	int error;

	if (!message_fits(drop))
		return DT_E_RANGE;
	error = drop_open(&filled, (uint32_t)drop->first_tick_ms, (uint32_t)drop->last_tick_ms);
	if (error)
		return error;
	take_blocks(drop, 1, &filled);
	take_blocks(drop, 2, &filled);
	fill_record(drop, &filled);
	filled.crc_agrees = drop->gap_count == 0 && samples_agree(drop);
	error = drop_close(&filled);
	if (!error)
		*record = filled;
	return error;
}

int lcm_codec_decode_block(const void *bytes, size_t size, droptower_block *block)
{
	droptower_block decoded;

	if (size > INT_MAX || droptower_block_decode(bytes, 0, (int)size, &decoded) != (int)size)
		return DT_E_FORMAT;
	*block = decoded;
	return 0;
}

/* ---- a drop's bytes ---- */

/* Of an encoded drop, as drop.lcm has it. */
enum {
	SEAL = 1 + 2 * 8,
	PARAMETERS = 4 + 8 * WIRE_PARAMETERS,
	MEASURED = 1 + 3 * 4 + 8 + 2 * 4 + 2 + 4,
	/* fingerprint, then utime to conflicting */
	GAP_COUNT = 8 + 8 + 2 * 4 + 4 * 8 + 2 + 4 + 2 + SEAL + PARAMETERS + MEASURED + 7 * 8,
	GAP_BYTES = 1 + 8 + 8,
	MAC = 32,
	FIXED_BYTES = GAP_COUNT + 3 * 4 + MAC, /* of one without gaps and samples */
	DROP_BYTES_MAX = 1 << 20,              /* several times the longest drop's: bounds the memory */
};

_Static_assert(sizeof(((droptower_drop *)NULL)->parameter) == 8 * WIRE_PARAMETERS, "as drop.lcm has them");

/* Bytes that are read one after the other; those beyond the end are 0. */
struct cursor {
	const uint8_t *bytes;
	size_t size, at;
};

static int64_t lcm_codec_take(struct cursor *cursor, unsigned count)
{
	uint64_t value = cursor->at < cursor->size && cursor->bytes[cursor->at] & 0x80 ? UINT64_MAX : 0;

	for (unsigned i = 0; i < count; i++, cursor->at++)
		value = value << 8 | (cursor->at < cursor->size ? cursor->bytes[cursor->at] : 0);
	return (int64_t)value;
}

/* How long the message is that the counts announce; 0 for one that ends before them or counts below 0. */
static size_t announced(const uint8_t *bytes, size_t size, droptower_drop *drop)
{
	struct cursor cursor = {bytes, size, GAP_COUNT};
	int64_t gaps = lcm_codec_take(&cursor, 4), x, yz;

	if (gaps < 0 || gaps > INT_MAX / GAP_BYTES)
		return 0;
	cursor.at += (size_t)gaps * GAP_BYTES;
	x = lcm_codec_take(&cursor, 4);
	yz = lcm_codec_take(&cursor, 4);
	if (cursor.at > size || x < 0 || yz < 0)
		return 0;
	drop->gap_count = (int32_t)gaps;
	drop->x_count = (int32_t)x;
	drop->yz_count = (int32_t)yz;
	return cursor.at + sizeof(int16_t) * (2 * (size_t)x + 4 * (size_t)yz) + MAC;
}

/* All but gaps and samples, by the library, whose code for these does without memory what it does with it. */
static bool decode_fixed(const uint8_t *bytes, droptower_drop *drop)
{
	uint8_t fixed[FIXED_BYTES] = {0};

	memcpy(fixed, bytes, GAP_COUNT);
	return droptower_drop_decode(fixed, 0, sizeof(fixed), drop) == sizeof(fixed);
}

/* Eight samples in a register: the compiler turns one at a time. */
enum { TOGETHER = 8 };
typedef uint16_t together __attribute__((vector_size(TOGETHER * sizeof(uint16_t))));

static inline void turn_together(int16_t *samples, const uint8_t *bytes)
{
	together big;

	memcpy(&big, bytes, sizeof(big));
	if (be16toh(1) != 1)
		big = big << 8 | big >> 8;
	memcpy(samples, &big, sizeof(big));
}

static void take_samples(struct cursor *cursor, int16_t *samples, int32_t count)
{
	const size_t left = cursor->at < cursor->size ? (cursor->size - cursor->at) / sizeof(int16_t) : 0;
	const int32_t whole = left < (size_t)count ? (int32_t)left : count;
	const uint8_t *at = cursor->bytes + cursor->at;
	int32_t done = 0;

	for (; done + TOGETHER <= whole; done += TOGETHER)
		turn_together(samples + done, at + sizeof(int16_t) * (size_t)done);
	cursor->at += sizeof(int16_t) * (size_t)done;
	for (int32_t i = done; i < count; i++)
		samples[i] = (int16_t)lcm_codec_take(cursor, sizeof(int16_t));
}

/* Ticks of a sensor that are there to the last sample; at is where the cursor was behind its Z. */
static int64_t whole_ticks(const droptower_drop *drop, size_t size, size_t at)
{
	size_t missing = at > size ? at - size : 0, z = sizeof(int16_t) * (size_t)drop->yz_count;
	size_t tick = sizeof(int16_t) * WIRE_YZ_PER_TICK;

	return missing > z ? 0 : (int64_t)((z - missing) / tick);
}

/* Ticks from the first that is not whole on are a gap more. */
static void add_gap(droptower_drop *drop, int8_t sensor, int64_t ticks)
{
	if (ticks * WIRE_YZ_PER_TICK >= drop->yz_count)
		return;
	drop->gap_sensor[drop->gap_count] = sensor;
	drop->gap_first_tick_ms[drop->gap_count] = (int64_t)((uint64_t)drop->first_tick_ms + (uint64_t)ticks);
	drop->gap_last_tick_ms[drop->gap_count] = drop->last_tick_ms;
	drop->gap_count++;
}

/* Ticks that are whole of the first sensor. */
static int64_t decode_arrays(const uint8_t *bytes, size_t size, droptower_drop *drop)
{
	struct cursor cursor = {bytes, size, GAP_COUNT + 4};
	int64_t s1, s2;

	for (int32_t i = 0; i < drop->gap_count; i++)
		drop->gap_sensor[i] = (int8_t)lcm_codec_take(&cursor, 1);
	for (int32_t i = 0; i < drop->gap_count; i++)
		drop->gap_first_tick_ms[i] = lcm_codec_take(&cursor, 8);
	for (int32_t i = 0; i < drop->gap_count; i++)
		drop->gap_last_tick_ms[i] = lcm_codec_take(&cursor, 8);
	cursor.at += 8;
	take_samples(&cursor, drop->s1_x, drop->x_count);
	take_samples(&cursor, drop->s1_y, drop->yz_count);
	take_samples(&cursor, drop->s1_z, drop->yz_count);
	s1 = whole_ticks(drop, size, cursor.at);
	take_samples(&cursor, drop->s2_x, drop->x_count);
	take_samples(&cursor, drop->s2_y, drop->yz_count);
	take_samples(&cursor, drop->s2_z, drop->yz_count);
	s2 = whole_ticks(drop, size, cursor.at);
	add_gap(drop, 1, s1);
	add_gap(drop, 2, s2);
	return s1;
}

int lcm_codec_decode_drop(const void *bytes, size_t size, bool cut, droptower_drop *drop)
{
	droptower_drop decoded = {0}, counts = {0};
	size_t whole = size > INT_MAX ? 0 : announced(bytes, size, &counts);

	if (whole == 0 || (cut ? size >= whole : size != whole) || whole > DROP_BYTES_MAX ||
	    !decode_fixed(bytes, &decoded))
		return DT_E_FORMAT;
	decoded.gap_count = counts.gap_count;
	decoded.x_count = counts.x_count;
	decoded.yz_count = counts.yz_count;
	if (!lcm_codec_allocate(&decoded, false)) {
		lcm_codec_free_drop(&decoded);
		return DT_E_MEMORY;
	}
	if (decode_arrays(bytes, size, &decoded) == 0 && cut) {
		lcm_codec_free_drop(&decoded);
		return DT_E_FORMAT;
	}
	*drop = decoded;
	return 0;
}
