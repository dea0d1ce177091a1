/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CHART_SYNTHETIC_H
#define DT_HOST_CHART_SYNTHETIC_H
/*
 * A drop whose truth is known, as a record, with everything that can be wrong with one: the one generator of
 * `droptower chart` and of tests/accuracy. S2 is a contact pulse of a family; S1 the exact response of a
 * damped oscillator to it, scaled and delayed so that its peak follows S2's by the interval asked for; Z a
 * part of X. Onset uniform over the millisecond in which both rates' grids repeat, white Gaussian noise,
 * quantisation. Formulae of its own: shares nothing with host/estimate, host/model or hil.
 *
 * The oscillator is carried exactly (state transition, input linear between SYNTHETIC_STEPS of the contact)
 * through the contact and in closed form afterwards. Times in s after the record's first instant.
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

enum synthetic_channel {
	SYNTHETIC_S1X,
	SYNTHETIC_S1Y,
	SYNTHETIC_S1Z,
	SYNTHETIC_S2X,
	SYNTHETIC_S2Y,
	SYNTHETIC_S2Z,
	SYNTHETIC_CHANNELS
};

enum { SYNTHETIC_STEPS = 2000 };

/* What a drop is; the parameters of one axis that a bound counts as unknown. */
struct synthetic_axis {
	double rate_hz;
	double peak_g;    /* of S2, signed */
	double onset_s;   /* after the drop's */
	double contact_s; /* foot to foot */
	double gain;      /* S1 over the response to a pulse of height 1 */
	double delay_s;   /* of S1 */
	double damped_hz, damping;
	double second_gain, second_delay_s, second_hz, second_damping; /* gain 0: no second mode */
};

struct synthetic_scene {
	unsigned long seed; /* scenes with one seed share their chances */
	enum synthetic_family family;
	double peak_g[2], plate_g[2]; /* X, Y: of S2, of S1; signed */
	double rate_hz[2];            /* of X; of Y and Z */
	double z_part;                /* Z over X */
	double contact_s, interval_s, damped_hz, damping;
	double skew_s;        /* Y's onset after X's */
	double pre_s, post_s; /* the record, before and after the earliest onset */
	double decay_s;       /* of the free decay that a bound counts; 0: all of it */
	double noise_g, step_g;
	double offset_g, drift_g_s; /* of the whole record */
	double shift_g;             /* zero shift that the impact leaves behind */
	double hum_g, hum_hz;       /* its phase by chance, the same on all channels, as from one supply */
	unsigned spikes;            /* in the decay of S1 X and Y; one before S2's pulse */
	double spike_g;
	double clip_g;                                      /* 0: none */
	double missing;                                     /* part of all samples, by chance */
	unsigned gap;                                       /* samples lost from 5 ms after the contact, S1 */
	unsigned lost_at_peak, zeroed_at_peak, nan_at_peak; /* samples of S2 X and Y nearest the peak */
	bool cut;                                           /* the record ends 1 ms after the onset */
	double second_part; /* a second mode, its size and distance from the first */
	double second_apart_hz;
	double jitter_s; /* standard deviation of each sample's instant */
};

/* The study's box at 25 degrees, plate of 129 Hz; noise 1 g, nothing wrong. */
struct synthetic_scene synthetic_scene(void);

/* X and Y where there are two. */
struct synthetic_truth {
	double peak_g[2], peak_s[2]; /* S2 */
	double z_peak_g;
	double resultant_g, resultant_s;
	double plate_g[2], plate_s[2]; /* S1 */
	double plate_resultant_g, plate_resultant_s;
	double lag_s[2];
	double damped_hz, natural_hz, damping;
	double contact_s, width_s, velocity_m_s; /* S2 X; the width at a tenth of the height */
};

/* One axis ready to be looked at. */
struct synthetic_signal {
	enum synthetic_family family;
	struct synthetic_axis axis;
	double *response, *second;        /* [SYNTHETIC_STEPS + 1] during the contact; second NULL without */
	double state[2], second_state[2]; /* where the contact ends: displacement and velocity */
};

struct synthetic {
	struct synthetic_scene scene;
	struct synthetic_signal signal[2];
	gsl_rng *random;
	double onset_s; /* of the present drop, X */
	struct record record;
	struct synthetic_truth at_zero; /* truth of a drop whose onset is 0 */
};

/* DT_E_MEMORY. */
DT_MUST_USE int synthetic_open(struct synthetic *synthetic, const struct synthetic_scene *scene);
void synthetic_close(struct synthetic *synthetic);

/* That drop of the scene's seed, always the same: fills synthetic->record and onset_s. */
void synthetic_drop(struct synthetic *synthetic, unsigned long drop);

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

/* When S1 peaks after the drop's onset, and how long after S2. */
double synthetic_plate_summit(const struct synthetic_signal *signal);
double synthetic_lag(const struct synthetic_signal *signal);

/* The largest hypot of the two axes' pulses, and when. */
double synthetic_resultant(const struct synthetic_signal signal[2], double *at);

/* Pulse of base 1 and height 1; 0 outside. */
double synthetic_pulse(enum synthetic_family family, double s);
double synthetic_pulse_summit(enum synthetic_family family);
double synthetic_pulse_area(enum synthetic_family family);

/* A table of last + 1 values at a place between them, by the four around it. */
double synthetic_between(const double *y, size_t last, double place);

const char *synthetic_family_name(enum synthetic_family family);

#endif
