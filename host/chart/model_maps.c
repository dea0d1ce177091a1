/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/chart/model_maps.h"

#include <math.h>
#include <string.h>

#include <gsl/gsl_randist.h>
#include <gsl/gsl_rng.h>

#include "common/units.h"
#include "host/chart/model_numerics.h"
#include "host/chart/model_study.h"
#include "host/chart/reference.h"
#include "host/estimate/ringdown.h"
#include "host/model/contact.h"
#include "host/model/model.h"
#include "host/model/sdof.h"
#include "host/model/oscillator.h"

#define PULSE_S 0.003

/* ---- resonance --------------------------------------------------------------------------------------------
 */

double maps_steady_ratio(double pulse, double zeta)
{
	struct sdof sdof;
	double peak, when, steady, phase;

	if (sdof_init(&sdof, pulse / PULSE_S, zeta, 1, PULSE_S) || sdof_peak(&sdof, &peak, &when) ||
	    oscillator_steady(0.5 / pulse, zeta, &steady, &phase))
		return NAN;
	return steady / fabs(peak);
}

double maps_plain_transient(double apart, double zeta)
{
	double hz = 1 / (2 * PULSE_S * (1 - apart)), t = 0.8 * PULSE_S;
	struct sdof sdof;

	if (sdof_init(&sdof, hz, zeta, 1, PULSE_S))
		return NAN;
	return fabs(numerics_plain_half_sine(hz, zeta, PULSE_S, t) / sdof_motion(&sdof, t).z - 1);
}

/* ---- contact ----------------------------------------------------------------------------------------------
 */

double maps_rk4_restitution(double restitution, double step_share)
{
	enum { PHASES = 40 };
	struct contact_law law;
	double worst = restitution;

	if (contact_law_init(&law, restitution))
		return NAN;
	for (int i = 0; i < PHASES; i++) {
		double e =
		        numerics_rk4_restitution(law.damping, law.duration, step_share, (i + 0.5) / PHASES);

		if (isnan(e))
			return NAN;
		if (fabs(e - restitution) > fabs(worst - restitution))
			worst = e;
	}
	return worst;
}

static double damping_by(enum maps_way way, double e)
{
	struct contact_law law;

	if (way == MAPS_PLAIN)
		return numerics_plain_damping(e);
	if (way == MAPS_LINEAR)
		return numerics_linear_damping(e);
	return contact_law_init(&law, e) ? (double)NAN : law.damping;
}

double maps_damping_of_small(enum maps_way way, double e)
{
	return fabs(damping_by(way, e) / numerics_damping_of_small(e) - 1);
}

/* The truth is that of the e that was handed over, not of the one it was rounded from. */
double maps_damping_near_one(enum maps_way way, double u)
{
	double e = 1 - u;

	return fabs(damping_by(way, e) / numerics_damping_near_one(1 - e) - 1);
}

/* ---- corners ----------------------------------------------------------------------------------------------
 */

struct maps_corners maps_corners(double angle_deg)
{
	const struct scene s = study_scene(STUDY_BOX, angle_deg);
	const double step = 1e-5, end = 0.060, length = s.product_length_m, width = s.product_width_m;
	struct motion m = {.planar = true,
	                   .box_kg = s.product_case_mass_kg,
	                   .inertia_kg_m2 = s.product_case_mass_kg * (length * length + width * width) / 12,
	                   .gravity_m_s2 = s.drop_gravity_m_s2,
	                   .speed_m_s = sqrt(2 * s.drop_gravity_m_s2 * s.drop_height_m),
	                   .angle_rad = UNITS_RAD(angle_deg),
	                   .lever_x_m = length / 2,
	                   .lever_y_m = width / 2};
	struct maps_corners corners = {NAN, INFINITY};
	struct contact_law law;
	double y[MOTION_STATES_MAX] = {0}, before = -1;

