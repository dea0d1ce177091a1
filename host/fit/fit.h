/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_FIT_FIT_H
#define DT_HOST_FIT_FIT_H
/*
 * The body of motion.h identified from the histories of one drop or several, by least squares with priors:
 * Levenberg-Marquardt, each drop's own unknowns eliminated (arrow-shaped normal equations), weights in three
 * stages, a scan of stiffness and mount, and several starts, of which the lowest sum of squares is taken.
 *
 * It knows no files. Samples are borrowed while a call lasts. Accelerations in g with the signs that the
 * model gives them (positive under the mat's push), angles in deg. Any thread.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "host/fit/motion.h"

enum { FIT_DROPS_MAX = 64, FIT_MESSAGE_MAX = 512 };

/* Unknowns of one drop. */
enum fit_own {
	FIT_ONSET_MS,
	FIT_GAMMA_DEG,
	FIT_LN_SPEED,
	FIT_MIX, /* S1 XX XY YX YY, S2 the same: what is added to the unit matrix */
	FIT_ZERO = FIT_MIX + 8,
	FIT_OWN = FIT_ZERO + MOTION_AXES
};

/* Those that drops share: the product's, and a gain of each channel. */
enum { FIT_GAIN = MOTION_SHARED, FIT_COMMON = FIT_GAIN + MOTION_AXES };

struct fit_channel {
	const double *value_g;
	const uint8_t *sample; /* 0: a good one; others are left out */
	size_t count;
	double rate_hz, start_s;
};

struct fit_drop {
	struct fit_channel axis[MOTION_AXES];
	double angle_deg, height_m; /* as set */
};

struct fit_options {
	double angle_sd_deg, speed_sd; /* of one drop around what was set; speed: relative */
	double gain_sd[2];             /* S1, S2: gains and cross-axis, of each drop anew */
	double common_gain_sd;         /* the same error in all drops, as a certificate tells it */
};
struct fit_options fit_options_usual(const struct scene *scene);

/* The windows of each channel that its residual is judged in. */
enum fit_window { FIT_BEFORE, FIT_FIRST_MS, FIT_CONTACT, FIT_TO_10_MS, FIT_TO_20_MS, FIT_RING, FIT_WINDOWS };
extern const char *const fit_window_names[FIT_WINDOWS];
extern const char *const fit_axis_names[MOTION_AXES];

enum fit_status {
	FIT_IDENTIFIED,
	FIT_NOT_IDENTIFIED, /* its bar is a third of its prior's or more, or no drop slides */
	FIT_BEYOND,         /* of what the prior allows: refused */
	FIT_ABSENT,         /* the product has no plate */
};

struct fit_drop_result {
	double own[FIT_OWN], sd[FIT_OWN];
	double derived[MOTION_DERIVED], derived_sd[MOTION_DERIVED];
	double pull; /* prior terms of angle, speed and mix */
};

struct fit_doubt {
	double window_z[MOTION_AXES][FIT_WINDOWS];
	double periodogram, periodogram_hz;
	int periodogram_axis;
	double pull;   /* the largest of a drop */
	double turned; /* the angle that is furthest from the one set, in its deviations */
	double turned_deg, set_deg;
	double group; /* of all drops' gains together; 0 with one drop */
	double moved; /* of a later drop: how far the product would have to differ */
	double chi2;  /* over samples */
	size_t samples;
	char words[FIT_MESSAGE_MAX]; /* "" none: the residual is content */
};

/* Angles at which the model was held against drops: no other is proposed. */
enum { FIT_JUDGED_FROM_DEG = 15, FIT_JUDGED_TO_DEG = 35, FIT_JUDGED_STEP_DEG = 5 };

/* The drop that tells most, of these angles, from the first drop's height or, where the tower can, half of
 * it. */
struct fit_next {
	double angle_deg, height_m;
	double d_gain;     /* what it adds to the log of the information's determinant */
	int largest;       /* parameter with the largest bar in terms of its prior; -1: all are identified */
	double largest_sd; /* of it after such a drop */
};

struct fit {
	struct scene scene; /* the start with what was found in it */
	unsigned drops;
	double common[FIT_COMMON], sd[FIT_COMMON], prior_sd[FIT_COMMON];
	enum fit_status status[MOTION_SHARED];
	double covariance[MOTION_SHARED][MOTION_SHARED]; /* in motion.h's coordinates; absent ones 0 */
	struct fit_drop_result drop[FIT_DROPS_MAX];
	double widened; /* all variances by so much, since gains scatter more than was said; 1: as they are */
	unsigned starts, agreed; /* starts that came within 0.1 of the lowest sum */
	struct fit_doubt doubt;
	struct fit_next next;
};

/* 0; DT_E_ARGUMENT: these drops or this scene cannot be fitted; DT_E_NUMERIC: nothing converged; DT_E_MEMORY;
 * message says what and why. A fit with doubt.words or a parameter FIT_BEYOND is no measurement: its bars do
 * not hold. */
DT_MUST_USE int fit_drops(const struct scene *start, const struct fit_drop *drops, unsigned count,
                          const struct fit_options *options, struct fit *fit, char message[FIT_MESSAGE_MAX]);

/* What a channel read, less its zero, and what the fit makes of it; time from the touch. */
struct fit_trace {
	unsigned axis;
	double time_s, measured_g, fitted_g;
};

/* Calls each for every sample that the fit of drop number k used, a channel after the other. start, drop and
 * options are what fit_drops had. 0; DT_E_MEMORY; DT_E_NUMERIC: nothing converged there. */
DT_MUST_USE int fit_traces(const struct fit *fit, unsigned k, const struct scene *start,
                           const struct fit_drop *drop, const struct fit_options *options,
                           void (*each)(void *context, const struct fit_trace *trace), void *context);

/* The drop of a scene with [fit], at its angle and height, and what the uncertainty of the parameters alone
 * makes of it. DT_E_ARGUMENT: the scene has no [fit]; DT_E_NUMERIC: it makes no drop. */
DT_MUST_USE int fit_predict(const struct scene *scene, double derived[MOTION_DERIVED],
                            double sd[MOTION_DERIVED]);

/* A later drop of a product whose scene has [fit]: its onset, angle, speed, gains and zeros, and the product
 * as far as [fit] leaves it open. What comes out has bars for all of that. With doubt.words it is no
 * measurement. */
struct fit_later {
	struct fit_drop_result drop;
	struct fit_doubt doubt;
};

/* 0; DT_E_ARGUMENT: such a drop or scene is of no use; DT_E_NUMERIC: no such product makes it; DT_E_MEMORY;
 * message says what and why. */
DT_MUST_USE int fit_later_drop(const struct scene *scene, const struct fit_drop *drop,
                               const struct fit_options *options, struct fit_later *later,
                               char message[FIT_MESSAGE_MAX]);

#endif
