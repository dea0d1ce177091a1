/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/model/coupled.h"

#include <math.h>

#include "host/model/oscillator.h"

enum { DEPTH, SINKING, OFFSET, OPENING, STATES };

/* A box that has not left the mat after this many contact times will not. */
#define CONTACTS_MAX 3.0

/* First step, in times the box needs at impact speed for the largest depth. */
#define FIRST_STEP 1e-3
#define FIRST_STEP_ROUGH 0.1

static double coupled_contact_force(const struct coupled *c, const double y[])
{
	double force;

	if (!(y[DEPTH] > 0.0))
		return 0.0;
	force = c->stiffness_n_m15 * y[DEPTH] * sqrt(y[DEPTH]) *
	        (1.0 + c->law.damping * y[SINKING] / c->speed_m_s);
	return force > 0.0 ? force : 0.0;
}

static double coupled_mount_force(const struct coupled *c, const double y[])
{
	return c->mount_n_m * y[OFFSET] + c->mount_damping_n_s_m * y[OPENING];
}

static void coupled_rates(const void *context, const double y[], double rate[])
{
	const struct coupled *c = context;
	double force = coupled_contact_force(c, y);

	rate[DEPTH] = y[SINKING];
	rate[SINKING] = c->gravity_m_s2 - force / c->case_mass_kg;
	if (c->plate_mass_kg > 0.0) {
		double mount = coupled_mount_force(c, y);

		rate[SINKING] -= mount / c->case_mass_kg;
		rate[OFFSET] = y[OPENING];
		rate[OPENING] = -mount / c->plate_mass_kg - (mount + force) / c->case_mass_kg;
	}
}

static void coupled_signals(const void *context, const double y[], double value[])
{
	const struct coupled *c = context;
	double force = coupled_contact_force(c, y),
	       mount = c->plate_mass_kg > 0.0 ? coupled_mount_force(c, y) : 0.0;

	value[COUPLED_BOX] = (force + mount) / c->case_mass_kg;
	value[COUPLED_PLATE] = c->plate_mass_kg > 0.0 ? -mount / c->plate_mass_kg : value[COUPLED_BOX];
	value[COUPLED_TURNED] = c->share_y * value[COUPLED_BOX] - c->turning * force / c->case_mass_kg;
	value[COUPLED_TURNED_R] = hypot(c->share_x * value[COUPLED_BOX], value[COUPLED_TURNED]);
	value[COUPLED_DENT] = y[DEPTH];
	value[COUPLED_TRAVEL] = c->plate_mass_kg > 0.0 ? y[OFFSET] : 0.0;
}

static void coupled_start(const struct coupled *c, struct ode *ode)
{
	const double y[STATES] = {[SINKING] = c->speed_m_s};
	double depth = contact_depth(&c->law, c->case_mass_kg, c->speed_m_s, c->stiffness_n_m15);

	ode->count = c->plate_mass_kg > 0.0 ? STATES : OFFSET;
	ode->rates = coupled_rates;
	ode->context = c;
	ode->tolerance = c->tolerance;
	ode->scale[DEPTH] = ode->scale[OFFSET] = depth;
	ode->scale[SINKING] = ode->scale[OPENING] = c->speed_m_s;
	if (c->plate_mass_kg > 0.0) { /* a stiff mount moves little */
		double omega2 = c->mount_n_m * (1.0 / c->plate_mass_kg + 1.0 / c->case_mass_kg);
		double stiff = fmin(1.0, c->speed_m_s * c->speed_m_s / (depth * depth * omega2));

		ode->scale[OFFSET] *= stiff;
		ode->scale[OPENING] *= sqrt(stiff);
	}
	ode_start(ode, y, (c->rough ? FIRST_STEP_ROUGH : FIRST_STEP) * depth / c->speed_m_s);
}

static double coupled_contact_end(const struct coupled *c)
{
	return CONTACTS_MAX * contact_duration(&c->law, c->case_mass_kg, c->speed_m_s, c->stiffness_n_m15);
}

/* One step; *released when the box leaves the mat in it, which then ends there. */
static int coupled_step(struct ode *ode, double until, bool *released)
{
	int error = ode_step(ode, until);

	*released = !error && ode->y[DEPTH] <= 0.0 && ode->last.from > 0.0;
	if (*released)
		ode_cut(ode, watch_crossing(ode, DEPTH));
	return error;
}

/* The plate on its mounts in free flight. */
static int flight(const struct coupled *c, struct oscillator *mount)
{
	double per_mass = 1.0 / c->plate_mass_kg + 1.0 / c->case_mass_kg;
	double omega = sqrt(c->mount_n_m * per_mass);

	return oscillator_init(mount, omega, 0.5 * c->mount_damping_n_s_m * per_mass / omega);
}

static void later(struct watch_peak *peak, double value, double time_s)
{
	if (fabs(value) > fabs(peak->value))
		*peak = (struct watch_peak){value, time_s};
}