	if (contact_law_init(&law, s.contact_restitution))
		return corners;
	m.damping = law.damping;
	m.stiffness_n_m15 = contact_stiffness(&law, m.box_kg, m.speed_m_s, s.contact_duration_s);
	motion_start(&m, y);
	for (double t = 0; t < end && isinf(corners.second_s); t += step) {
		double deep;

		motion_rk4(&m, step, y);
		deep = fmax(motion_depth(&m, y, -m.lever_x_m, m.lever_y_m),
		            motion_depth(&m, y, m.lever_x_m, -m.lever_y_m));
		if (deep > 0)
			corners.second_s = t + step * before / (before - deep);
		before = deep;
		if (isnan(corners.release_s) && motion_depth(&m, y, -m.lever_x_m, -m.lever_y_m) <= 0)
			corners.release_s = t + step;
	}
	return corners;
}

double maps_lever(double angle_deg, double balance_deg)
{
	const struct scene s = study_scene(STUDY_BOX, angle_deg);
	double lever_y = s.product_width_m / 2, lever_x = lever_y / tan(UNITS_RAD(balance_deg));

	return lever_x * sin(UNITS_RAD(angle_deg)) - lever_y * cos(UNITS_RAD(angle_deg));
}

double maps_own_balance_deg(void)
{
	const struct scene s = study_scene(STUDY_BOX, 25);

	return UNITS_DEG(atan2(s.product_width_m, s.product_length_m));
}

/* ---- Hertz ------------------------------------------------------------------------------------------------
 */

struct maps_hertz maps_hertz(double modulus_pa, double height_m)
{
	struct scene s = study_scene(STUDY_BOX, 25);
	struct contact_hertz hertz;

	s.contact_mat_modulus_pa = modulus_pa;
	s.drop_height_m = height_m;
	if (model_hertz(&s, &hertz, NULL))
		return (struct maps_hertz){NAN, NAN};
	return (struct maps_hertz){hertz.depth_share, hertz.duration_s};
}

/* ---- decay ------------------------------------------------------------------------------------------------
 */

enum { SAMPLES = 700 };

#define RATE_HZ 7000.0
#define AMPLITUDE_G 300.0
#define NATURAL_HZ 129.0

static double decrement_of(double value[SAMPLES])
{
	const struct reference_series series = {value, SAMPLES, RATE_HZ};

	return reference_decrement(&series).damping;
}

static double ringdown_of(double value[SAMPLES], double noise_g)
{
	uint8_t sample[SAMPLES] = {0};
	const struct channel channel = {
	        .name = "S1X", .rate_hz = RATE_HZ, .count = SAMPLES, .value_g = value, .sample = sample};
	const struct ringdown_span span = {.until_s = SAMPLES / RATE_HZ, .peak_g = AMPLITUDE_G};
	struct ringdown ringdown;
	struct trace trace;

	if (trace_open(&trace, &channel, -INFINITY, INFINITY))
		return NAN;
	trace.noise_g = noise_g;
	ringdown_find(&trace, &span, &ringdown);
	trace_close(&trace);
	return ringdown.result.how.status == ESTIMATE_OK ? ringdown.result.damping_ratio : (double)NAN;
}

double maps_decay_error(bool ours, double zeta, double noise_g, unsigned drops, unsigned long seed)
{
	gsl_rng *random = gsl_rng_alloc(gsl_rng_mt19937);
	double square = 0, decay = zeta * 2 * UNITS_PI * NATURAL_HZ;
	double turn = 2 * UNITS_PI * NATURAL_HZ * sqrt(1 - zeta * zeta);

	if (!random)
		return NAN;
	gsl_rng_set(random, seed);
	for (unsigned i = 0; i < drops; i++) {
		double value[SAMPLES], phase = 2 * UNITS_PI * gsl_rng_uniform(random), found;

		for (int k = 0; k < SAMPLES; k++)
			value[k] = AMPLITUDE_G * exp(-decay * k / RATE_HZ) * cos(turn * k / RATE_HZ + phase) +
			           gsl_ran_gaussian(random, noise_g);
		found = ours ? ringdown_of(value, noise_g) : decrement_of(value);
		if (!(fabs(found - zeta) < zeta))
			found = 0;
		square += (found / zeta - 1) * (found / zeta - 1);
	}
	gsl_rng_free(random);
	return sqrt(square / drops);
}
