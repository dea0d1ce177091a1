/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_SHOCK_SIGNAL_H
#define DT_HOST_SHOCK_SIGNAL_H
/*
 * A channel as a spectrum needs it: without holes and without offset, so that one bad sample cannot spoil all
 * of it. What was done is told; the record stays as it is.
 *
 * Holes (lost, bad, spike) of ten samples and less are bridged as the estimates bridge them (interpolate.h),
 * longer ones by a straight line where it is quiet: below a twentieth of the largest on both sides. Missing
 * samples at the ends are cut off.
 *
 * Zero is the estimates' (clean.h, baseline.h): offset, drift and hum before the pulse, flagged as there.
 */
#include "host/estimate/trace.h"

enum {
	SIGNAL_BRIDGED = 1u << 0,   /* "bridged": the spectrum rests on interpolated samples */
	SIGNAL_NO_OFFSET = 1u << 1, /* "offset_unknown": the record starts inside its event */
	SIGNAL_NOT_ENDED = 1u << 2, /* "not_ended": the last samples are beyond a twentieth of the largest */
	SIGNAL_REFUSED = 1u << 3,   /* "refused": by spectra, for the holes or for want of samples */
	SIGNAL_HALF_RATE = 1u << 4, /* "above_half_rate": by spectra whose frequencies go higher */
};

struct signal {
	double *value_g; /* [count], finite */
	size_t count;
	double rate_hz, start_s;
	double offset_g;     /* taken off, or found and kept; 0 when there is none */
	double noise_g;      /* per sample, before the event; of all of it when it starts inside; NAN when not
	                        known */
	size_t bridged;      /* samples */
	unsigned flags;      /* SIGNAL_* */
	unsigned data_flags; /* RECORD_FLAG_* of the channel as analysed */
};

/* Name of the lowest flag bit in flags; "" for 0. */
const char *signal_flag_name(unsigned flags);

/* 0; DT_E_EMPTY without good samples; DT_E_INCOMPLETE when a hole is too long, or more than a tenth of the
 * samples are missing; DT_E_MEMORY. Freed by signal_close after success. */
DT_MUST_USE int signal_open(struct signal *signal, const struct channel *channel, bool keep_offset);
void signal_close(struct signal *signal);

#endif
