/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/result/repeats.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <gsl/gsl_cdf.h>

enum { CHANGE_LEAST = 8, TREND_LEAST = 3 };
static const double MOVES_CHANCE = 0.0027, KOLMOGOROV = 1.63;

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

static int repeats_value(struct repeats_row *row, size_t number, double value)
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
	double sum = 0, squares = 0;

	for (size_t i = 0; i < row->count; i++)
		sum += row->value[i];
	row->mean = row->count > 0 ? sum / (double)row->count : NAN;
	for (size_t i = 0; i < row->count; i++)
		squares += (row->value[i] - row->mean) * (row->value[i] - row->mean);
	row->sd = row->count > 1 ? sqrt(squares / (double)(row->count - 1)) : NAN;
}

/* Sum of squares that the line leaves; INFINITY without one. */
static double repeats_line(struct repeats_row *row)
{
	double n = (double)row->count, middle = 0, across = 0, both = 0, left = 0, first;

	row->trend = row->sigma_trend = row->change = row->sigma_change = NAN;
	if (row->count < TREND_LEAST)
		return INFINITY;
	for (size_t i = 0; i < row->count; i++)
		middle += row->number[i] / n;
	for (size_t i = 0; i < row->count; i++) {
		across += (row->number[i] - middle) * (row->number[i] - middle);
		both += (row->number[i] - middle) * (row->value[i] - row->mean);
	}
	row->trend = both / across;
	for (size_t i = 0; i < row->count; i++) {
		double rest = row->value[i] - row->mean - row->trend * (row->number[i] - middle);

		left += rest * rest;
	}
	row->sigma_trend = sqrt(left / (n - 2) / across);
	row->moves = fabs(row->trend) > gsl_cdf_tdist_Qinv(MOVES_CHANCE / 2, n - 2) * row->sigma_trend;
	first = row->mean + row->trend * (row->number[0] - middle);
	row->change = row->trend * (row->number[row->count - 1] - row->number[0]) / first;
	row->sigma_change = fabs(row->sigma_trend * (row->number[row->count - 1] - row->number[0]) / first);
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

void repeats_close(struct repeats *repeats)
{
	for (size_t i = 0; i < repeats->rows; i++) {
		struct repeats_row *row = &repeats->row[i];

		repeats_mean(row);
		repeats_change(row, repeats_line(row));
	}
}

void repeats_free(struct repeats *repeats)
{
	for (size_t i = 0; i < repeats->rows; i++) {
		free(repeats->row[i].value);
		free(repeats->row[i].number);
	}
	free(repeats->row);
	*repeats = (struct repeats){.row = NULL};
}
