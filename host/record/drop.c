/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/drop.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/base/wide.h"
#include "common/crc.h"
#include "common/wire.h"
#include "common/wire_table.h"

static const char *const channel_names[DROP_CHANNELS] = {"S1X", "S1Y", "S1Z", "S2X", "S2Y", "S2Z"};

static bool parameters_agree(const struct record *record)
{
	return record->crc_known && record->parameters_held == RECORD_PARAMETERS_ALL &&
	       wire_parameters_crc32(record->parameters) == record->parameters_crc32;
}

double drop_range_g(const struct record *record)
{
	return (parameters_agree(record) ? record->parameters[WIRE_PARAMETER_range_counts]
	                                 : wire_parameters[WIRE_PARAMETER_range_counts].initial) /
	       (double)WIRE_COUNTS_PER_G;
}

int drop_open_unheld(struct record *record, uint32_t first_tick_ms, uint32_t last_tick_ms)
{
	uint32_t ticks = last_tick_ms - first_tick_ms + 1;

	if (ticks == 0 || ticks > DROP_TICKS_MAX)
		return DT_E_RANGE;
	record_init(record);
	record->is_drop = true;
	record->first_tick_ms = first_tick_ms;
	record->last_tick_ms = last_tick_ms;
	return 0;
}

int drop_open(struct record *record, uint32_t first_tick_ms, uint32_t last_tick_ms)
{
	uint32_t ticks = last_tick_ms - first_tick_ms + 1;
	struct record drop;
	int error = drop_open_unheld(&drop, first_tick_ms, last_tick_ms);

	if (error)
		return error;
	for (unsigned i = 0; i < DROP_CHANNELS; i++) {
		uint32_t per_tick = i % 3 == 0 ? WIRE_X_PER_TICK : WIRE_YZ_PER_TICK;
		struct channel *channel = record_add_channel(&drop, channel_names[i], 1000.0 * per_tick,
		                                             (size_t)ticks * per_tick);
		if (!channel) {
			record_free(&drop);
			return DT_E_MEMORY;
		}
		channel->range_g = drop_range_g(&drop);
	}
	drop_set_axes(&drop);
	*record = drop;
	return 0;
}

uint32_t drop_ticks(const struct record *record)
{
	return record->last_tick_ms - record->first_tick_ms + 1;
}

uint8_t drop_mark(const struct channel *channel, double value_g)
{
	return fabs(value_g) > channel->range_g ? SAMPLE_CLIPPED : 0;
}

/* Eight samples side by side, which the compiler does not make of a loop: a quarter of the instructions. */
enum { TOGETHER = 8 };
typedef int16_t eight_counts __attribute__((vector_size(TOGETHER * sizeof(int16_t))));
typedef uint8_t eight_marks __attribute__((vector_size(TOGETHER)));
typedef int32_t eight_wholes __attribute__((vector_size(TOGETHER * sizeof(int32_t))));
typedef int64_t eight_masks __attribute__((vector_size(TOGETHER * sizeof(int64_t))));
typedef double eight_values __attribute__((vector_size(TOGETHER * sizeof(double))));

static inline __attribute__((always_inline)) void put_eight(struct channel *channel, size_t at,
                                                            const int16_t *counts, int16_t most)
{
	static const eight_values nan = {NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN};
	const int16_t not_taken = WIRE_SAMPLE_NOT_TAKEN, bad = SAMPLE_BAD, beyond = SAMPLE_CLIPPED,
	              least = -most;
	eight_counts count, none, clipped;
	eight_masks value, hidden;
	eight_marks marks;

	memcpy(&count, counts, sizeof(count));
	none = count == not_taken;
	clipped = (count > most) | (count < least);
	marks = __builtin_convertvector((none & bad) | (clipped & ~none & beyond), eight_marks);
	/* by 32 bits, from which processors convert */
	value = (eight_masks)(__builtin_convertvector(__builtin_convertvector(count, eight_wholes),
	                                              eight_values) /
	                      WIRE_COUNTS_PER_G);
	hidden = __builtin_convertvector(none, eight_masks);
	value = (value & ~hidden) | ((eight_masks)nan & hidden);
	memcpy(channel->value_g + at, &value, sizeof(value));
	memcpy(channel->sample + at, &marks, sizeof(marks));
}

