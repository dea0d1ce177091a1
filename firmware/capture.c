/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "firmware/capture.h"

#include "common/assert.h"
#include "common/crc.h"
#include "common/memory.h"
#include "firmware/sequence.h"

void capture_init(struct capture *capture, const struct parameters *parameters)
{
	memset(capture, 0, sizeof(*capture));
	capture->parameters = parameters;
}

void capture_release(struct capture *capture)
{
	capture->phase = CAPTURE_ROLLING;
	capture->count = 0;
}

const struct acquire_tick *capture_find(const struct capture *capture, uint32_t tick_ms)
{
	if (capture->newest_ms - tick_ms >= capture->count)
		return NULL;
	return &capture->ring[tick_ms % CAPTURE_TICKS];
}

static bool beyond(int16_t code, uint32_t level)
{
	return code != WIRE_SAMPLE_NOT_TAKEN && (uint32_t)(code < 0 ? -code : code) > level;
}

uint32_t capture_impact_us(const struct acquire_samples *s2, uint32_t level)
{
	uint32_t first_us = 1000;

	for (unsigned k = WIRE_X_PER_TICK; k-- > 0;)
		if (beyond(s2->x[k], level))
			first_us = (k * 1000u + WIRE_X_PER_TICK / 2) / WIRE_X_PER_TICK;
	for (unsigned k = 0; k < WIRE_YZ_PER_TICK; k++)
		if (beyond(s2->y[k], level) && k * 100u < first_us)
			first_us = k * 100u;
	return first_us;
}

static void open_window(struct capture *capture, uint32_t tick_ms, uint32_t offset_us)
{
	const uint32_t *value = capture->parameters->value;
	uint32_t before_ms = value[WIRE_PARAMETER_pre_trigger_ms];

	if (before_ms > capture->count)
		before_ms = capture->count;
	capture->phase = CAPTURE_TRIGGERED;
	capture->first_ms = tick_ms - before_ms;
	capture->last_ms = tick_ms + value[WIRE_PARAMETER_post_trigger_ms] - 1;
	capture->trigger_us = before_ms * 1000u + offset_us;
	capture->crc_ms = capture->first_ms;
	capture->crc32 = CRC32_INIT;
	capture->marks = 0;
	memset(capture->zero, 0, sizeof(capture->zero));
}

static void look_for_trigger(struct capture *capture, const struct acquire_tick *tick)
{
	uint32_t level = capture->parameters->value[WIRE_PARAMETER_trigger_counts];
	uint32_t offset_us;

	if (!sequence_separated(tick->status[0] & WIRE_STATUS_STATE))
		return;
	offset_us = capture_impact_us(&tick->sensor[1], level);
	capture->forced = offset_us >= 1000;
	if (!capture->forced)
		open_window(capture, tick->tick_ms, offset_us);
	else if (tick->marks & WIRE_MARK_NO_IMPACT)
		open_window(capture, tick->tick_ms, 0);
}

static void store(struct capture *capture, const struct acquire_tick *tick)
{
	DT_ASSERT(capture->phase < CAPTURE_FULL && capture->count <= CAPTURE_TICKS);
	capture->ring[tick->tick_ms % CAPTURE_TICKS] = *tick;
	capture->newest_ms = tick->tick_ms;
	if (capture->count < CAPTURE_TICKS)
		capture->count++;
	if (capture->phase == CAPTURE_TRIGGERED && tick->tick_ms == capture->last_ms)
		capture->phase = CAPTURE_FULL;
}

static void mark_triggered(const struct capture *capture, struct acquire_tick *tick)
{
	if (capture->phase == CAPTURE_ROLLING)
		return;
	for (unsigned s = 0; s < WIRE_SENSORS; s++)
		tick->status[s] |= WIRE_STATUS_TRIGGERED;
}

static void take_samples_away(struct acquire_tick *tick)
{
	tick->marks = WIRE_MARK_OVERRUN;
	for (unsigned s = 0; s < WIRE_SENSORS; s++) {
		tick->status[s] &= WIRE_STATUS_STATE;
		for (unsigned k = 0; k < WIRE_X_PER_TICK; k++)
			tick->sensor[s].x[k] = WIRE_SAMPLE_NOT_TAKEN;
		for (unsigned k = 0; k < WIRE_YZ_PER_TICK; k++)
			tick->sensor[s].y[k] = tick->sensor[s].z[k] = WIRE_SAMPLE_NOT_TAKEN;
	}
}

/* Fills the places of ticks that did not arrive between the newest and this one. */
static void store_lost(struct capture *capture, const struct acquire_tick *tick)
{
	struct acquire_tick lost = *tick;

	take_samples_away(&lost);
	mark_triggered(capture, &lost);
	while (capture->phase < CAPTURE_FULL && capture->newest_ms + 1 != tick->tick_ms) {
		lost.tick_ms = capture->newest_ms + 1;
		store(capture, &lost);
	}
}

void capture_put(struct capture *capture, struct acquire_tick *tick)
{
	if (capture->phase == CAPTURE_ROLLING && tick->tick_ms - capture->newest_ms > CAPTURE_TICKS)
		capture->count = 0; /* nothing to continue from */
	if (capture->count > 0)
		store_lost(capture, tick);
	if (capture->phase == CAPTURE_ROLLING)
		look_for_trigger(capture, tick);
	mark_triggered(capture, tick);
	if (capture->phase < CAPTURE_FULL)
		store(capture, tick);
}

static void add_zero(struct capture *capture, const struct acquire_tick *tick)
{
	for (unsigned i = 0; i < ACQUIRE_CHANNELS; i++) {
		unsigned count;
		const int16_t *code = acquire_channel(tick, i, &count);

		for (unsigned k = 0; k < count; k++) {
			if (code[k] == WIRE_SAMPLE_NOT_TAKEN)
				continue;
			capture->zero[i].sum += code[k];
			capture->zero[i].count++;
		}
	}
}

bool capture_zero_shift(const struct capture *capture, const int16_t before[ACQUIRE_CHANNELS], uint32_t limit)
{
	if (capture->parameters->value[WIRE_PARAMETER_post_trigger_ms] < CAPTURE_ZERO_AFTER_TICKS)
		return false;
	for (unsigned i = 0; i < ACQUIRE_CHANNELS; i++) {
		int32_t count = capture->zero[i].count;
		int32_t shift = count > 0 ? capture->zero[i].sum / count - before[i] : 0;

		if (shift > (int32_t)limit || -shift > (int32_t)limit)
			return true;
	}
	return false;
}

bool capture_work(struct capture *capture)
{
	const struct acquire_tick *tick = capture_find(capture, capture->crc_ms);
	struct frame frame;

	if ((capture->phase != CAPTURE_TRIGGERED && capture->phase != CAPTURE_FULL) || tick == NULL)
		return false;
	DT_ASSERT(capture->crc_ms - capture->first_ms <= capture->last_ms - capture->first_ms);
	for (unsigned s = 0; s < WIRE_SENSORS; s++) {
		acquire_pack(tick, s, 0, &frame);
		capture->crc32 = crc32(capture->crc32, frame.data + WIRE_SAMPLE_OFFSET, WIRE_SAMPLE_BYTES);
	}
	capture->marks |= tick->marks;
	if (capture->last_ms - capture->crc_ms < CAPTURE_ZERO_TICKS)
		add_zero(capture, tick);
	if (capture->crc_ms++ != capture->last_ms)
		return false;
	capture->phase = CAPTURE_COMPLETE;
	return true;
}
