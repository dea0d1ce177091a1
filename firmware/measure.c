/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "firmware/measure.h"

#include "common/memory.h"

void measure_init(struct measure *measure, const struct parameters *parameters)
{
	memset(measure, 0, sizeof(*measure));
	measure->parameters = parameters;
}

void measure_forget(struct measure *measure)
{
	measure->learned = false;
}

uint16_t measure_us(int32_t time_us)
{
	return time_us < 0 || time_us > MEASURE_NONE ? MEASURE_NONE : (uint16_t)time_us;
}

uint32_t measure_dropout_us(const struct measure *measure)
{
	const uint32_t *value = measure->parameters->value;
	uint32_t middle = value[WIRE_PARAMETER_dropout_us], limit = value[WIRE_PARAMETER_dropout_limit_us];
	uint32_t least = middle > limit ? middle - limit : 0;

	if (!measure->learned)
		return middle;
	if (measure->learned_us < least)
		return least;
	return measure->learned_us > middle + limit ? middle + limit : measure->learned_us;
}

/* True when it is not the one that was learned before, or calibrated. */
static bool learn(struct measure *measure, uint32_t dropout_us)
{
	const uint32_t *value = measure->parameters->value;
	int32_t change_us = (int32_t)value[WIRE_PARAMETER_dropout_change_us];
	uint32_t known_us = measure->learned ? measure->learned_us : value[WIRE_PARAMETER_dropout_us];
	int32_t differs_us = (int32_t)(dropout_us - known_us);
	bool changed = differs_us > change_us || -differs_us > change_us;

	if (!measure->learned || changed)
		measure->learned_us = dropout_us;
	else
		measure->learned_us = (uint32_t)((int32_t)measure->learned_us + differs_us / 4);
	measure->learned = true;
	return changed;
}

/* The product has left the frame. In the dampers the frame does not fall any more: there its travel is not
 * known, only that it is late. */
static uint16_t separated(struct measure *measure, const struct fall_plan *plan,
                          const struct fall_times *times, struct wire_measured *measured)
{
	const uint32_t *value = measure->parameters->value;
	struct fall_state at = fall_at(plan, times, times->keeper_us);
	uint16_t marks = 0;

	measured->dropout_us = measure_us((int32_t)(times->keeper_us - times->magnet_off_us));
	if (at.travel_um <= value[WIRE_PARAMETER_dampers_um]) {
		measured->separation_um = at.travel_um;
		measured->separation_mm_s = (uint16_t)at.speed_mm_s; /* 7.4 m/s after 2.4 m */
	}
	if (at.travel_um > value[WIRE_PARAMETER_separation_um] + value[WIRE_PARAMETER_separation_late_um])
		marks |= WIRE_MARK_SEPARATED_LATE;
	if (measured->dropout_us != MEASURE_NONE && learn(measure, measured->dropout_us))
		marks |= WIRE_MARK_DROPOUT_CHANGED;
	return marks;
}

uint16_t measure_drop(struct measure *measure, const struct fall_plan *plan, const struct fall_times *times,
                      struct wire_measured *measured)
{
	uint16_t marks = 0;

	measured->dropout_us = measured->dropout_used_us = MEASURE_NONE;
	measured->separation_mm_s = MEASURE_NONE;
	measured->separation_um = UINT32_MAX;
	measured->acceleration_mm_s2 = measured->latch_delay_us = MEASURE_NONE;
	if (!times->magnet_planned) /* which takes both gates */
		return 0;
	measured->dropout_used_us = measure_us((int32_t)times->dropout_us);
	measured->acceleration_mm_s2 = (uint16_t)fall_acceleration(plan, times);
	measured->latch_delay_us = measure_us(fall_delay_us(plan, times));
	if (times->dropout_us != measure->parameters->value[WIRE_PARAMETER_dropout_us])
		marks |= WIRE_MARK_CALIBRATED;
	if (times->keeper_fell)
		marks |= separated(measure, plan, times, measured);
	return marks;
}
