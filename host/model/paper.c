/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/model/paper.h"

#include <math.h>

#include "common/units.h"

static double square(double x)
{
	return x * x;
}

/* sqrt(1 - zeta^2) */
static double damped_ratio(double zeta)
{
	return sqrt((1.0 - zeta) * (1.0 + zeta));
}

static void paper_contact(const struct paper_input *in, struct paper_result *r)
{
	double ratio = in->width_m / in->length_m, cosine = cos(in->angle_rad);

	/* (4) */
	r->equivalent_mass_kg =
	        in->mass_kg / (1.0 + 1.5 * square(cosine) * square(1.0 - ratio * tan(in->angle_rad)) /
	                                     (1.0 + 1.0 / square(ratio)));
	/* (6) */
	r->contact_modulus_pa = 4.0 / 3.0 /
	                        ((1.0 - square(in->case_poisson)) / in->case_modulus_pa +
	                         (1.0 - square(in->mat_poisson)) / in->mat_modulus_pa);
	/* (7), (9); with a contact time given (9) is read backwards */
	r->depth_m = pow(5.0 * r->equivalent_mass_kg * square(in->speed_m_s) /
	                         (4.0 * r->contact_modulus_pa * sqrt(in->radius_m)),
	                 2.0 / 3.0);
	r->contact_time_s = 2.943 * r->depth_m / in->speed_m_s;
	if (in->contact_time_s > 0.0) {
		r->contact_time_s = in->contact_time_s;
		r->depth_m = in->contact_time_s * in->speed_m_s / 2.943;
	}
	/* (8); its integral over half a sine is 2 T_i/pi times its largest value: (10) */
	r->force_n = r->equivalent_mass_kg * square(UNITS_PI / r->contact_time_s) * r->depth_m;
	r->impulse_speed_m_s = r->force_n * 2.0 * r->contact_time_s / UNITS_PI / in->mass_kg;
}

static void box(const struct paper_input *in, struct paper_result *r)
{
	double omega = UNITS_PI / r->contact_time_s, zeta = in->case_damping_ratio, s = damped_ratio(zeta);
	double turn = 0.0;

	/* (13) */
	r->speed_m_s = fabs(r->impulse_speed_m_s + (in->speed_signed ? -in->speed_m_s : in->speed_m_s));
	/* (14) twice differentiated is largest where its third derivative vanishes, or at its beginning */
	if (zeta < 0.5)
		turn = atan2(s * (1.0 - 4.0 * square(zeta)), zeta * (3.0 - 4.0 * square(zeta))) / s;
	r->box_m_s2 = r->speed_m_s * omega * (zeta < 0.5 ? exp(-zeta * turn) : 2.0 * zeta);
	r->box_time_s = r->contact_time_s + turn / omega;
	r->amplitude_m = r->speed_m_s / (omega * s);
}

static int plate(const struct paper_input *in, struct paper_result *r)
{
	double omega = UNITS_PI / r->contact_time_s, xi = in->mount_damping_ratio;
	double ratio = omega * damped_ratio(in->case_damping_ratio) / (in->plate_omega * damped_ratio(xi));
	double lead = atan(2.0 * xi * omega / in->plate_omega), wait;

	/* (17) */
	r->transmissibility =
	        1.0 / sqrt(1.0 - (2.0 - square(ratio)) / (4.0 * square(xi) + square(1.0 / ratio)));
	r->phase_rad = atan(2.0 * xi * ratio / (1.0 - square(ratio)));
	r->plate_m_s2 = square(omega) * r->amplitude_m * r->transmissibility;
	wait = 0.5 * UNITS_PI - lead + r->phase_rad;
	r->plate_time_s = (wait - UNITS_PI * floor(wait / UNITS_PI)) / omega;
	return isfinite(r->plate_m_s2) ? 0 : DT_E_NUMERIC;
}

int paper_solve(const struct paper_input *in, struct paper_result *result)
{
	struct paper_result r = {.transmissibility = (double)NAN,
	                         .phase_rad = (double)NAN,
	                         .plate_m_s2 = (double)NAN,
	                         .plate_time_s = (double)NAN};
	int error = 0;

	if (!(in->mass_kg > 0.0) || !(in->length_m > 0.0) || !(in->width_m > 0.0) || !(in->speed_m_s > 0.0) ||
	    !(in->radius_m > 0.0) || !(in->case_damping_ratio >= 0.0) || !(in->case_damping_ratio < 1.0) ||
	    !(in->mount_damping_ratio >= 0.0) || !(in->mount_damping_ratio < 1.0))
		return DT_E_ARGUMENT;
	paper_contact(in, &r);
	if (!(r.contact_time_s > 0.0) || !isfinite(r.contact_time_s))
		return DT_E_ARGUMENT;
	box(in, &r);
	if (in->plate_omega > 0.0)
		error = plate(in, &r);
	if (!error)
		*result = r;
	return error;
}

double paper_box(const struct paper_input *in, const struct paper_result *r, double time_s)
{
	double omega = UNITS_PI / r->contact_time_s, zeta = in->case_damping_ratio, s = damped_ratio(zeta);
	double x = omega * (time_s - r->contact_time_s);

	if (!(x >= 0.0))
		return 0.0;
	return r->speed_m_s * omega * exp(-zeta * x) *
	       (2.0 * zeta * cos(s * x) + (1.0 - 2.0 * square(zeta)) / s * sin(s * x));
}

double paper_plate(const struct paper_input *in, const struct paper_result *r, double time_s)
{
	double omega = UNITS_PI / r->contact_time_s;
	double decay = in->mount_damping_ratio * in->plate_omega;
	double phase =
	        omega * time_s + atan(2.0 * in->mount_damping_ratio * omega / in->plate_omega) - r->phase_rad;
	double u = r->amplitude_m * r->transmissibility;

	if (!(time_s >= 0.0))
		return 0.0;
	if (time_s <= r->contact_time_s)
		return square(omega) * u * sin(phase);
	/* (18) twice differentiated */
	return u * exp(-decay * time_s) *
	       ((square(omega) - square(decay)) * sin(phase) + 2.0 * decay * omega * cos(phase));
}
