/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/lcm_codec.h"

#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/wire.h"
#include "host/record/drop.h"

static int block_sensor(uint32_t id)
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
	int sensor = block_sensor(frame->id);
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

static bool fits(int64_t value, int64_t max)
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

	if (block->sensor < 1 || block->sensor > WIRE_SENSORS || !fits(block->drop_id, UINT16_MAX) ||
	    !fits(block->tick_ms, UINT32_MAX) || !fits(block->status, UINT8_MAX) ||
	    !fits(block->io, UINT16_MAX))
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
	state->utime = frame->time_us;
	state->state = status.state;
	state->fault = status.fault;
	state->checks = status.checks;
	state->drop_id = status.drop_id;
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
	drop->trigger_us = isnan(record->trigger_s) ? -1 : llround(record->trigger_s * 1e6);
	drop->crc32 = record->crc32;
	drop->crc_known = record->crc_known;
	drop->crc_agrees = record->crc_agrees;
	drop->frame_speed_mm_s =
	        isnan(record->frame_speed_m_s) ? 0 : (int32_t)lround(record->frame_speed_m_s * 1e3);
	drop->camera_frame = record->camera_frame;
	drop->blocks = (int64_t)counters->blocks;
	drop->repeated = (int64_t)counters->repeated;
	drop->reordered = (int64_t)counters->reordered;
	drop->corrupt = (int64_t)counters->corrupt;
	drop->gaps = (int64_t)counters->gaps;
	drop->resent = (int64_t)counters->resent;
	drop->conflicting = (int64_t)counters->conflicting;
}

static bool allocate(droptower_drop *drop)
{
	size_t gaps = (size_t)drop->gap_count + 1, x = (size_t)drop->x_count, yz = (size_t)drop->yz_count;

	drop->gap_sensor = calloc(gaps, sizeof(*drop->gap_sensor));
	drop->gap_first_tick_ms = calloc(gaps, sizeof(*drop->gap_first_tick_ms));
	drop->gap_last_tick_ms = calloc(gaps, sizeof(*drop->gap_last_tick_ms));
	drop->s1_x = calloc(x, sizeof(int16_t));
	drop->s1_y = calloc(yz, sizeof(int16_t));
	drop->s1_z = calloc(yz, sizeof(int16_t));
	drop->s2_x = calloc(x, sizeof(int16_t));
	drop->s2_y = calloc(yz, sizeof(int16_t));
	drop->s2_z = calloc(yz, sizeof(int16_t));
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
	message.gap_count = (int32_t)record->gap_count;
	message.x_count = (int32_t)(drop_ticks(record) * WIRE_X_PER_TICK);
	message.yz_count = (int32_t)(drop_ticks(record) * WIRE_YZ_PER_TICK);
	if (!allocate(&message)) {
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

static bool message_fits(const droptower_drop *drop)
{
	int64_t ticks;

	if (!fits(drop->first_tick_ms, UINT32_MAX) || !fits(drop->last_tick_ms, UINT32_MAX))
		return false;
	ticks = (uint32_t)(drop->last_tick_ms - drop->first_tick_ms + 1);
	return fits(drop->drop_id, UINT16_MAX) && fits(drop->marks, UINT16_MAX) &&
	       drop->gap_count <= ticks + WIRE_SENSORS && drop->trigger_us <= UINT32_MAX &&
	       fits(drop->crc32, UINT32_MAX) && fits(drop->frame_speed_mm_s, UINT16_MAX) &&
	       drop->x_count == ticks * WIRE_X_PER_TICK && drop->yz_count == ticks * WIRE_YZ_PER_TICK;
}

static bool in_gap(const droptower_drop *drop, unsigned sensor, uint32_t tick_ms)
{
	for (int32_t i = 0; i < drop->gap_count; i++)
		if (drop->gap_sensor[i] == (int)sensor &&
		    tick_ms - (uint32_t)drop->gap_first_tick_ms[i] <=
		            (uint32_t)drop->gap_last_tick_ms[i] - (uint32_t)drop->gap_first_tick_ms[i])
			return true;
	return false;
}

static void fill_record(const droptower_drop *drop, struct record *record)
{
	record->drop_id = (uint16_t)drop->drop_id;
	record->marks = (uint16_t)drop->marks;
	if (drop->trigger_us >= 0)
		record->trigger_s = (double)drop->trigger_us / 1e6;
	if (drop->frame_speed_mm_s)
		record->frame_speed_m_s = drop->frame_speed_mm_s / 1e3;
	record->crc32 = (uint32_t)drop->crc32;
	record->camera_frame = drop->camera_frame;
	record->crc_known = drop->crc_known != 0;
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

int lcm_codec_record(const droptower_drop *drop, struct record *record)
{
	struct record filled;
	int error;

	if (!message_fits(drop))
		return DT_E_RANGE;
	error = drop_open(&filled, (uint32_t)drop->first_tick_ms, (uint32_t)drop->last_tick_ms);
	if (error)
		return error;
	for (uint32_t tick = 0; tick < drop_ticks(&filled); tick++) {
		size_t x = (size_t)tick * WIRE_X_PER_TICK, yz = (size_t)tick * WIRE_YZ_PER_TICK;

		if (!in_gap(drop, 1, filled.first_tick_ms + tick))
			drop_put(&filled, 1, tick, drop->s1_x + x, drop->s1_y + yz, drop->s1_z + yz);
		if (!in_gap(drop, 2, filled.first_tick_ms + tick))
			drop_put(&filled, 2, tick, drop->s2_x + x, drop->s2_y + yz, drop->s2_z + yz);
	}
	fill_record(drop, &filled);
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

/* A count of an encoded message, or -1 beyond the end. A negative one reads as more than any message holds.
 */
static int64_t count_at(const uint8_t *bytes, size_t size, size_t at)
{
	if (size < 4 || at > size - 4)
		return -1;
	return (int64_t)bytes[at] << 24 | bytes[at + 1] << 16 | bytes[at + 2] << 8 | bytes[at + 3];
}

/* Whether the arrays that the counts announce fill the message. The offsets are those of drop.lcm. */
static bool counts_fit(const uint8_t *bytes, size_t size)
{
	enum {
		GAP_COUNT = 8 + 8 + 2 * 4 + 4 * 8 + 2 + 4 + 2 +
		            7 * 8, /* fingerprint, then utime to conflicting */
		GAP_BYTES = 1 + 8 + 8,
	};
	int64_t gaps = count_at(bytes, size, GAP_COUNT);
	size_t at = GAP_COUNT + 4 + (size_t)gaps * GAP_BYTES;
	int64_t x = gaps < 0 ? -1 : count_at(bytes, size, at);
	int64_t yz = x < 0 ? -1 : count_at(bytes, size, at + 4);

	return yz >= 0 && size == at + 8 + 2 * sizeof(int16_t) * (size_t)(x + 2 * yz);
}

int lcm_codec_decode_drop(const void *bytes, size_t size, droptower_drop *drop)
{
	droptower_drop decoded = {0};

	if (size > INT_MAX || !counts_fit(bytes, size))
		return DT_E_FORMAT;
	if (droptower_drop_decode(bytes, 0, (int)size, &decoded) != (int)size) {
		droptower_drop_decode_cleanup(&decoded);
		return DT_E_FORMAT;
	}
	*drop = decoded;
	return 0;
}
