/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_SHOCK_AXES_H
#define DT_HOST_SHOCK_AXES_H
/*
 * What of a record belongs to one sensor: channels whose names differ in their last letter only, x y z or
 * X Y Z, two of them at least; any other channel stands alone. Points into the record, takes no memory.
 *
 * A sensor's reading at one instant needs all of its axes: the one with the highest rate is the clock, the
 * others are read between their samples, straight.
 */
#include "host/record/record.h"

enum { AXES_MAX = 3 };

struct axes {
	char name[32]; /* what the names share, "xyz" when that is nothing; the channel's when alone */
	size_t count;  /* 1 when alone */
	const struct channel *axis[AXES_MAX]; /* [0] is the clock */
};

/* Fills axes, which has room for record->channel_count; returns how many. */
size_t axes_find(const struct record *record, struct axes *axes);

/* Instant of sample k of the clock. */
double axes_time(const struct axes *axes, size_t k);

/* All axes at sample k of the clock, less offset_g[]; false when one is not there. */
bool axes_read(const struct axes *axes, size_t k, const double offset_g[AXES_MAX], double value_g[AXES_MAX]);

/* The value of a channel that stands alone, with its sign, or the magnitude of a sensor. */
double axes_value(const struct axes *axes, const double value_g[AXES_MAX]);

#endif
