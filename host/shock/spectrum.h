/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_SHOCK_SPECTRUM_H
#define DT_HOST_SHOCK_SPECTRUM_H
/*
 * The shock response spectra of a record, all channels at the same frequencies, each at its own rate (srs.h),
 * cleaned first (signal.h). A channel that cannot have one is flagged and its values are NAN; so are those at
 * frequencies above half its rate.
 *
 * The spectra belong to their owner: spectrum_compute, spectrum_free.
 */
#include "host/record/record.h"
#include "host/shock/limit.h"
#include "host/shock/srs.h"

enum { SPECTRUM_FREQUENCIES_MAX = 10000 };

struct spectrum_options {
	struct srs_options srs;
	enum srs_side side;
	enum srs_part part;
	double per_octave;
	double from_hz, to_hz;      /* 0: 5 Hz, and 2 000 Hz or a quarter of the slowest channel's rate */
	const double *frequency_hz; /* those instead of a grid; NULL: none */
	size_t frequencies;
	bool keep_offset;
	const struct limit_curve *limit; /* NULL: none */
};

struct spectrum_channel {
	char name[32];
	double rate_hz;
	double offset_g; /* of signal.h, as are the next two */
	size_t bridged;
	unsigned flags;          /* SIGNAL_* */
	unsigned data_flags;     /* RECORD_FLAG_* */
	double *side[SRS_SIDES]; /* [count]: of the part asked for */
	double *maximax[2];      /* [count]: primary and residual alone */
	struct limit_verdict verdict;
};

struct spectrum {
	double *frequency_hz;
	size_t count;
	struct spectrum_channel *channel;
	size_t channel_count;
	double *values; /* all of the above */
};

/* 0; DT_E_ARGUMENT: frequencies that make no grid (from not below to, more than SPECTRUM_FREQUENCIES_MAX);
 * DT_E_EMPTY when no channel can have a spectrum; DT_E_MEMORY. */
DT_MUST_USE int spectrum_compute(const struct record *record, const struct spectrum_options *options,
                                 struct spectrum *spectrum);
void spectrum_free(struct spectrum *spectrum);

/* Every channel that has a spectrum is within the limit. */
bool spectrum_passes(const struct spectrum *spectrum);

#endif
