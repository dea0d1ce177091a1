/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_TIMEBASE_H
#define DT_HOST_RECORD_TIMEBASE_H
/*
 * Where the rows of a time column lie on an even grid: at a place of their own each, with places between that
 * are empty where rows are missing. What lies on no such grid is refused, not averaged.
 *
 * In this order, e being a time less the straight line from first to last row:
 *   even      no e beyond a tenth of a step or the last printed digit
 *   rounded   printed too coarsely to see single steps, but no e beyond that digit: "uneven" to the record
 *   two rates a run of 8 steps and 2 % of the rows that differs from the median step by a tenth: refused
 *   missing   half of the steps or more are the median step, all others whole multiples of it, and the grid
 * so found is kept to the end. Of a column printed as coarsely as its steps only where rounding cannot be the
 * cause jitter    no e beyond half a step: "uneven" to the record otherwise refused: a clock that runs away
 * or jumps
 *
 * Memory of a found timebase belongs to the caller: timebase_free.
 */
#include <stdbool.h>
#include <stddef.h>

#include "common/error.h"
#include "host/record/record.h"

struct timebase {
	double step_s;
	bool uneven;
	size_t places;  /* with those of missing rows */
	size_t *place;  /* [rows], each beyond the one before; NULL where none is missing */
	size_t missing; /* rows */
};

/* Why there is none, and beside which row. */
struct timebase_fault {
	size_t row;
	char why[200];
};

/* Times of two rows and more. digit_s is what the last printed digit is worth; step_s the step that a header
 * tells, 0 if none does: times then only have to agree with it. DT_E_FORMAT with *fault, DT_E_MEMORY. */
DT_MUST_USE int timebase_find(const double *time_s, size_t rows, double digit_s, double step_s,
                              struct timebase *timebase, struct timebase_fault *fault);

/* Moves the samples of a channel of rows to their places; those between are lost. DT_E_MEMORY. */
DT_MUST_USE int timebase_spread(const struct timebase *timebase, struct channel *channel);

void timebase_free(struct timebase *timebase);

#endif
