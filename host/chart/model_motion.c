/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <string.h>

#include <gsl/gsl_errno.h>
#include <gsl/gsl_odeiv2.h>

#include "host/chart/model_numerics.h"

enum { HEIGHT, RISE, PLATE_HEIGHT, PLATE_RISE, COUPLED_STATES };
enum { ACROSS, UP, ANGLE, PLATE_ACROSS, PLATE_UP, PLACES, PLANAR_STATES = 2 * PLACES };

/* What acts on the box, N; across only from the mounts. */
struct forces {
	double normal, lever_across, mount_across, mount_up;
};

static size_t model_motion_states(const struct motion *m)
{
	return m->planar ? PLANAR_STATES : COUPLED_STATES;
}

void motion_start(const struct motion *m, double y[])
{
	memset(y, 0, model_motion_states(m) * sizeof(*y));
	if (m->planar)
		y[PLACES + UP] = y[PLACES + PLATE_UP] = -m->speed_m_s;
	else
		y[RISE] = y[PLATE_RISE] = -m->speed_m_s;
}

static double model_motion_contact(const struct motion *m, double depth, double sinking)
{
	if (!(depth > 0))
		return 0;
	return fmax(m->stiffness_n_m15 * pow(depth, 1.5) * (1 + m->damping * sinking / m->speed_m_s), 0);
}

/* Of a corner against the centre of gravity. */
static double model_motion_corner_up(const struct motion *m, double turn, double x, double y)
{
	return x * cos(m->angle_rad + turn) + y * sin(m->angle_rad + turn);
}

double motion_depth(const struct motion *m, const double y[], double corner_x_m, double corner_y_m)
{
	return model_motion_corner_up(m, 0, -m->lever_x_m, -m->lever_y_m) - y[UP] -
	       model_motion_corner_up(m, y[ANGLE], corner_x_m, corner_y_m);
}

static struct forces forces_of(const struct motion *m, const double y[])
{
	struct forces f = {0};

	if (m->planar) {
		double g = m->angle_rad + y[ANGLE];
		double k = m->mount_n_m, c = m->mount_damping_n_s_m;

		f.lever_across = m->lever_y_m * cos(g) - m->lever_x_m * sin(g);
		f.normal = model_motion_contact(m, motion_depth(m, y, -m->lever_x_m, -m->lever_y_m),
		                                y[PLACES + ANGLE] * f.lever_across - y[PLACES + UP]);
		f.mount_across = k * (y[PLATE_ACROSS] - y[ACROSS]) +
		                 c * (y[PLACES + PLATE_ACROSS] - y[PLACES + ACROSS]);
		f.mount_up = k * (y[PLATE_UP] - y[UP]) + c * (y[PLACES + PLATE_UP] - y[PLACES + UP]);
		return f;
	}
	f.normal = model_motion_contact(m, -y[HEIGHT], -y[RISE]);
	f.mount_up = m->mount_n_m * (y[PLATE_HEIGHT] - y[HEIGHT]) +
	             m->mount_damping_n_s_m * (y[PLATE_RISE] - y[RISE]);
	return f;
}

static double over_plate(const struct motion *m, double force)
{
	return m->plate_kg > 0 ? -force / m->plate_kg : 0;
}

static void model_motion_rates(const struct motion *m, const double y[], double rate[])
{
	const struct forces f = forces_of(m, y);
	double up = (f.normal + f.mount_up) / m->box_kg - m->gravity_m_s2;
	double plate_up = over_plate(m, f.mount_up) - m->gravity_m_s2;

	if (!m->planar) {
		rate[HEIGHT] = y[RISE];
		rate[RISE] = up;
		rate[PLATE_HEIGHT] = y[PLATE_RISE];
		rate[PLATE_RISE] = plate_up;
		return;
	}
	for (int i = 0; i < PLACES; i++)
		rate[i] = y[PLACES + i];
	rate[PLACES + ACROSS] = f.mount_across / m->box_kg;
	rate[PLACES + UP] = up;
	rate[PLACES + ANGLE] = -f.normal * f.lever_across / m->inertia_kg_m2;
	rate[PLACES + PLATE_ACROSS] = over_plate(m, f.mount_across);
	rate[PLACES + PLATE_UP] = plate_up;
}