WIDE static void drop_put_axis(struct channel *channel, size_t at, const int16_t *counts, size_t count)
{
	/* the largest count within the range, as drop_mark has it */
	const double range = channel->range_g * WIRE_COUNTS_PER_G;
	const int16_t most = range < INT16_MAX ? (int16_t)range : INT16_MAX;
	size_t i = 0;

	for (; i + TOGETHER <= count; i += TOGETHER)
		put_eight(channel, at + i, counts + i, most);
	for (; i < count; i++) {
		double value_g = (double)counts[i] / WIRE_COUNTS_PER_G;

		if (counts[i] == WIRE_SAMPLE_NOT_TAKEN) {
			channel->value_g[at + i] = NAN;
			channel->sample[at + i] = SAMPLE_BAD;
		} else {
			channel->value_g[at + i] = value_g;
			channel->sample[at + i] = drop_mark(channel, value_g);
		}
	}
}

void drop_put(struct record *record, unsigned sensor, uint32_t tick, uint32_t ticks, const int16_t *x,
              const int16_t *y, const int16_t *z)
{
	struct channel *axes = record->channels + 3 * (size_t)(sensor - 1);

	drop_put_axis(&axes[0], (size_t)tick * WIRE_X_PER_TICK, x, (size_t)ticks * WIRE_X_PER_TICK);
	drop_put_axis(&axes[1], (size_t)tick * WIRE_YZ_PER_TICK, y, (size_t)ticks * WIRE_YZ_PER_TICK);
	drop_put_axis(&axes[2], (size_t)tick * WIRE_YZ_PER_TICK, z, (size_t)ticks * WIRE_YZ_PER_TICK);
}

static void get_axis(const struct channel *channel, size_t at, int16_t *counts, size_t count)
{
	for (size_t i = 0; i < count; i++) {
		double value = channel->value_g[at + i] * WIRE_COUNTS_PER_G;

		value += copysign(0.5, value); /* cut, it is rounded */
		counts[i] = fabs(value) < WIRE_SAMPLE_FULL_SCALE + 1 ? (int16_t)value : WIRE_SAMPLE_NOT_TAKEN;
	}
}

bool drop_is_count(double value_g)
{
	double value = value_g * WIRE_COUNTS_PER_G;

	return fabs(value) <= WIRE_SAMPLE_FULL_SCALE && value == round(value);
}

static bool is_lost(const struct record *record, unsigned sensor, uint32_t tick)
{
	const struct channel *x = record->channels + 3 * (size_t)(sensor - 1);

	return x->sample[(size_t)tick * WIRE_X_PER_TICK] & SAMPLE_LOST;
}

bool drop_get(const struct record *record, unsigned sensor, uint32_t tick, int16_t *x, int16_t *y, int16_t *z)
{
	const struct channel *axes = record->channels + 3 * (size_t)(sensor - 1);

	if (is_lost(record, sensor, tick))
		return false;
	get_axis(&axes[0], (size_t)tick * WIRE_X_PER_TICK, x, WIRE_X_PER_TICK);
	get_axis(&axes[1], (size_t)tick * WIRE_YZ_PER_TICK, y, WIRE_YZ_PER_TICK);
	get_axis(&axes[2], (size_t)tick * WIRE_YZ_PER_TICK, z, WIRE_YZ_PER_TICK);
	return true;
}

/* As the tower computes it: tick by tick, S1 then S2, the sample bytes of the packed block. */
static uint32_t samples_crc32(const struct record *record)
{
	uint32_t crc = CRC32_INIT;

	for (uint32_t tick = 0; tick < drop_ticks(record); tick++) {
		for (unsigned sensor = 1; sensor <= WIRE_SENSORS; sensor++) {
			struct wire_block block = {0};
			struct frame frame;

			drop_get(record, sensor, tick, block.x, block.y, block.z);
			wire_pack_block(&frame, WIRE_ID_BLOCK_S1, &block);
			crc = crc32(crc, frame.data + WIRE_SAMPLE_OFFSET, WIRE_SAMPLE_BYTES);
		}
	}
	return crc;
}

void drop_set_axes(struct record *record)
{
	for (size_t i = 0; i < record->channel_count; i++)
		for (unsigned k = 0; k < DROP_CHANNELS; k++)
			if (strcmp(record->channels[i].name, channel_names[k]) == 0) {
				record->channels[i].sensor = (uint8_t)(k / 3 + 1);
				record->channels[i].axis = channel_names[k][2];
			}
}

