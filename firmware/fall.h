/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_FALL_H
#define DT_FIRMWARE_FALL_H
/*
 * The arithmetic of a fall from rest with constant acceleration: a travel s takes sqrt(2 s / a), so that sqrt
 * s grows evenly with time. With t1, t2 at the gates s1, s2 the time from t2 to s is (t2 - t1) (sqrt s - sqrt
 * s2) / (sqrt s2 - sqrt s1), whatever a is.
 *
 * Whole numbers only; any context; no state. Travels in um, times in us.
 */
#include <stdbool.h>
#include <stdint.h>

#include "firmware/parameter.h"

/* From the parameters alone. Times after the release. */
struct fall_plan {
	uint32_t upper_root, lower_root;      /* sqrt of the gates' travel in um, 16 fractional bits */
	uint32_t separation_q24, dampers_q24; /* the factor of (t2 - t1) for the two travels */
	uint32_t gate_first_us[2];            /* 7/8 of the free fall: nothing comes earlier */
	uint32_t gate_last_us[2];             /* twice the free fall */
	uint32_t fast_us, slow_us; /* time between the gates: less is no fall, more is a slow one */
	uint32_t gate_distance_um;
	uint32_t relief_us; /* free fall to the dampers where gravity is largest: no frame meets them earlier
	                     */
	uint32_t end_us;    /* twice the free fall to the dampers */
};

/* What happened, as far as `gates` and the flags say that it did. */
struct fall_times {
	uint32_t released_us;
	uint32_t upper_us, lower_us; /* t1, t2 */
	uint32_t magnet_off_us;      /* the edge, planned or made */
	uint32_t dropout_us;         /* that it was planned with */
	uint32_t keeper_us;          /* the product is free */
	uint8_t gates;               /* believed */
	bool magnet_planned, keeper_fell;
};

/* Where the frame was when the product left it. */
struct fall_state {
	uint32_t travel_um, speed_mm_s;
};

void fall_plan(struct fall_plan *plan, const struct parameters *parameters);

/* Rounded to the us. */
uint32_t fall_part(uint32_t time_us, uint32_t factor_q24);

/* Both gates believed. From them: the frame at a time; its acceleration, mm/s2; how long after the release
 * its motion began, negative when they say before. */
struct fall_state fall_at(const struct fall_plan *plan, const struct fall_times *times, uint32_t time_us);
uint32_t fall_acceleration(const struct fall_plan *plan, const struct fall_times *times);
int32_t fall_delay_us(const struct fall_plan *plan, const struct fall_times *times);

#endif
