/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_HUM_H
#define DT_HOST_ESTIMATE_HUM_H
/*
 * What moves zero: drift and hum, by least squares over the block means of the quiet part (quiet.h), each by
 * an F-test, and only where what is left is as white as the samples' noise asks. Drift needs 20 blocks, hum
 * 40, both at least four samples to the block. A part that has fewer is only tested: doubtful where the means
 * of up to 40 short blocks scatter by far more than what is within them.
 *
 * Hum is 50 or 60 Hz where that explains it. Where the means still scatter by more than chance, mains get
 * their true frequency, and up to three tones of any are added, from three cycles on to what the
 * means show folded once; the samples tell which of the two it is.
 *
 * Values in g, frequencies in Hz, half_s half the length of the quiet part. No memory but the caller's.
 */
#include "host/estimate/quiet.h"
#include "host/estimate/zero.h"

enum { HUM_TERMS_MAX = 2 + 2 * ZERO_HUMS_MAX }; /* offset, slope, cosine and sine of each hum */

/* Offset, then slope over half the quiet part if asked for, then cosine and sine of each hum. */
struct hum_line {
	bool has_slope;
	unsigned hums;
	double hum_hz[ZERO_HUMS_MAX];
	unsigned terms; /* in use; 0: neither drift nor hum */
	double term[HUM_TERMS_MAX];
	double squares; /* left, weighted */
	double slope_variance;
};

/* The slope, and the mains frequency that explains most if that is more than chance; no terms when neither
 * does, or when what is left is no noise: quiet->doubtful says which. The quiet part is taken in blocks, its
 * moments are those of what lies within reach. */
struct hum_line hum_find(struct quiet *quiet, double half_s, const struct quiet_moments *moments,
                         double reach);

/* Offset, drift and hums of a line into a baseline that has none yet; block_s is the length of a block. */
void hum_note(const struct hum_line *line, double half_s, double block_s, struct estimate_baseline *baseline);

#endif
