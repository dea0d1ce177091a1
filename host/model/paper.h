/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_MODEL_PAPER_H
#define DT_HOST_MODEL_PAPER_H
/*
 * The study's procedure as printed, equations (2) to (19), for comparison only: several of them are wrong
 * (see README.md), and this module keeps their mistakes. Each step names its equation. SI units; pure
 * functions.
 */
#include <stdbool.h>

#include "common/error.h"

struct paper_input {
	double mass_kg;           /* m of (4) and m_B of (10): the box with everything in it */
	double length_m, width_m; /* L, H */
	double angle_rad;         /* gamma, put in as the drops define it: from the vertical to X */
	double speed_m_s;         /* v_i */
	double radius_m;          /* R */
	double case_modulus_pa, case_poisson, mat_modulus_pa, mat_poisson;
	double case_damping_ratio;  /* xi_B */
	double plate_omega;         /* omega_p = sqrt(k_p/m_p) by (19), undamped; 0: no plate */
	double mount_damping_ratio; /* xi_p */
	double contact_time_s;      /* 0: by (7) and (9); else this, as if measured */
	bool speed_signed; /* v_i of (10) and (13) counted against the impulse, which mends their sign */
};

struct paper_result {
	double equivalent_mass_kg; /* (4) */
	double contact_modulus_pa; /* K, (6) */
	double depth_m;            /* delta_max, (7), exponent 2/3 as printed */
	double contact_time_s;     /* T_i, (9) */
	double force_n;            /* largest F, (8) */
	double impulse_speed_m_s;  /* I/m_B, (10) */
	double speed_m_s;          /* w'(T_i) along the impulse, (13) */
	double box_m_s2;           /* largest |w''| of (14) */
	double box_time_s;         /* when, on the time axis of (14) */
	double amplitude_m;        /* A of (15), the factor of the sine in (14) */
	double transmissibility;   /* (17) */
	double phase_rad;          /* psi of (17), arc tangent as printed */
	double plate_m_s2;         /* largest |u''| of (17) */
	double plate_time_s;       /* when it first comes, on the time axis of (17) */
};

/* 0, or DT_E_ARGUMENT (a quantity that must be positive is not) or DT_E_NUMERIC ((17) has no value). */
DT_MUST_USE int paper_solve(const struct paper_input *input, struct paper_result *result);

/* -w'' of (14), which begins at T_i, and -u'' of (17) until T_i and of (18) after it. */
double paper_box(const struct paper_input *input, const struct paper_result *result, double time_s);
double paper_plate(const struct paper_input *input, const struct paper_result *result, double time_s);

#endif
