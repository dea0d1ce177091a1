/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/shock/band.h"

#include <math.h>
#include <string.h>

#include "host/estimate/baseline.h"
#include "host/estimate/cfc.h"
#include "host/estimate/filter.h"
#include "host/estimate/iepe.h"

size_t band_channel(const struct record *record, const struct analysis *analysis, const char *name)
{
	size_t best = record->channel_count;
	double most = 0;

	for (size_t i = 0; i < record->channel_count; i++) {
		double peak = fabs(analysis->channels[i].peak.value_g);

		if (name && strcmp(name, record->channels[i].name) == 0)
			return i;
		if (!name && peak > most) {
			most = peak;
			best = i;
		}
	}
	return best;
}

/* As the estimates have it, but for what they mark: a spike is outside the band. */
static int band_prepare(struct trace *trace, const struct estimate_baseline *baseline,
                        const struct estimate_options *estimate)
{
	int result = 0;

	baseline_remove(trace, baseline);
	if (estimate->iepe_time_constant_s > 0)
		iepe_undo(trace, baseline->from_s, estimate->iepe_time_constant_s);
	if (estimate->cfc > 0)
		result = cfc_filter(trace, estimate->cfc);
	if (result == 0 && estimate->lowpass_hz > 0)
		result = filter_lowpass(trace, estimate->lowpass_hz);
	return result;
}

int band_open(struct trace *trace, const struct record *record, const struct analysis *analysis,
              const struct estimate_options *estimate, size_t channel)
{
	int result = trace_open(trace, &record->channels[channel], -INFINITY, INFINITY);

	if (result != 0)
		return result;
	result = band_prepare(trace, &analysis->channels[channel].baseline, estimate);
	if (result != 0)
		trace_close(trace);
	return result;
}

int band_check(const struct record *record, const struct analysis *analysis,
               const struct estimate_options *estimate, const struct band_options *options, struct band *band)
{
	size_t i = band_channel(record, analysis, options->channel);
	struct band checked = {.at_peak = options->at_peak};
	const struct estimate_channel *e;
	struct trace trace;
	int result;

	if (i == record->channel_count)
		return options->channel ? DT_E_UNKNOWN : DT_E_EMPTY;
	e = &analysis->channels[i];
	checked.zero_s = options->at_peak ? e->peak.time_s : e->pulse.start_s;
	if (!isfinite(checked.zero_s))
		return DT_E_EMPTY;
	result = band_open(&trace, record, analysis, estimate, i);
	if (result != 0)
		return result;
	memcpy(checked.channel, record->channels[i].name, sizeof(checked.channel));
	checked.verdict = limit_pulse(options->curve, &trace, checked.zero_s);
	*band = checked;
	trace_close(&trace);
	return 0;
}
