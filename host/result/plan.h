/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RESULT_PLAN_H
#define DT_HOST_RESULT_PLAN_H
/*
 * A test plan: the limits that a drop is held against, from [limits] of a scene or from a preset by name.
 *
 *     [limits]
 *     channel = S2X                       of the keys that name none, of band, spectrum and preset
 *     preset = iec-60068-2-27-500g-1ms    a row of preset.def
 *     peak_percent = 20                   its tolerances, in place of the row's; duration_, velocity_, band_,
 *                                         transverse_
 *     guard = 1                           r: guard band over U
 *     chain_percent = 1.4                 standard uncertainty of the measuring chain, common to all samples
 *     S2X.peak.value_g = 400 600          lower and upper of anything in quantity.def, by its place in JSON;
 *     S1.peak_g = - 300                   a lone - is none
 *     S2X.peak.value_g = 500 +- 5         a check of the sensor: a reference and its U; met at |E_n| <= 1
 *     spectrum = 10:5:20 100:100:400      FREQUENCY_HZ:LOWER_G:UPPER_G, maximax, absolute acceleration
 *     spectrum_q = 10
 *     spectrum_share = 90                 percent of the frequencies that must be within
 *
 * Of peaks and velocity changes the magnitude counts. Long lists go on in lines that begin with blanks.
 */
#include "common/scenes/scene.h"
#include "host/result/quantity.h"
#include "host/shock/limit.h"

enum { PLAN_LIMITS_MAX = 16, PLAN_POINTS_MAX = 48 };

enum plan_shape { PLAN_HALF_SINE, PLAN_SAW_TOOTH, PLAN_TRAPEZOID };

struct plan_preset {
	const char *name;
	enum plan_shape shape;
	double peak_g, duration_ms;
	double peak_percent, velocity_percent, band_percent, transverse_percent;
	bool verified;
	const char *source;
};

/* The i-th; NULL behind the last. */
const struct plan_preset *plan_preset(size_t i);

/* The one of that name; NULL: none. */
const struct plan_preset *plan_preset_find(const char *name);

/* Area of the nominal pulse; from how high a fall has that speed. */
double plan_velocity_m_s(enum plan_shape shape, double peak_g, double duration_s);
double plan_height_m(double velocity_m_s);

/* The nominal pulse at t after its start, over its peak; and its width at 10 % of the peak, over its
 * duration. */
double plan_pulse(enum plan_shape shape, double t_over_duration);
double plan_width(enum plan_shape shape);

struct plan_limit {
	enum quantity_place place;
	char subject[32];
	const struct quantity *quantity;
	double lower, upper;       /* infinite: none; both the reference of a check */
	double reference_expanded; /* its U; 0: a limit */
};

struct plan {
	const struct plan_preset *preset; /* NULL: none */
	char channel[32];                 /* "": the one with the largest peak */
	double guard, chain;              /* chain: a share; NAN: not stated */
	struct plan_limit limit[PLAN_LIMITS_MAX];
	size_t count;
	double band_g, transverse; /* 0: none; transverse: a share */
	struct limit_point point[PLAN_POINTS_MAX];
	struct limit_curve spectrum; /* count 0: none */
	double q, share;
};

/* limits: as struct scene has them; "" is an empty plan. The plan stays where it is. 0, or DT_E_FORMAT with
 * "FILE:LINE: ..." in message. */
DT_MUST_USE int plan_read(struct plan *plan, const char *limits, const char *file,
                          char message[SCENE_MESSAGE_MAX]);
bool plan_is_empty(const struct plan *plan);

#endif
