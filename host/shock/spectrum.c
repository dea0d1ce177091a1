/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/shock/spectrum.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "host/shock/signal.h"

#define FROM_HZ 5.0
#define TO_HZ 2000.0
#define TO_RATE 0.25

enum { CURVES = SRS_SIDES + 2 };

static double slowest(const struct record *record)
{
	double rate = INFINITY;

	for (size_t i = 0; i < record->channel_count; i++)
		if (record->channels[i].rate_hz > 0)
			rate = fmin(rate, record->channels[i].rate_hz);
	return rate;
}

/* How many frequencies; 0 when they make no grid. */
static size_t grid(const struct record *record, const struct spectrum_options *options, double *from_hz)
{
	double to = options->to_hz > 0 ? options->to_hz : fmin(TO_HZ, TO_RATE * slowest(record));
	double from = options->from_hz > 0 ? options->from_hz : fmin(FROM_HZ, to / 2), steps;

	steps = floor(options->per_octave * log2(to / from) * (1 + 1e-12) + 1e-9);
	*from_hz = from;
	return steps >= 0 && steps < SPECTRUM_FREQUENCIES_MAX ? (size_t)steps + 1 : 0;
}

static int spectrum_allocate(struct spectrum *spectrum, const struct record *record, size_t count)
{
	size_t curves = 1 + CURVES * record->channel_count;
	double *next;

	spectrum->count = count;
	spectrum->channel_count = record->channel_count;
	spectrum->channel = calloc(record->channel_count + 1, sizeof(*spectrum->channel));
	spectrum->values = malloc(curves * count * sizeof(*spectrum->values));
	if (!spectrum->channel || !spectrum->values)
		return DT_E_MEMORY;
	for (size_t i = 0; i < curves * count; i++)
		spectrum->values[i] = NAN;
	spectrum->frequency_hz = next = spectrum->values;
	for (size_t i = 0; i < record->channel_count; i++) {
		for (unsigned side = 0; side < SRS_SIDES; side++)
			spectrum->channel[i].side[side] = next += count;
		for (unsigned part = 0; part < 2; part++)
			spectrum->channel[i].maximax[part] = next += count;
	}
	return 0;
}

/* From the oscillators' extremes to the curves; usable of the frequencies were computed. */
static void spectrum_draw(const struct srs_value *value, size_t usable, enum srs_part part,
                          struct spectrum_channel *out)
{
	for (size_t i = 0; i < usable; i++) {
		for (unsigned side = 0; side < SRS_SIDES; side++)
			out->side[side][i] = srs_pick(&value[i], (enum srs_side)side, part);
		out->maximax[0][i] = srs_pick(&value[i], SRS_MAXIMAX, SRS_PRIMARY);
		out->maximax[1][i] = srs_pick(&value[i], SRS_MAXIMAX, SRS_RESIDUAL);
	}
}

static int compute_channel(const struct spectrum *spectrum, const struct channel *channel,
                           const struct spectrum_options *options, struct srs_value *value,
                           struct spectrum_channel *out)
{
	size_t usable = spectrum->count;
	struct signal signal;
	int result;

	memcpy(out->name, channel->name, sizeof(out->name));
	out->rate_hz = channel->rate_hz;
	out->data_flags = channel->flags;
	result = signal_open(&signal, channel, options->keep_offset);
	if (result == DT_E_MEMORY)
		return result;
	if (result != 0) {
		out->flags = SIGNAL_REFUSED;
		return 0;
	}
	out->offset_g = signal.offset_g;
	out->bridged = signal.bridged;
	out->flags = signal.flags;
	out->data_flags = signal.data_flags;
	while (usable > 0 && spectrum->frequency_hz[usable - 1] > 0.5 * channel->rate_hz)
		usable--;
	if (usable < spectrum->count)
		out->flags |= SIGNAL_HALF_RATE;
	result = srs_compute(signal.value_g, signal.count, signal.rate_hz, spectrum->frequency_hz, usable,
	                     &options->srs, value);
	signal_close(&signal);
	if (result != 0)
		return result;
	spectrum_draw(value, usable, options->part, out);
	if (options->limit)
		out->verdict = limit_spectrum(options->limit, spectrum->frequency_hz,
		                              out->side[options->side], usable);
	return 0;
}

static int compute(struct spectrum *spectrum, const struct record *record,
                   const struct spectrum_options *options)
{
	struct srs_value *value = malloc((spectrum->count + 1) * sizeof(*value));
	int result = value ? 0 : DT_E_MEMORY;
	bool any = false;

	for (size_t i = 0; result == 0 && i < record->channel_count; i++) {
		result = compute_channel(spectrum, &record->channels[i], options, value,
		                         &spectrum->channel[i]);
		any |= !(spectrum->channel[i].flags & SIGNAL_REFUSED);
	}
	free(value);
	return result != 0 || any ? result : DT_E_EMPTY;
}

int spectrum_compute(const struct record *record, const struct spectrum_options *options,
                     struct spectrum *spectrum)
{
	struct spectrum computed = {0};
	double from_hz = 0;
	size_t count = options->frequency_hz != NULL ? options->frequencies : grid(record, options, &from_hz);
	int result;

	if (count == 0)
		return DT_E_ARGUMENT;
	result = spectrum_allocate(&computed, record, count);
	if (result == 0) {
		for (size_t i = 0; i < count; i++)
			computed.frequency_hz[i] = options->frequency_hz != NULL
			                                   ? options->frequency_hz[i]
			                                   : from_hz * exp2((double)i / options->per_octave);
		result = compute(&computed, record, options);
	}
	if (result != 0)
		spectrum_free(&computed);
	else
		*spectrum = computed;
	return result;
}

void spectrum_free(struct spectrum *spectrum)
{
	free(spectrum->values);
	free(spectrum->channel);
	*spectrum = (struct spectrum){0};
}

bool spectrum_passes(const struct spectrum *spectrum)
{
	for (size_t i = 0; i < spectrum->channel_count; i++)
		if (!(spectrum->channel[i].flags & SIGNAL_REFUSED) && !spectrum->channel[i].verdict.pass)
			return false;
	return true;
}