bool drop_has_channel(const struct record *record)
{
	for (size_t i = 0; i < record->channel_count; i++)
		if (record->channels[i].sensor > 0)
			return true;
	return false;
}

int drop_check(const struct record *record)
{
	bool equal = record->channel_count == DROP_CHANNELS;
	double range_g = drop_range_g(record);
	struct record drop;
	int error = drop_open(&drop, record->first_tick_ms, record->last_tick_ms);

	if (error)
		return error;
	for (size_t i = 0; i < DROP_CHANNELS && equal; i++)
		equal = strcmp(record->channels[i].name, drop.channels[i].name) == 0 &&
		        record->channels[i].count == drop.channels[i].count &&
		        (record->channels[i].range_g == range_g ||
		         record->channels[i].range_g == drop.channels[i].range_g);
	record_free(&drop);
	return equal ? 0 : DT_E_FORMAT;
}

void drop_capture_end(const struct record *record, struct frame *frame)
{
	struct wire_capture_end end = {
	        .drop_id = record->drop_id,
	        .marks = record->marks,
	        .first_tick_ms = record->first_tick_ms,
	        .last_tick_ms = record->last_tick_ms,
	        .crc32 = record->crc32,
	        .camera_frame = record->camera_frame,
	        .parameters_crc32 = record->parameters_crc32,
	        .seal = record->seal,
	};

	end.trigger_us = record->trigger_us;
	if (!isnan(record->trigger_s))
		end.trigger_us = (uint32_t)llround(record->trigger_s * 1e6);
	if (!isnan(record->frame_speed_m_s))
		end.frame_speed_mm_s = (uint16_t)lround(record->frame_speed_m_s * 1e3);
	wire_pack_capture_end(frame, WIRE_ID_CAPTURE_END, &end);
}

/* The parameters come behind the samples. */
static void set_range(struct record *record)
{
	double range_g = drop_range_g(record);

	for (size_t i = 0; i < record->channel_count; i++) {
		struct channel *channel = &record->channels[i];

		if (channel->range_g == range_g)
			continue;
		channel->range_g = range_g;
		for (size_t k = 0; k < channel->count; k++)
			if (!(channel->sample[k] & (SAMPLE_LOST | SAMPLE_BAD)))
				channel->sample[k] = drop_mark(channel, channel->value_g[k]);
	}
}

/* What follows from all that was filled in, held being the blocks that are there. */
static void judge(struct record *record, uint32_t held)
{
	struct frame end;

	if (record->counters.blocks > held)
		record->counters.blocks = held; /* of a file that ends before the last of them */
	drop_capture_end(record, &end);
	record->seal_agrees = record->seal_known && wire_check_capture_end(&end) == 0;
	if (!record->crc_known || record->parameters_held != RECORD_PARAMETERS_ALL)
		record->parameters_held = 0; /* nothing proves a part of the set */
	record->parameters_known = parameters_agree(record);
}

void drop_close_unheld(struct record *record, uint32_t held)
{
	record->crc_agrees &= record->crc_known && held == WIRE_SENSORS * drop_ticks(record);
	judge(record, held);
	record_finish(record);
}

int drop_close(struct record *record)
{
	uint32_t ticks = drop_ticks(record), held = 0;
	bool before = false;

	/* at worst every second tick of both sensors */
	record->gaps = calloc((size_t)ticks + WIRE_SENSORS, sizeof(*record->gaps));
	if (!record->gaps) {
		record_free(record);
		return DT_E_MEMORY;
	}
	for (unsigned sensor = 1; sensor <= WIRE_SENSORS; sensor++, before = false) {
		for (uint32_t tick = 0; tick < ticks; tick++) {
			bool lost = is_lost(record, sensor, tick);

			if (lost && !before)
				record->gaps[record->gap_count++] = (struct record_gap){
				        .sensor = sensor, .first_tick_ms = record->first_tick_ms + tick};
			if (lost)
				record->gaps[record->gap_count - 1].last_tick_ms =
				        record->first_tick_ms + tick;
			before = lost;
			held += !lost;
		}
	}
	record->crc_agrees = record->crc_known && record->gap_count == 0 &&
	                     (record->crc_agrees || samples_crc32(record) == record->crc32);
	drop_set_axes(record);
	judge(record, held);
	set_range(record);
	record_finish(record);
	return 0;
}