/* The first extreme of the plate's acceleration, and of its travel, after the release. */
static int coupled_peaks_in_flight(const struct coupled *c, const struct ode *ode, struct coupled_result *r)
{
	double z = ode->y[OFFSET], v = ode->y[OPENING], plate, rise, at,
	       share = c->plate_mass_kg / c->case_mass_kg;
	struct oscillator mount;
	int error = flight(c, &mount);

	if (error)
		return error;
	plate = -coupled_mount_force(c, ode->y) / c->plate_mass_kg;
	rise = -(c->mount_n_m * v + c->mount_damping_n_s_m * ode->rate[0][OPENING]) / c->plate_mass_kg;
	at = oscillator_turn(&mount, plate, rise);
	oscillator_move(&mount, at, &plate, &rise);
	later(&r->plate, plate, ode->t + at);
	later(&r->box, -share * plate, ode->t + at);
	later(&r->turned, -share * plate * c->share_y, ode->t + at);
	later(&r->turned_r, share * fabs(plate), ode->t + at);
	at = oscillator_turn(&mount, z, v);
	oscillator_move(&mount, at, &z, &v);
	r->travel_m = fmax(r->travel_m, fabs(z));
	return 0;
}

static void coupled_conclude(const struct coupled *c, const struct ode *ode, const struct watch *w,
                             bool released, struct coupled_result *r)
{
	double sinking = ode->y[SINKING], opening = c->plate_mass_kg > 0.0 ? ode->y[OPENING] : 0.0;

	r->box = w->peak[COUPLED_BOX];
	r->plate = w->peak[COUPLED_PLATE];
	r->turned = w->peak[COUPLED_TURNED];
	r->turned_r = w->peak[COUPLED_TURNED_R];
	r->turned_direction_rad = atan2(w->with[COUPLED_TURNED_R][COUPLED_TURNED],
	                                c->share_x * w->with[COUPLED_TURNED_R][COUPLED_BOX]);
	r->depth_m = w->peak[COUPLED_DENT].value;
	r->travel_m = fabs(w->peak[COUPLED_TRAVEL].value);
	r->contact_time_s = released ? ode->t : (double)NAN;
	r->restitution = released ? -sinking / c->speed_m_s : (double)NAN;
	r->velocity_change_m_s = c->speed_m_s - sinking +
	                         opening * c->plate_mass_kg / (c->plate_mass_kg + c->case_mass_kg) +
	                         c->gravity_m_s2 * ode->t;
	r->evaluations = ode->evaluations;
}

/* What the flight tells of peaks that nobody asked for. */
static void coupled_forget(const struct coupled *c, struct coupled_result *r)
{
	struct watch_peak *const peaks[] = {
	        [COUPLED_BOX] = &r->box,
	        [COUPLED_PLATE] = &r->plate,
	        [COUPLED_TURNED] = &r->turned,
	        [COUPLED_TURNED_R] = &r->turned_r,
	};

	for (unsigned i = 0; i < sizeof(peaks) / sizeof(peaks[0]); i++)
		if (c->skipped >> i & 1u)
			*peaks[i] = (struct watch_peak){0.0, 0.0};
}

int coupled_solve(const struct coupled *c, struct coupled_result *result)
{
	struct coupled_result r;
	struct ode ode;
	struct watch watch = {.count = COUPLED_SIGNALS,
	                      .signals = coupled_signals,
	                      .context = c,
	                      .skipped = c->skipped,
	                      .rough = c->rough};
	double end = coupled_contact_end(c);
	bool released = false;
	int error = 0;

	coupled_start(c, &ode);
	watch_start(&watch, &ode);
	while (!error && !released && ode.t < end) {
		error = coupled_step(&ode, end, &released);
		if (!error)
			watch_step(&watch, &ode);
	}
	if (error)
		return error;
	watch_end(&watch, &ode);
	coupled_conclude(c, &ode, &watch, released, &r);
	if (released && c->plate_mass_kg > 0.0)
		error = coupled_peaks_in_flight(c, &ode, &r);
	if (!error) {
		coupled_forget(c, &r);
		*result = r;
	}
	return error;
}

/* ---- the history ---- */

static struct coupled_sample coupled_sample_of(const struct coupled *c, const double y[])
{
	double value[COUPLED_SIGNALS];

	coupled_signals(c, y, value);
	return (struct coupled_sample){
	        .box = value[COUPLED_BOX],
	        .plate = value[COUPLED_PLATE],
	        .force_n = coupled_contact_force(c, y),
	        .depth_m = fmax(value[COUPLED_DENT], 0.0),
	        .travel_m = value[COUPLED_TRAVEL],
	};
}

/* A time after the release. */
static struct coupled_sample sample_in_flight(const struct coupled *c, const struct oscillator *mount,
                                              const struct ode *release, double t)
{
	double y[STATES] = {[DEPTH] = -1.0};

	if (!(c->plate_mass_kg > 0.0))
		return (struct coupled_sample){0};
	y[OFFSET] = release->y[OFFSET];
	y[OPENING] = release->y[OPENING];
	oscillator_move(mount, t - release->t, &y[OFFSET], &y[OPENING]);
	return coupled_sample_of(c, y);
}

int coupled_history(const struct coupled *c, double start_s, double step_s, struct coupled_sample *samples,
                    size_t count)
{
	struct oscillator mount = {0};
	struct ode ode;
	bool released = false;
	int error = c->plate_mass_kg > 0.0 ? flight(c, &mount) : 0;

	coupled_start(c, &ode);
	for (size_t i = 0; i < count && !error; i++) {
		double t = start_s + (double)i * step_s, y[STATES];

		if (!(t > 0.0)) {
			samples[i] = (struct coupled_sample){0};
			continue;
		}
		while (!error && !released && ode.t < t)
			error = coupled_step(&ode, fmax(t, coupled_contact_end(c)), &released);
		if (released && t > ode.t) {
			samples[i] = sample_in_flight(c, &mount, &ode, t);
		} else {
			ode_at(&ode, t, y);
			samples[i] = coupled_sample_of(c, y);
		}
	}
	return error;
}
