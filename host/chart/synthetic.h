/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CHART_SYNTHETIC_H
#define DT_HOST_CHART_SYNTHETIC_H
/*
 * A drop whose truth is known, as a record, with everything that can be wrong with one. S2 is a contact
 * pulse of a family; S1 the exact response of a damped oscillator to it, scaled and delayed so that its
 * peak follows S2's by the interval asked for. X at 7 kHz and Y at 10 kHz unless asked otherwise, onset
 * uniform over the sample grid, white Gaussian noise, quantisation. Formulae of its own: shares nothing with
 * host/estimate or host/model.
 *
 * The oscillator is carried exactly (state transition, input linear between steps of 1 us) through the
 * contact and in closed form afterwards. Times in s after the record's first instant.
 */
#include <stdbool.h>

#include <gsl/gsl_rng.h>

#include "host/record/record.h"

enum synthetic_family {
	SYNTHETIC_HALF_SINE,
	SYNTHETIC_HAVERSINE,
	SYNTHETIC_HERTZ,         /* force as indentation^1.5, elastic */
	SYNTHETIC_HUNT_CROSSLEY, /* the same with loss: restitution 0.5, peak at a quarter */
	SYNTHETIC_FAMILIES
};

enum synthetic_channel { SYNTHETIC_S1X, SYNTHETIC_S1Y, SYNTHETIC_S2X, SYNTHETIC_S2Y, SYNTHETIC_CHANNELS };

/* What a drop is; the parameters of one axis that a bound counts as unknown. */
struct synthetic_axis {
	double rate_hz;
	double peak_g;    /* of S2 */
	double onset_s;   /* after the drop's */
	double contact_s; /* foot to foot */
	double gain;      /* S1 over the response to a pulse of height 1 */
	double delay_s;   /* of S1 */
	double damped_hz, damping;
	double second_gain, second_delay_s, second_hz, second_damping; /* gain 0: no second mode */
};

struct synthetic_scene {
	enum synthetic_family family;
	double peak_g[2], plate_g[2]; /* X, Y: of S2, of S1 */
	double rate_hz[2];
	double contact_s, interval_s, damped_hz, damping;
	double skew_s; /* Y's onset after X's */
	double pre_s, decay_s;
	double noise_g, step_g;
	double offset_g;      /* zero shift that the impact leaves behind */
	double hum_g, hum_hz; /* its phase by chance */
	unsigned spikes;      /* in each decay */
	double spike_g;
	double clip_g;  /* 0: none */
	double missing; /* part of all samples, by chance */
	unsigned lost;  /* run of samples lost: 8 ms after the onset in S1, and, at most 8, at S2's peak */
	double second_part; /* a second mode, its size and distance from the first */
	double second_apart_hz;
	double jitter_s; /* standard deviation of each sample's instant */
};

/* The study's box at 25 degrees, plate of 129 Hz; noise 1 g, nothing wrong. */
struct synthetic_scene synthetic_scene(void);

struct synthetic_truth {
	double peak_g, peak_s; /* S2 X */
	double resultant_g;    /* S2 */
	double plate_peak_g;   /* S1 X */
	double lag_s;          /* X */
	double damped_hz, damping;
	double contact_s, velocity_m_s; /* S2 X */
};

/* One axis ready to be looked at. */
struct synthetic_signal {
	enum synthetic_family family;
	struct synthetic_axis axis;
	double *response, *second; /* during the contact, steps of SYNTHETIC_STEP_S; second NULL without */
	double state[2], second_state[2]; /* where the contact ends: displacement and velocity */
	size_t steps;
};

struct synthetic {
	struct synthetic_scene scene;
	struct synthetic_signal signal[2];
	gsl_rng *random;
	double onset_s; /* of the present drop */
	struct record record;
};

#define SYNTHETIC_STEP_S 1e-6

/* DT_E_MEMORY. */
DT_MUST_USE int synthetic_open(struct synthetic *synthetic, const struct synthetic_scene *scene);
void synthetic_close(struct synthetic *synthetic);

/* That drop of that seed, always the same: fills synthetic->record and onset_s. */
void synthetic_drop(struct synthetic *synthetic, unsigned long seed, unsigned long drop);

/* Of the present drop. */
struct synthetic_truth synthetic_truth(const struct synthetic *synthetic);

/* Whether a sample is there and shows the signal; `missing` not counted. */
bool synthetic_keeps(const struct synthetic *synthetic, enum synthetic_channel channel, size_t k);

/* A signal for its own: DT_E_MEMORY. */
DT_MUST_USE int synthetic_signal_open(struct synthetic_signal *signal, enum synthetic_family family,
                                      const struct synthetic_axis *axis);
void synthetic_signal_close(struct synthetic_signal *signal);

/* Without noise, time_s after the drop's onset. */
double synthetic_box(const struct synthetic_signal *signal, double time_s);
double synthetic_plate(const struct synthetic_signal *signal, double time_s);

/* S1's peak, and its time after S2's. */
double synthetic_plate_peak(const struct synthetic_signal *signal);
double synthetic_lag(const struct synthetic_signal *signal);

/* The largest hypot of the two axes' pulses. */
double synthetic_resultant(const struct synthetic_signal signal[2]);

/* Pulse of base 1 and height 1. */
double synthetic_pulse(enum synthetic_family family, double s);
double synthetic_pulse_summit(enum synthetic_family family);
double synthetic_pulse_area(enum synthetic_family family);

/* A table of last + 1 values at a place between them, by the four around it. */
double synthetic_between(const double *y, size_t last, double place);

const char *synthetic_family_name(enum synthetic_family family);

#endif
