/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/timebase.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/base/mapped.h"

/* Of a step. What a header's step is off may add up over the rows to DRIFT of them. */
static const double EVEN = 0.1, JITTER = 0.5, HEADER = 0.75, DRIFT = 0.01;

/* Of the last printed digit; beyond COARSE steps it hides single steps. */
static const double DIGIT = 1.01, DIGIT_SPREAD = 1.1, COARSE = 0.2;

/* Another level of steps. */
static const double LEVEL = 0.1, LEVEL_DIGITS = 1.5, RUN_PART = 0.02;
enum { RUN = 8 };

/* Single gaps of one row, of so many, are no rounding of a rate that is off by as much. */
static const double LONELY = 0.002;

/* Rows that are missing for each that is there: beyond it is no record with gaps. */
static const double MISSING_MOST = 10;

struct search {
	const double *time_s;
	size_t rows;
	double digit_s;
	double step_s;   /* mean */
	double median_s; /* of the steps */
	struct timebase_fault *fault;
};

__attribute__((format(printf, 3, 4))) static int timebase_refuse(const struct search *search, size_t row,
                                                                 const char *format, ...)
{
	va_list list;

	search->fault->row = row;
	va_start(list, format);
	vsnprintf(search->fault->why, sizeof(search->fault->why), format, list);
	va_end(list);
	return DT_E_FORMAT;
}

static double timebase_step(const struct search *search, size_t k)
{
	return search->time_s[k + 1] - search->time_s[k];
}

/* The largest distance from an even grid, and its row. */
static double worst_of(const struct search *search, double step_s, const size_t *place, size_t *row)
{
	double worst = 0;

	for (size_t k = 0; k < search->rows; k++) {
		double e =
		        fabs(search->time_s[k] - search->time_s[0] - (double)(place ? place[k] : k) * step_s);

		if (e > worst) {
			worst = e;
			*row = k;
		}
		record_seen(k, sizeof(double));
	}
	return worst;
}

static int timebase_compare(const void *a, const void *b)
{
	double x, y;

	memcpy(&x, a, sizeof(x));
	memcpy(&y, b, sizeof(y));
	return (x > y) - (x < y);
}

static double room_of(const struct search *search, double step_s)
{
	return fmax(EVEN * step_s, DIGIT * search->digit_s);
}

/* The median over two steps, which hides jitter, and from there the mean of the steps near it, which hides
 * rounding. Where that hides more than both, the median of the steps as they are. */
static int find_median(struct search *search)
{
	size_t count = search->rows - 1, near = 0, at = (count - 1) / 2;
	double sum_s = 0, *steps = malloc(count * sizeof(*steps));

	if (!steps)
		return DT_E_MEMORY;
	for (size_t k = 0; k < count; k++)
		steps[k] = timebase_step(search, k);
	qsort(steps, count, sizeof(*steps), timebase_compare);
	search->median_s = steps[at];
	if (count > 1 && search->digit_s <= COARSE * search->median_s) {
		for (size_t k = 0; k + 1 < count; k++)
			steps[k] = (timebase_step(search, k) + timebase_step(search, k + 1)) / 2;
		qsort(steps, count - 1, sizeof(*steps), timebase_compare);
		search->median_s = steps[(count - 2) / 2];
		for (size_t k = 0; k < count; k++)
			if (fabs(timebase_step(search, k) - search->median_s) <=
			    room_of(search, search->median_s)) {
				sum_s += timebase_step(search, k);
				near++;
			}
		search->median_s = near > 0 ? sum_s / (double)near : search->median_s;
	}
	free(steps);
	return 0;
}

static int check_order(const struct search *search, bool equal_allowed)
{
	for (size_t k = 1; k < search->rows; k++) {
		double before = search->time_s[k - 1], now = search->time_s[k];

		if (!(now > before) && !(equal_allowed && now >= before))
			return timebase_refuse(search, k, "time %.9g s after %.9g s, expected it to increase",
			                       now, before);
		record_seen(k, sizeof(double));
	}
	return 0;
}

/* ---- rows that are missing ---- */

/* Each row's place by the steps, in multiples of the median one; false where they are none. */
static bool place_rows(const struct search *search, size_t *place)
{
	double room = room_of(search, search->median_s);
	size_t single = 0;

	place[0] = 0;
	for (size_t k = 0; k + 1 < search->rows; k++) {
		double d = timebase_step(search, k), many = fmax(round(d / search->median_s), 1);

		if (fabs(d - many * search->median_s) > room ||
		    (double)place[k] + many > (MISSING_MOST + 1) * (double)search->rows)
			return false;
		single += many < 2;
		place[k + 1] = place[k] + (size_t)many;
	}
	return 2 * single >= search->rows - 1 && place[search->rows - 1] > search->rows - 1;
}

