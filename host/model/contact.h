/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_MODEL_CONTACT_H
#define DT_HOST_MODEL_CONTACT_H
/*
 * A body that strikes a mat: Hunt and Crossley's law
 *
 *     F = k d^1.5 (1 + D d'/v),  never pulling,     v the speed of impact
 *
 * whose D follows from the coefficient of restitution e alone, ln((1 + D)/(1 - e D)) = D (1 + e), and whose k
 * is identified from a measured contact time. Neither is predicted from the materials: Hertz's half space,
 * which would, is offered beside it with the check that tells when it holds.
 *
 * With x = ln((1 + D)/(1 - e D)) the law has closed forms at both ends of e,
 *
 *     1 + D = x/(1 - exp(-x)),   1 - e D = x/(exp(x) - 1),   e = (exp(x) - 1 - x)/(x exp(x) - exp(x) + 1)
 *
 * so that one root of a smooth function of x serves from e = 1e-6 to 1. Depth, force and duration are then
 * integrals over h = ln((1 + D)/(1 + D d'/v)), which runs from 0 at the touch to x at the release.
 *
 * Pure functions, any thread; SI units. Starred quantities are without dimension: T* = T (k^2 v/m^2)^(1/5),
 * d* = d (k/(m v^2))^(2/5).
 */
#include "common/error.h"

/* Filled by contact_law_init; read only. */
struct contact_law {
	double restitution; /* e */
	double damping;     /* D */
	double spread;      /* x */
	double duration;    /* T* */
	double depth;       /* largest d* */
};

/* 0 < e <= 1; below CONTACT_RESTITUTION_MIN the law has lost its meaning (at e = 0 it has no solution).
 * 0, DT_E_ARGUMENT or DT_E_NUMERIC. */
#define CONTACT_RESTITUTION_MIN 1e-6
DT_MUST_USE int contact_law_init(struct contact_law *law, double restitution);

/* The same without the integral for the duration, which is then good to a few percent above e = 0.2. */
DT_MUST_USE int contact_law_begin(struct contact_law *law, double restitution);

/* k of a mass that strikes at this speed and stays for this long, N/m^1.5; and the other way round. */
double contact_stiffness(const struct contact_law *law, double mass_kg, double speed_m_s, double duration_s);
double contact_duration(const struct contact_law *law, double mass_kg, double speed_m_s,
                        double stiffness_n_m15);
double contact_depth(const struct contact_law *law, double mass_kg, double speed_m_s, double stiffness_n_m15);

/* How far a dent of this depth in a mat of this thickness can be trusted. */
enum contact_validity {
	CONTACT_SOUND,
	CONTACT_DEEP,   /* over CONTACT_DEEP_SHARE of the mat: the floor under it begins to be felt */
	CONTACT_THROUGH /* as deep as the mat or deeper: no such contact */
};
#define CONTACT_DEEP_SHARE 0.3
enum contact_validity contact_validity(double depth_m, double thickness_m);

/* What Hertz would predict: an elastic sphere on an elastic half space (no restitution, no thickness). */
struct contact_hertz_input {
	double mass_kg, speed_m_s;
	double radius_m;
	double case_modulus_pa, case_poisson;
	double mat_modulus_pa, mat_poisson;
	double mat_thickness_m; /* only for the check */
};

struct contact_hertz {
	double modulus_pa;      /* K = (4/3) E* */
	double stiffness_n_m15; /* K sqrt(R) */
	double depth_m;
	double duration_s;
	double depth_share; /* of the mat's thickness */
	enum contact_validity validity;
};

/* 0, or DT_E_ARGUMENT: all positive, Poisson's ratios within 0 to 0.5. */
DT_MUST_USE int contact_hertz(const struct contact_hertz_input *input, struct contact_hertz *hertz);

#endif
