/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_UNIT_H
#define DT_HOST_RECORD_UNIT_H
/*
 * Units as files and users spell them. Case, blanks, '^', '*', brackets within and apostrophes do not count;
 * a micro sign and a raised 2 in UTF-8 do as u and 2. Any context, no state, no memory.
 */
#include <stdbool.h>
#include <stddef.h>

enum unit_kind {
	UNIT_TIME,
	UNIT_ACCELERATION,
	UNIT_OTHER,    /* of something else: volt, newton, metre */
	UNIT_MULTIPLE, /* a number of units, or a range: no unit of a column */
};

struct unit {
	const char *name;
	enum unit_kind kind;
	double divisor; /* number / divisor = s or g; 0 for others */
	double scale;   /* of what a sensor gives: V or C in one of it; else 0 */
};

/* The unit that is the whole text; NULL for one that is not known. */
const struct unit *unit_find(const char *text, size_t length);

/* The same of what stands in brackets, which may be a number of them. */
const struct unit *unit_in_bracket(const char *text, size_t length);

/* Seconds of one of it, 1 where it tells no unit as formats have it that are in seconds; 0 for a unit of
 * something else.
 */
double unit_seconds(const char *text);

/* What the name of a column says of its unit: one in the last brackets, "Accel (g)" and "t [ms]"; of the kind
 * that is wanted one behind the last blank, comma or underscore, or the name itself. A bracket with a number
 * of units, "[10 g]", is UNIT_MULTIPLE. NULL where it says nothing.
 */
const struct unit *unit_of_name(const char *name, size_t length, enum unit_kind wanted);

/* Whether both make the same number of the same thing. */
bool unit_same(const struct unit *a, const struct unit *b);

/* How many hertz one of it is; 0 of what is no frequency. */
double unit_hertz(const struct unit *unit);

#endif
