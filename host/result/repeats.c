/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/result/repeats.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <gsl/gsl_cdf.h>
#include <gsl/gsl_fit.h>
#include <gsl/gsl_statistics_double.h>

enum { CHANGE_LEAST = 8, TREND_LEAST = 3 };
static const double MOVES_CHANCE = 0.0027, KOLMOGOROV = 1.63, OUT_CHANCE = 0.01;

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

/* ---- taking in ---- */

static struct repeats_row *repeats_row_of(struct repeats *repeats, const char *channel,
                                          const struct quantity *quantity)
{
	struct repeats_row *more;

	for (size_t i = 0; i < repeats->rows; i++)
		if (repeats->row[i].quantity == quantity && strcmp(repeats->row[i].channel, channel) == 0)
			return &repeats->row[i];
	more = realloc(repeats->row, (repeats->rows + 1) * sizeof(*more));
	if (more == NULL)
		return NULL;
	repeats->row = more;
	more = &repeats->row[repeats->rows++];
	*more = (struct repeats_row){.quantity = quantity};
	snprintf(more->channel, sizeof(more->channel), "%s", channel);
	return more;
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
	repeats->repeats++;
	for (size_t w = 0; w < sizeof(wanted) / sizeof(wanted[0]); w++) {
		enum quantity_object which = quantity_homes[wanted[w].place].object;
		const struct quantity *quantity = quantity_find(which, wanted[w].key);
		const char *subject;
		void *object;

		for (size_t i = 0; (object = result_at(result, wanted[w].place, i, &subject)) != NULL; i++) {
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

	row->trend = row->sigma_trend = row->change = row->sigma_change = row->from = row->to = NAN;
	if (row->count < 2)
		return INFINITY;
	gsl_fit_linear(row->number, 1, row->value, 1, row->count, &begin, &slope, &unused[0], &unused[1],
	               &variance, &left);
	row->from = begin + slope * row->number[0];
	row->to = begin + slope * row->number[row->count - 1];
	if (row->count < TREND_LEAST)
		return INFINITY;
	row->trend = slope;
	row->sigma_trend = sqrt(variance);
	row->moves = fabs(row->trend) > gsl_cdf_tdist_Qinv(MOVES_CHANCE / 2, n - 2) * row->sigma_trend;
	first = row->from;
	span = row->number[row->count - 1] - row->number[0];
	row->change = row->trend * span / first;
	row->sigma_change = fabs(row->sigma_trend * span / first);
	return left;
}

/* Of one value, from the differences of neighbours (von Neumann), which no slow trend widens. */
static double repeats_scatter(const struct repeats_row *row)
{
	double squares = 0;

	for (size_t i = 0; i + 1 < row->count; i++)
		squares += (row->value[i + 1] - row->value[i]) * (row->value[i + 1] - row->value[i]);
	return sqrt(squares / (2 * (double)(row->count - 1)));
}

/* Where the cumulative sum is largest, if that is no chance, and a step fits better than the line does. */
static void repeats_change(struct repeats_row *row, double left_by_line)
{
	double n = (double)row->count, sum = 0, most = 0, scatter, left = 0, before = 0, after = 0;
	size_t at = 0;

	row->change_at = 0;
	if (row->count < CHANGE_LEAST)
		return;
	for (size_t i = 0; i + 1 < row->count; i++) {
		sum += row->value[i] - row->mean;
		if (fabs(sum) > most) {
			most = fabs(sum);
			at = i + 1;
		}
	}
	scatter = repeats_scatter(row);
	if (at == 0 || !(most > KOLMOGOROV * scatter * sqrt(n)) || !(most > 0))
		return;
	for (size_t i = 0; i < row->count; i++)
		*(i < at ? &before : &after) += row->value[i];
	before /= (double)at;
	after /= n - (double)at;
	for (size_t i = 0; i < row->count; i++) {
		double rest = row->value[i] - (i < at ? before : after);

		left += rest * rest;
	}
	if (left < left_by_line)
		row->change_at = (unsigned)row->number[at];
}

/* ---- which stands out ---- */

double repeats_grubbs(size_t n, double degrees, double alpha)
{
	double m = (double)n, t = gsl_cdf_tdist_Qinv(alpha / (2.0 * m), degrees - 1.0);

	return sqrt((m - 1.0) / m * degrees * t * t / (degrees - 1.0 + t * t));
}

/* Whether the others differ, each from each but for one pair. */
static bool repeats_scatters(const struct repeats_row *row, size_t but)
{
	size_t equal = 0;

	for (size_t i = 0; i < row->count; i++)
		for (size_t k = 0; k < i; k++)
			equal += i != but && k != but && !(fabs(row->value[i] - row->value[k]) > 0);
	return equal <= 1 && row->count > TREND_LEAST;
}

size_t repeats_farthest(const struct repeats_row *row, double *distance)
{
	size_t at = 0;

	*distance = 0.0;
	for (size_t i = 0; i < row->count; i++)
		if (fabs(row->value[i] - row->mean) > *distance) {
			*distance = fabs(row->value[i] - row->mean);
			at = i;
		}
	return at;
}

static void repeats_stands_out(struct repeats_row *row)
{
	double most;
	size_t at = repeats_farthest(row, &most);

	row->stands_out = 0;
	/* counts of a clock are equal but for their last digit: nothing is known of the scatter then */
	if (repeats_scatters(row, at) &&
	    most > repeats_grubbs(row->count, (double)row->count - 1.0, OUT_CHANCE) * row->sd)
		row->stands_out = (unsigned)row->number[at];
}

void repeats_words(const struct repeats_row *r, char words[REPEATS_WORDS_MAX])
{
	size_t used;

	words[0] = '\0';
	if (r->change_at > 0)
		snprintf(words, REPEATS_WORDS_MAX, "another from repeat %u on", r->change_at);
	else if (r->moves)
		snprintf(words, REPEATS_WORDS_MAX, r->change > 0 ? "rises" : "falls");
	else if (isfinite(r->trend))
		snprintf(words, REPEATS_WORDS_MAX, "no trend");
	used = strlen(words);
	if (r->stands_out > 0)
		snprintf(words + used, REPEATS_WORDS_MAX - used, "; repeat %u stands out", r->stands_out);
}

void repeats_row_close(struct repeats_row *row)
{
	repeats_mean(row);
	repeats_change(row, repeats_line(row));
	repeats_stands_out(row);
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
