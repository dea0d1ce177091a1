/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/result/repeats.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <gsl/gsl_cdf.h>
#include <gsl/gsl_fit.h>
#include <gsl/gsl_statistics_double.h>

enum { CHANGE_LEAST = 8, OUT_LEAST = 4, TREND_LEAST = 3 };
static const double MOVES_CHANCE = 0.0027, CHANGE_CHANCE = 0.01, OUT_CHANCE = 0.01;

/* 3 / d2 and D4 of ranges of two: 3 sqrt(pi) / 2, 1 + 3 sqrt(pi / 2 - 1). */
static const double CHART_VALUE = 2.6587, CHART_STEP = 3.2665;

/* What is worth a row, of each channel. */
static const struct {
	enum quantity_place place;
	const char *key;
} wanted[] = {{QUANTITY_AT_PEAK, "value_g"},
              {QUANTITY_AT_PULSE, "duration_s"},
              {QUANTITY_AT_PULSE, "velocity_change_m_s"},
              {QUANTITY_AT_RINGDOWN, "frequency_hz"},
              {QUANTITY_AT_RINGDOWN, "damping_ratio"},
              {QUANTITY_AT_RINGDOWN, "amplitude_g"},
              {QUANTITY_AT_RESULTANT, "peak_g"}};

const struct quantity *repeats_wanted(size_t i, enum quantity_place *place)
{
	if (i >= sizeof(wanted) / sizeof(wanted[0]))
		return NULL;
	*place = wanted[i].place;
	return quantity_find(quantity_homes[*place].object, wanted[i].key);
}

/* ---- taking in ---- */

struct repeats_row *repeats_row_new(struct repeats *repeats, const char *channel,
                                    const struct quantity *quantity)
{
	struct repeats_row *more = realloc(repeats->row, (repeats->rows + 1) * sizeof(*more));

	if (more == NULL)
		return NULL;
	repeats->row = more;
	more = &repeats->row[repeats->rows++];
	*more = (struct repeats_row){.quantity = quantity};
	snprintf(more->channel, sizeof(more->channel), "%s", channel);
	return more;
}

static struct repeats_row *repeats_row_of(struct repeats *repeats, const char *channel,
                                          const struct quantity *quantity)
{
	for (size_t i = 0; i < repeats->rows; i++)
		if (repeats->row[i].quantity == quantity && strcmp(repeats->row[i].channel, channel) == 0)
			return &repeats->row[i];
	return repeats_row_new(repeats, channel, quantity);
}

int repeats_value(struct repeats_row *row, size_t number, double value)
{
	if (row->count == row->room) {
		size_t room = row->room > 0 ? 2 * row->room : 16;
		double *values = realloc(row->value, room * sizeof(double)), *numbers;

		if (values == NULL)
			return DT_E_MEMORY;
		row->value = values;
		numbers = realloc(row->number, room * sizeof(double));
		if (numbers == NULL)
			return DT_E_MEMORY;
		row->number = numbers;
		row->room = room;
	}
	row->value[row->count] = value;
	row->number[row->count++] = (double)number;
	return 0;
}

int repeats_add(struct repeats *repeats, struct result *result)
{
	enum quantity_place place;
	const struct quantity *quantity;

	repeats->repeats++;
	for (size_t w = 0; (quantity = repeats_wanted(w, &place)) != NULL; w++) {
		const char *subject;
		void *object;

		for (size_t i = 0; (object = result_at(result, place, i, &subject)) != NULL; i++) {
			double value = quantity_number(quantity, object);
			bool ok = isfinite(value) && quantity_status(quantity, object) == ESTIMATE_OK;
			struct repeats_row *row = repeats_row_of(repeats, subject, quantity);

			if (row == NULL || (ok && repeats_value(row, repeats->repeats, value) != 0))
				return DT_E_MEMORY;
			row->left_out += !ok;
		}
	}
	return 0;
}

/* ---- what they say ---- */

static void repeats_mean(struct repeats_row *row)
{
	row->mean = row->count > 0 ? gsl_stats_mean(row->value, 1, row->count) : NAN;
	row->sd = row->count > 1 ? gsl_stats_sd_m(row->value, 1, row->count, row->mean) : NAN;
}

/* Sum of squares that the line leaves; INFINITY without one. */
static double repeats_line(struct repeats_row *row)
{
	double n = (double)row->count, span, first, begin, slope, variance, left, unused[2];

	row->trend = row->sigma_trend = row->change = row->sigma_change = NAN;
	if (row->count < TREND_LEAST)
		return INFINITY;
	gsl_fit_linear(row->number, 1, row->value, 1, row->count, &begin, &slope, &unused[0], &unused[1],
	               &variance, &left);
	row->trend = slope;
	row->sigma_trend = sqrt(variance);
	row->moves = fabs(row->trend) > gsl_cdf_tdist_Qinv(MOVES_CHANCE / 2, n - 2) * row->sigma_trend;
	first = begin + slope * row->number[0];
	span = row->number[row->count - 1] - row->number[0];
	row->change = row->trend * span / first;
	row->sigma_change = fabs(row->sigma_trend * span / first);
	return left;
}

