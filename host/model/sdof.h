/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_MODEL_SDOF_H
#define DT_HOST_MODEL_SDOF_H
/*
 * A mass on a spring and a damper, at rest on a base that is accelerated by one half-sine pulse:
 *
 *     z'' + 2 zeta omega z' + omega^2 z = -w'',   w'' = a0 sin(pi t/T) for 0 <= t <= T, else 0
 *
 * z is the mass's place relative to the base, u'' = z'' + w'' its absolute acceleration. Solved in closed
 * form, transient and free decay included, for any zeta >= 0. Within the pulse z is the divided difference of
 * the exponential over the oscillator's two rates and the pulse's i pi/T: it has a value, and keeps its
 * digits, where two or all three of them meet (resonance, critical damping), where the usual quotients
 * cancel.
 *
 * No state beyond the struct, no memory, any thread. SI units; a0 may be in any unit of acceleration, z,
 * z' and u'' follow it. Times count from the start of the pulse.
 */
#include "common/error.h"
#include "host/model/oscillator.h"

/* Filled by sdof_init; read only. */
struct sdof {
	struct oscillator mount;
	double pulse_omega;  /* pi/T */
	double pulse_s;      /* T */
	double amplitude;    /* a0 */
	double z_end, v_end; /* z and z' at T */
};

struct sdof_motion {
	double z;            /* relative place */
	double v;            /* z' */
	double acceleration; /* u'' */
};

/* 0, or DT_E_ARGUMENT: frequency and duration must be positive, damping_ratio >= 0, all finite. */
DT_MUST_USE int sdof_init(struct sdof *sdof, double frequency_hz, double damping_ratio, double amplitude,
                          double pulse_s);

/* At any time; all zero before the pulse. */
struct sdof_motion sdof_motion(const struct sdof *sdof, double time_s);

/* The extreme of u'' of largest magnitude, signed, and its time. 0, or DT_E_NUMERIC when the oscillator
 * makes more cycles within the pulse than the scan is meant for (SDOF_CYCLES_MAX) or a root is not found. */
DT_MUST_USE int sdof_peak(const struct sdof *sdof, double *value, double *time_s);

enum { SDOF_CYCLES_MAX = 20000 };

#endif