double motion_box(const struct motion *m, const double y[])
{
	const struct forces f = forces_of(m, y);

	return hypot(f.mount_across, f.normal + f.mount_up) / m->box_kg;
}

double motion_plate(const struct motion *m, const double y[])
{
	const struct forces f = forces_of(m, y);

	return hypot(over_plate(m, f.mount_across), over_plate(m, f.mount_up));
}

void motion_rk4(const struct motion *m, double h, double y[])
{
	static const double place[] = {0, 0.5, 0.5, 1}, weight[] = {1, 2, 2, 1};
	double rate[MOTION_STATES_MAX] = {0}, at[MOTION_STATES_MAX], sum[MOTION_STATES_MAX] = {0};
	size_t states = model_motion_states(m);

	for (int stage = 0; stage < 4; stage++) {
		for (size_t i = 0; i < states; i++)
			at[i] = y[i] + place[stage] * h * rate[i];
		model_motion_rates(m, at, rate);
		for (size_t i = 0; i < states; i++)
			sum[i] += weight[stage] * rate[i];
	}
	for (size_t i = 0; i < states; i++)
		y[i] += h / 6 * sum[i];
}

void motion_by_rk4(const struct motion *m, double step_s, double every_s, size_t count,
                   double (*y)[MOTION_STATES_MAX])
{
	int steps = (int)ceil(every_s / step_s * (1 - 1e-12));
	double now[MOTION_STATES_MAX] = {0};

	motion_start(m, now);
	for (size_t i = 0; i < count; i++) {
		for (int k = 0; k < steps; k++)
			motion_rk4(m, every_s / steps, now);
		memcpy(y[i], now, sizeof(now));
	}
}

static int gsl_rates(double t, const double y[], double rate[], void *context)
{
	const struct motion *m = context;

	(void)t;
	model_motion_rates(m, y, rate);
	return isfinite(rate[1]) ? GSL_SUCCESS : GSL_EBADFUNC;
}

static const gsl_odeiv2_step_type *type_of(const char *method)
{
	if (strcmp(method, "rkf45") == 0)
		return gsl_odeiv2_step_rkf45;
	if (strcmp(method, "rkck") == 0)
		return gsl_odeiv2_step_rkck;
	return strcmp(method, "rk8pd") == 0 ? gsl_odeiv2_step_rk8pd : gsl_odeiv2_step_msadams;
}

int motion_by_gsl(const struct motion *m, const char *method, double tolerance, double every_s, size_t count,
                  double (*y)[MOTION_STATES_MAX])
{
	/* what counts as much in each state: a dent of millimetres, the speed of impact, both over a reach */
	double scale[MOTION_STATES_MAX], now[MOTION_STATES_MAX] = {0}, t = 0, dent = 1e-3 * m->speed_m_s;
	struct motion copy = *m;
	size_t states = model_motion_states(m);
	gsl_odeiv2_system system = {gsl_rates, NULL, states, &copy};
	gsl_odeiv2_driver *driver;
	int status = GSL_SUCCESS;

	for (size_t i = 0; i < states; i++) {
		bool rate = m->planar ? i >= PLACES : i % 2 == 1;
		double reach = m->planar && i % PLACES == ANGLE ? hypot(m->lever_x_m, m->lever_y_m) : 1;

		scale[i] = (rate ? m->speed_m_s : dent) / reach;
	}
	driver =
	        gsl_odeiv2_driver_alloc_scaled_new(&system, type_of(method), 1e-6, tolerance, 0, 1, 0, scale);
	if (!driver)
		return DT_E_MEMORY;
	motion_start(m, now);
	for (size_t i = 0; i < count && status == GSL_SUCCESS; i++) {
		status = gsl_odeiv2_driver_apply(driver, &t, every_s * (double)(i + 1), now);
		memcpy(y[i], now, sizeof(now));
	}
	gsl_odeiv2_driver_free(driver);
	return status == GSL_SUCCESS ? 0 : DT_E_NUMERIC;
}