/* 1 if found, 0 if not, or DT_E_MEMORY. */
static int find_missing(const struct search *search, struct timebase *timebase)
{
	size_t *place = malloc(search->rows * sizeof(*place)), last = search->rows - 1, row = 0;
	double step_s, worst;

	if (!place)
		return DT_E_MEMORY;
	if (!place_rows(search, place)) {
		free(place);
		return 0;
	}
	step_s = (search->time_s[last] - search->time_s[0]) / (double)place[last];
	worst = worst_of(search, step_s, place, &row);
	if (worst > fmax(JITTER * step_s, DIGIT * search->digit_s)) {
		free(place);
		return 0;
	}
	*timebase = (struct timebase){.step_s = step_s,
	                              .uneven = worst > room_of(search, step_s),
	                              .places = place[last] + 1,
	                              .place = place,
	                              .missing = place[last] - last};
	return 1;
}

/* ---- two rates ---- */

/* Steps from k on that are of one level, which is not the median's. */
static size_t run_at(const struct search *search, size_t k)
{
	double level = timebase_step(search, k),
	       room = fmax(LEVEL / 2 * level, LEVEL_DIGITS * search->digit_s);
	size_t end = k;

	if (fabs(level - search->median_s) <= fmax(LEVEL * search->median_s, LEVEL_DIGITS * search->digit_s))
		return 0;
	while (end + 1 < search->rows && fabs(timebase_step(search, end) - level) <= room)
		end++;
	return end - k;
}

static int check_rates(const struct search *search)
{
	double least = fmax(RUN, RUN_PART * (double)search->rows);

	for (size_t k = 0; k + 1 < search->rows;) {
		size_t run = run_at(search, k);
		double level = run ? (search->time_s[k + run] - search->time_s[k]) / (double)run : 0;

		if ((double)run >= least)
			return timebase_refuse(
			        search, k ? k + 1 : run + 1,
			        "two rates: time steps by %.6g s (%.6g Hz) above and by %.6g s "
			        "(%.6g Hz) from here on, expected one: cut the file here",
			        k ? search->median_s : level, 1 / (k ? search->median_s : level),
			        k ? level : search->median_s, 1 / (k ? level : search->median_s));
		k += run ? run : 1;
	}
	return 0;
}

/* ---- columns printed as coarsely as their steps ---- */

/* The spread about the straight line of least squares. */
static double timebase_spread_of(const struct search *search, double *slope_s)
{
	double n = (double)search->rows, mean_t = 0, top = 0, low = INFINITY, high = -INFINITY;
	double below = n * (n * n - 1) / 12;

	for (size_t k = 0; k < search->rows; k++)
		mean_t += (search->time_s[k] - search->time_s[0]) / n;
	for (size_t k = 0; k < search->rows; k++)
		top += ((double)k - (n - 1) / 2) * (search->time_s[k] - search->time_s[0] - mean_t);
	*slope_s = top / below;
	for (size_t k = 0; k < search->rows; k++) {
		double e = search->time_s[k] - search->time_s[0] - (double)k * *slope_s;

		low = fmin(low, e);
		high = fmax(high, e);
	}
	return high - low;
}

/* 1 if found, 0 if not, or DT_E_*. */
static int find_coarse(const struct search *search, struct timebase *timebase)
{
	size_t twice = 0, more = 0, other = 0;
	double slope_s = 0, spread = timebase_spread_of(search, &slope_s);

	for (size_t k = 0; k + 1 < search->rows; k++) {
		double d = timebase_step(search, k) / search->median_s;

		twice += d > 1.5 && d <= 2.5;
		more += d > 2.5;
		other += d <= 0.75 || (d >= 1.25 && d <= 1.5);
	}
	if (more == 0 && twice + other > 2 && spread <= DIGIT_SPREAD * search->digit_s) {
		*timebase = (struct timebase){.step_s = slope_s, .uneven = true, .places = search->rows};
		return 1;
	}
	/* single gaps of one row only where no even clock makes them */
	if (other == 0 && (twice == 0 || (more == 0 && spread > DIGIT_SPREAD * search->digit_s &&
	                                  (double)twice <= LONELY * (double)search->rows)))
		return find_missing(search, timebase);
	return timebase_refuse(
	        search, 0,
	        "times printed to %.3g s at steps of %.3g s: rounding and missing rows cannot be told "
	        "apart, expected more digits, or name:unit@RATE without a time column",
	        search->digit_s, search->median_s);
}

