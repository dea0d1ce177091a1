/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_MODEL_COUPLED_H
#define DT_HOST_MODEL_COUPLED_H
/*
 * Two masses along the vertical: a box that strikes the mat (contact.h) and a plate on linear mounts inside
 * it, both free, gravity on. Integrated through the contact; from the release on the plate's answer is closed
 * form.
 *
 *     m_B y'' = F + k z + c z' - m_B g,   m_p (y'' + z'') = -(k z + c z') - m_p g,   z = plate less box
 *
 * Time 0 is the first touch. Readings are as an accelerometer gives them, y'' + g. SI units; pure functions,
 * any thread.
 */
#include <stdbool.h>
#include <stddef.h>

#include "common/error.h"
#include "host/model/contact.h"
#include "host/model/watch.h"

enum coupled_signal {
	COUPLED_BOX,
	COUPLED_PLATE,
	COUPLED_TURNED,
	COUPLED_TURNED_R,
	COUPLED_DENT,
	COUPLED_TRAVEL,
	COUPLED_SIGNALS
};

struct coupled {
	double case_mass_kg, plate_mass_kg; /* plate_mass_kg = 0: no plate */
	double gravity_m_s2, speed_m_s;
	double stiffness_n_m15; /* k of the contact */
	struct contact_law law;
	double mount_n_m, mount_damping_n_s_m;
	double turning; /* reading of S2 in Y per unit of contact force/m_B, see coupled_result.turned */
	double share_x, share_y; /* of the box's acceleration in S2's axes */
	double tolerance;        /* of a step, against the largest depth and the speed of impact */
	bool rough;              /* peaks as good as long steps give them */
	unsigned skipped; /* bits 1 << enum coupled_signal whose peaks nobody asks for; they come as 0 */
};

struct coupled_result {
	struct watch_peak box, plate;       /* readings, m/s^2; without a plate its peak is the box's */
	struct watch_peak turned, turned_r; /* S2 in Y, S2's resultant: share_y box - turning F/m_B */
	double turned_direction_rad;        /* from X to Y when the latter peaks */
	double depth_m, travel_m;           /* largest dent; largest |z| */
	double contact_time_s;              /* NAN when the box stays in the mat */
	double restitution;                 /* speed of leaving over speed of impact, NAN too */
	double velocity_change_m_s;         /* of both masses together, by the contact force */
	unsigned evaluations;
};

/* 0, or DT_E_NUMERIC. */
DT_MUST_USE int coupled_solve(const struct coupled *coupled, struct coupled_result *result);

/* What is read at an instant. */
struct coupled_sample {
	double box, plate; /* m/s^2 */
	double force_n, depth_m, travel_m;
};

/* Samples at start_s + i step_s, i < count, step_s > 0; all zero before the touch. */
DT_MUST_USE int coupled_history(const struct coupled *coupled, double start_s, double step_s,
                                struct coupled_sample *samples, size_t count);

#endif
