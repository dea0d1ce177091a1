/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_ACCURACY_STAGE_H
#define DT_TESTS_ACCURACY_STAGE_H
/*
 * The stated signal: what a drop of known truth looks like, and what can be wrong with its record. S2 is a
 * pulse of 3 ms; S1 a damped oscillator driven by it, scaled and delayed so that the time between the peaks
 * is the one asked for. Built on tests/unit/synth.h; nothing of it is shared with host/.
 *
 * Onset uniform over the millisecond in which both rates' grids repeat, 150 ms of quiet before it, 60 ms
 * after, white Gaussian noise, steps of 1/32 g. Drop number n of a scene is always the same drop.
 */
#include <stdbool.h>

#include <gsl/gsl_rng.h>

#include "host/estimate/estimate.h"
#include "tests/unit/synth.h"

#define STAGE_PRE_S 0.150
#define STAGE_CONTACT_S 3e-3
#define STAGE_DAMPING 0.1
#define STAGE_DECAY_S 45e-3 /* of the free decay that the bounds count */

enum stage_geometry { STAGE_2A, STAGE_2B };
enum stage_channel { STAGE_S1X, STAGE_S1Y, STAGE_S1Z, STAGE_S2X, STAGE_S2Y, STAGE_S2Z, STAGE_CHANNELS };

struct scene {
	const char *name;
	enum synth_shape shape;
	enum stage_geometry geometry;
	enum estimate_family family; /* what the estimators are told */
	double noise_g;
	double x_peak_g;                   /* of S2; 0: 485.1 */
	double skew_s;                     /* Y after X */
	double offset_g, drift_g_s, hum_g; /* hum of 50 Hz, its phase by chance */
	unsigned spikes; /* of 300 g, in the decay of S1 X and Y; one on the front of S2's */
	double missing;  /* part of all samples */
	unsigned gap;    /* samples lost from 8 ms after the onset, S1 */
	unsigned lost_at_peak, zeroed_at_peak, nan_at_peak; /* samples of S2 X and Y nearest the peak */
	double clip_g;                                      /* 0: none */
	double second_part, second_hz; /* a second mode, its size and distance from the first */
	bool cut;                      /* the record ends 1 ms after the onset */
};

/* One axis of the product. */
struct stage_axis {
	double rate_hz;
	double s2_g;      /* S2's peak, signed */
	double skew_s;    /* onset after the drop's */
	double delay_s;   /* S1's oscillator after S2 */
	double gain;      /* S1 over the oscillator of a unit pulse */
	double s1_peak_s; /* after the onset of S2 */
};

struct stage {
	struct scene scene;
	double damped_hz, interval_s;
	double *plate, *second; /* synth_plate for a unit pulse; second NULL without a second mode */
	struct stage_axis axis[2];
	gsl_rng *random;
	double onset_s; /* of the present drop, X */
	struct record record;
};

enum { STAGE_TABLE = 33000 };

void stage_open(struct stage *stage, const struct scene *scene);
void stage_close(struct stage *stage);

/* Makes that drop: stage->record and stage->onset_s. */
void stage_drop(struct stage *stage, unsigned drop);

/* The signal without noise or disturbance. */
double stage_signal(const struct stage *stage, enum stage_channel channel, double time_s);

/* Whether a sample is there and shows the signal: what a bound may count. Not for `missing`. */
bool stage_keeps(const struct stage *stage, enum stage_channel channel, size_t k);

/* Standard deviation of a sample, with what the steps add. */
double stage_noise(const struct scene *scene);

double stage_rate(enum stage_channel channel);

#endif