/* ---- the order of it all ---- */

static int refuse_rest(const struct search *search)
{
	size_t row = 0;
	double room = room_of(search, search->median_s);

	for (size_t k = 0; k + 1 < search->rows; k++) {
		double d = timebase_step(search, k), many = fmax(round(d / search->median_s), 1);

		if (fabs(d - many * search->median_s) > room || many > MISSING_MOST * (double)search->rows)
			return timebase_refuse(
			        search, k + 1,
			        "time steps by %.6g s, others by %.6g s, expected one step and whole "
			        "multiples of it where rows are missing",
			        d, search->median_s);
	}
	(void)worst_of(search, search->step_s, NULL, &row);
	return timebase_refuse(search, row,
	                       "times are up to %.3g steps off an even grid of %.6g s, expected an even one",
	                       worst_of(search, search->step_s, NULL, &row) / search->step_s, search->step_s);
}

static int find_uneven(struct search *search, double worst, struct timebase *timebase)
{
	bool coarse;
	int found = find_median(search);

	if (found)
		return found;
	coarse = search->digit_s > COARSE * search->median_s;
	if (!coarse)
		found = check_rates(search);
	if (!found)
		found = coarse ? find_coarse(search, timebase) : find_missing(search, timebase);
	if (found)
		return found < 0 ? found : 0;
	if (worst > JITTER * search->step_s)
		return refuse_rest(search);
	*timebase = (struct timebase){.step_s = search->step_s, .uneven = true, .places = search->rows};
	return 0;
}

/* A header's step has few digits at times, and its column is rounded. */
static bool timebase_agrees(const struct search *search, double step_s)
{
	double steps = (double)(search->rows - 1);
	size_t row = 0;

	return fabs(search->step_s / step_s - 1) * steps < 1 + DRIFT * steps &&
	       worst_of(search, search->step_s, NULL, &row) <= fmax(HEADER * step_s, DIGIT * search->digit_s);
}

int timebase_find(const double *time_s, size_t rows, double digit_s, double step_s, struct timebase *timebase,
                  struct timebase_fault *fault)
{
	struct search search = {.time_s = time_s, .rows = rows, .digit_s = digit_s, .fault = fault};
	struct timebase found = {.places = rows};
	size_t row = 0;
	double worst, room;
	int error = check_order(&search, step_s > 0);

	if (error)
		return error;
	search.step_s = (time_s[rows - 1] - time_s[0]) / (double)(rows - 1);
	if (!isfinite(1 / search.step_s))
		return timebase_refuse(&search, rows - 1,
		                       "time column without a rate, expected it to increase");
	if (step_s > 0 && timebase_agrees(&search, step_s)) {
		found.step_s = step_s;
		*timebase = found;
		return 0;
	}
	if (step_s > 0)
		return timebase_refuse(&search, rows - 1,
		                       "time column steps by %.9g s, expected Delta_X = %.9g s, evenly",
		                       search.step_s, step_s);
	worst = worst_of(&search, search.step_s, NULL, &row);
	room = fmax(EVEN * search.step_s, digit_s <= COARSE * search.step_s ? DIGIT * digit_s : 0);
	if (worst <= room)
		found.step_s = search.step_s;
	else
		error = find_uneven(&search, worst, &found);
	if (!error)
		*timebase = found;
	return error;
}

/* From the last row on, so that none is overwritten. */
int timebase_spread(const struct timebase *timebase, struct channel *channel)
{
	size_t at, places;
	double *value;
	uint8_t *sample;

	if (!timebase->place || channel->count == 0)
		return 0;
	at = places = timebase->place[channel->count - 1] + 1;
	value = mapped_array_resize(channel->value_g, channel->count, places, sizeof(*value));
	sample = value ? mapped_array_resize(channel->sample, channel->count, places, 1) : NULL;
	channel->value_g = value ? value : channel->value_g;
	channel->sample = sample ? sample : channel->sample;
	if (!value || !sample)
		return DT_E_MEMORY;
	for (size_t k = channel->count; k-- > 0;) {
		while (at > timebase->place[k] + 1) {
			value[--at] = NAN;
			sample[at] = SAMPLE_LOST;
		}
		at = timebase->place[k];
		value[at] = value[k];
		sample[at] = sample[k];
	}
	channel->count = places;
	return 0;
}

void timebase_free(struct timebase *timebase)
{
	free(timebase->place);
	timebase->place = NULL;
}
