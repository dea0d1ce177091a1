/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A record put right by its sensors' files.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "host/estimate/interpolate.h"
#include "host/sensor/sensors.h"

#define MATRIX_LEAST 0.1 /* of its determinant: less is no sensor */

/* ---- a copy ---- */

static int correct_copy(const struct record *record, struct record *copy)
{
	size_t gaps = record->gap_count * sizeof(*record->gaps);

	*copy = *record;
	copy->channels = NULL;
	copy->channel_count = 0;
	copy->gaps = NULL;
	for (size_t i = 0; i < record->channel_count; i++) {
		const struct channel *from = &record->channels[i];
		struct channel *to = record_add_channel(copy, from->name, from->rate_hz, from->count), kept;

		if (to == NULL)
			return DT_E_MEMORY;
		kept = *to;
		*to = *from;
		to->value_g = kept.value_g;
		to->sample = kept.sample;
		memcpy(to->value_g, from->value_g, from->count * sizeof(*to->value_g));
		memcpy(to->sample, from->sample, from->count);
	}
	if (gaps > 0) {
		copy->gaps = malloc(gaps);
		if (copy->gaps == NULL)
			return DT_E_MEMORY;
		memcpy(copy->gaps, record->gaps, gaps);
	}
	return 0;
}

/* ---- one channel ---- */

static double factor_of(const struct transducer *t, unsigned axis)
{
	double warm = 1.0 + t->calibration_temperature_percent_k / 100.0 *
	                            (t->chain_temperature_c - t->calibration_at_c);

	return TRANSDUCER_OF(t, chain_polarity_x, axis) * TRANSDUCER_OF(t, chain_scaled_x_mv_g, axis) /
	       (TRANSDUCER_OF(t, calibration_sensitivity_x_mv_g, axis) * t->chain_gain * warm);
}

static void correct_channel(struct record *record, struct channel *channel, const struct sensor_used *used,
                            unsigned axis)
{
	const struct transducer *t = &used->transducer;
	double factor = factor_of(t, axis);
	unsigned flags = (used->overdue ? RECORD_FLAG_OVERDUE : 0u) |
	                 (used->default_used ? RECORD_FLAG_DEFAULT_USED : 0u);

	for (size_t k = 0; k < channel->count; k++)
		channel->value_g[k] *= factor;
	channel->range_g *= fabs(factor);
	channel->start_s -= sensors_delay_s(t, axis);
	channel->highpass_s = t->chain_tau_s;
	channel->flags |= flags;
	record->flags |= flags;
}

/* ---- what an axis reads of the others ---- */

static bool invert(const double m[3][3], double inverse[3][3])
{
	double determinant = 0.0;

	for (int i = 0; i < 3; i++)
		for (int j = 0; j < 3; j++) {
			int a = (i + 1) % 3, b = (i + 2) % 3, c = (j + 1) % 3, d = (j + 2) % 3;

			inverse[j][i] = m[a][c] * m[b][d] - m[a][d] * m[b][c];
		}
	for (int j = 0; j < 3; j++)
		determinant += m[0][j] * inverse[j][0];
	for (int i = 0; i < 3; i++)
		for (int j = 0; j < 3; j++)
			inverse[i][j] /= determinant;
	return fabs(determinant) > MATRIX_LEAST;
}

static bool is_there(const struct trace *trace, ptrdiff_t k)
{
	return k >= 0 && (size_t)k < trace->count && trace_good(trace, (size_t)k);
}

/* The signal at t through four samples about it, or two; NAN where it is not known. */
static double correct_at(const struct trace *trace, double t, bool *clipped)
{
	double at = (t - trace->start_s) * trace->rate_hz, s;
	ptrdiff_t k = (ptrdiff_t)floor(at);
	const double *v = trace->value_g + k;

	s = at - (double)k;
	if (!is_there(trace, k) || (s > 0.0 && !is_there(trace, k + 1)))
		return (double)NAN;
	*clipped |= (trace->sample[k] & SAMPLE_CLIPPED) != 0;
	if (!(s > 0.0))
		return v[0];
	*clipped |= (trace->sample[k + 1] & SAMPLE_CLIPPED) != 0;
	if (!is_there(trace, k - 1) || !is_there(trace, k + 2))
		return v[0] + s * (v[1] - v[0]);
	return interpolate_at(trace, t);
}

/* Well between its ends: what is not known there was lost. */
static bool is_within(const struct trace *trace, double t)
{
	double at = (t - trace->start_s) * trace->rate_hz;

	return at >= 1.0 && at + 2.0 <= (double)trace->count;
}

/* A cut top stays marked, of this axis and of those that are taken off; where a sample of another axis is
 * lost, the sample is bad. */