/* What a count's last digit scatters at least, squared: neighbours differ by one of it or by nothing. */
static double repeats_rounding(const struct repeats_row *row)
{
	double least = INFINITY;

	for (size_t i = 0; i + 1 < row->count; i++) {
		double step = fabs(row->value[i + 1] - row->value[i]);

		least = step > 0 ? fmin(least, step) : least;
	}
	return least * least / 12;
}

/* ---- another from there on ---- */

double repeats_step_limit(size_t n)
{
	/* how many steps at one place each are as probable together: 2 10^6 ... 30 000 normal series each */
	static const double ln_n[] = {2.0794, 2.3026, 2.9957, 3.9318, 4.6052, 6.9078},
	                    as_many[] = {5.0, 6.7, 12.0, 20.8, 28.0, 57.0};
	double at = log((double)n), many;
	size_t i = 0;

	while (i + 2 < sizeof(ln_n) / sizeof(ln_n[0]) && at > ln_n[i + 1])
		i++;
	many = as_many[i] + (as_many[i + 1] - as_many[i]) * (at - ln_n[i]) / (ln_n[i + 1] - ln_n[i]);
	return gsl_cdf_tdist_Qinv(CHANGE_CHANCE / (2 * many), (double)n - 2);
}

static void repeats_change(struct repeats_row *row, double left_by_line)
{
	double n = (double)row->count, sum = 0, most = 0, left;
	size_t at = 0;

	row->change_at = 0;
	row->step_t = NAN;
	if (row->count < CHANGE_LEAST || !(row->sd > 0))
		return;
	for (size_t i = 1; i <= row->count - 2; i++) {
		double by_step, before = (double)i;

		sum += row->value[i - 1] - row->mean;
		by_step = sum * sum * n / (before * (n - before));
		if (i > 1 && by_step > most) {
			most = by_step;
			at = i;
		}
	}
	left = fmax(row->sd * row->sd * (n - 1) - most, 0);
	row->step_t = sqrt((n - 2) * most / fmax(left, n * repeats_rounding(row)));
	if (left < left_by_line && row->step_t > repeats_step_limit(row->count))
		row->change_at = (unsigned)row->number[at];
}

/* ---- which stands out ---- */

double repeats_grubbs(size_t n, double degrees, double alpha)
{
	double m = (double)n, t = gsl_cdf_tdist_Qinv(alpha / (2.0 * m), degrees - 1.0);

	return sqrt((m - 1.0) / m * degrees * t * t / (degrees - 1.0 + t * t));
}

static size_t repeats_farthest(const struct repeats_row *row)
{
	size_t at = 0;

	for (size_t i = 0; i < row->count; i++)
		if (fabs(row->value[i] - row->mean) > fabs(row->value[at] - row->mean))
			at = i;
	return at;
}

static void repeats_stands_out(struct repeats_row *row)
{
	double own = (double)row->count - 1, variance = row->sd * row->sd;
	bool others = row->degrees > own;
	size_t at = repeats_farthest(row), least = others ? OUT_LEAST - 1 : OUT_LEAST;

	row->stands_out = 0;
	if (row->count < least || !(row->sd > 0))
		return;
	variance = (others ? row->pooled : variance) + repeats_rounding(row);
	if (fabs(row->value[at] - row->mean) >
	    repeats_grubbs(row->count, others ? row->degrees : own, OUT_CHANCE) * sqrt(variance))
		row->stands_out = (unsigned)row->number[at];
}

/* ---- control chart ---- */

static void repeats_chart(struct repeats_row *row)
{
	double steps = 0;

	row->low = row->high = row->step = NAN;
	row->beyond = row->steps = 0;
	if (row->count < TREND_LEAST)
		return;
	for (size_t i = 0; i + 1 < row->count; i++)
		steps += fabs(row->value[i + 1] - row->value[i]);
	steps /= (double)row->count - 1;
	row->low = row->mean - CHART_VALUE * steps;
	row->high = row->mean + CHART_VALUE * steps;
	row->step = CHART_STEP * steps;
	for (size_t i = 0; i < row->count; i++) {
		row->beyond += row->value[i] < row->low || row->value[i] > row->high;
		row->steps += i > 0 && fabs(row->value[i] - row->value[i - 1]) > row->step;
	}
}

void repeats_row_close(struct repeats_row *row)
{
	repeats_mean(row);
	repeats_change(row, repeats_line(row));
	repeats_stands_out(row);
	repeats_chart(row);
}

void repeats_row_free(struct repeats_row *row)
{
	free(row->value);
	free(row->number);
	*row = (struct repeats_row){.count = 0};
}

void repeats_close(struct repeats *repeats)
{
	for (size_t i = 0; i < repeats->rows; i++)
		repeats_row_close(&repeats->row[i]);
}

void repeats_free(struct repeats *repeats)
{
	for (size_t i = 0; i < repeats->rows; i++)
		repeats_row_free(&repeats->row[i]);
	free(repeats->row);
	*repeats = (struct repeats){.row = NULL};
}
