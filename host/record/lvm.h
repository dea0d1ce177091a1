/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_LVM_H
#define DT_HOST_RECORD_LVM_H
/*
 * The headers of a LabVIEW measurement file: how its cells are written, and for each column its own step,
 * start, count of samples and unit. ("Specification for the LabVIEW Measurement File", National Instruments)
 *
 * Each value stands below its column: the first is the key's, which is X's. A column without a value is a
 * time column or a comment.
 */
#include "host/record/cells.h"
#include "host/record/columns.h"
#include "host/record/source.h"

struct lvm_column {
	double delta_s; /* 0 = not said */
	double start_s; /* X0 */
	bool has_samples;
	size_t samples;
	struct piece unit, dimension, date, time; /* borrowed from the source */
};

struct lvm {
	struct cells_style style;
	bool has_x; /* a time column stands first */
	bool multi; /* and one before each channel's */
	double x_divisor;
	struct lvm_column column[COLUMNS_MAX];
	size_t columns;
	uint64_t delta_line, samples_line, unit_line, dimension_line, stamp_line;
};

bool lvm_is(const struct source *source);

/* Steps behind the second header. */
DT_MUST_USE int lvm_read(struct lvm *lvm, const struct source *source, struct source_line *line,
                         char message[READ_MESSAGE_MAX]);

/* Whether what the user says of the columns can be what the headers say: units, rate, one beginning. */
DT_MUST_USE int lvm_check(const struct lvm *lvm, const struct columns *columns, const char *file,
                          char message[READ_MESSAGE_MAX]);

/* The step of the channel that a time column is of; 0 when not said. */
double lvm_time_step(const struct lvm *lvm, size_t time_column);

/* Whether a line begins another segment, with headers of its own. */
bool lvm_is_segment(const struct source_line *line);

#endif
