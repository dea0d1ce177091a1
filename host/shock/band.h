/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_SHOCK_BAND_H
#define DT_HOST_SHOCK_BAND_H
/*
 * One channel's pulse against a tolerance band (limit.h): the samples as the analysis filters them, less the
 * offset it found, laid so that the band's time 0 is where the pulse leaves 10 % of its peak, or its peak.
 */
#include "host/estimate/estimate.h"
#include "host/shock/limit.h"

struct band_options {
	const struct limit_curve *curve;
	const char *channel; /* NULL: the one with the largest peak */
	bool at_peak;
};

struct band {
	char channel[32];
	bool at_peak;
	double zero_s; /* of the band, after the record's first instant */
	struct limit_verdict verdict;
};

/* 0; DT_E_UNKNOWN: no channel of that name; DT_E_EMPTY: no pulse to lay it on; DT_E_MEMORY. */
DT_MUST_USE int band_check(const struct record *record, const struct analysis *analysis,
                           const struct estimate_options *estimate, const struct band_options *options,
                           struct band *band);

/* The channel of that name, NULL: with the largest peak; channel_count when there is none. */
size_t band_channel(const struct record *record, const struct analysis *analysis, const char *name);

/* A channel's samples as above; closed by trace_close after success. */
DT_MUST_USE int band_open(struct trace *trace, const struct record *record, const struct analysis *analysis,
                          const struct estimate_options *estimate, size_t channel);

#endif