static void correct_axis(struct channel *channel, const struct trace trace[3], const bool known[3],
                         size_t axis, const double row[3])
{
	const struct trace *own = &trace[axis];

	for (size_t k = 0; k < channel->count; k++) {
		bool clipped = (own->sample[k] & SAMPLE_CLIPPED) != 0;
		double value = row[axis] * own->value_g[k];

		if (!trace_good(own, k))
			continue;
		for (size_t j = 0; j < 3; j++)
			if (j != axis && known[j] && fabs(row[j]) > 0.0) {
				double other = correct_at(&trace[j], trace_time(own, k), &clipped);

				if (!isnan(other) || is_within(&trace[j], trace_time(own, k)))
					value += row[j] * other;
			}
		channel->value_g[k] = value;
		if (isnan(value)) {
			channel->sample[k] |= SAMPLE_BAD;
			channel->flags |= RECORD_FLAG_BAD;
		}
		if (clipped) {
			channel->sample[k] |= SAMPLE_CLIPPED;
			channel->flags |= RECORD_FLAG_CLIPPED;
		}
	}
}

static int correct_matrix(struct record *record, const struct transducer *t, const ptrdiff_t at[3])
{
	double m[3][3], inverse[3][3];
	struct trace trace[3];
	bool known[3] = {false, false, false};
	int result = 0;

	for (unsigned i = 0; i < 3; i++)
		for (unsigned j = 0; j < 3; j++)
			m[i][j] = transducer_reads(t, i, j);
	if (!invert((const double(*)[3])m, inverse))
		return DT_E_ARGUMENT;
	for (size_t i = 0; i < 3 && result == 0; i++)
		if (at[i] >= 0) {
			result = trace_open(&trace[i], &record->channels[at[i]], (double)-INFINITY,
			                    (double)INFINITY);
			known[i] = result == 0;
		}
	for (size_t i = 0; i < 3; i++) {
		if (result == 0 && known[i])
			correct_axis(&record->channels[at[i]], trace, known, i, inverse[i]);
		record->flags |= known[i] ? record->channels[at[i]].flags : 0u;
	}
	for (size_t i = 0; i < 3; i++)
		if (known[i])
			trace_close(&trace[i]);
	return result;
}

/* ---- all of it ---- */

static int correct_sensor(const struct sensor_used *used, struct record *record,
                          char message[SETTINGS_MESSAGE_MAX])
{
	const struct transducer *t = &used->transducer;
	ptrdiff_t at[3] = {-1, -1, -1};
	size_t found = 0;
	int result = 0;

	for (unsigned axis = 0; axis < TRANSDUCER_AXES; axis++)
		for (size_t i = 0; i < record->channel_count; i++)
			if (strcmp(record->channels[i].name, t->channel[axis]) == 0) {
				at[axis] = (ptrdiff_t)i;
				correct_channel(record, &record->channels[i], used, axis);
				found++;
			}
	if (found == 0) {
		snprintf(message, SETTINGS_MESSAGE_MAX, "sensor %s: none of its channels %.120s is there",
		         used->serial, t->sensor_channels);
		return DT_E_UNKNOWN;
	}
	if (t->has_matrix)
		result = correct_matrix(record, t, at);
	if (result == DT_E_ARGUMENT)
		snprintf(message, SETTINGS_MESSAGE_MAX, "sensor %s: its matrix cannot be inverted",
		         used->serial);
	return result;
}

/* A channel belongs to one sensor. */
static int correct_check(const struct sensors *sensors, char message[SETTINGS_MESSAGE_MAX])
{
	for (size_t s = 0; s < sensors->count; s++)
		for (unsigned i = 0; i < TRANSDUCER_AXES; i++) {
			const char *channel = sensors->used[s].transducer.channel[i];
			unsigned axis = 0;
			const struct sensor_used *first = sensors_of(sensors, channel, &axis);

			if (first == NULL || (first == &sensors->used[s] && axis == i))
				continue;
			snprintf(message, SETTINGS_MESSAGE_MAX, "sensors %s and %s: both name channel %s",
			         first->serial, sensors->used[s].serial, channel);
			return DT_E_ARGUMENT;
		}
	return 0;
}

int sensors_correct(const struct sensors *sensors, const struct record *record, struct record *corrected,
                    char message[SETTINGS_MESSAGE_MAX])
{
	int result = correct_check(sensors, message);

	if (result != 0)
		return result;
	result = correct_copy(record, corrected);
	for (size_t s = 0; s < sensors->count && result == 0; s++)
		result = correct_sensor(&sensors->used[s], corrected, message);
	if (result == DT_E_MEMORY)
		snprintf(message, SETTINGS_MESSAGE_MAX, "%s", error_text(result));
	if (result != 0)
		record_free(corrected);
	return result;
}
