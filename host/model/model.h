/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_MODEL_MODEL_H
#define DT_HOST_MODEL_MODEL_H
/*
 * What a drop should look like: a ladder of models of rising fidelity behind one call. Today's rung is
 * `sdof`: half-sine contact of the given duration and velocity change, the plate as a damped oscillator
 * on the box, exact through contact and free decay.
 *
 * Time 0 is the first touch. Readings as an accelerometer gives them: 0 in free fall, positive along the
 * body axis away from the mat. X and Y of S1 and S2.
 */
#include <stdbool.h>
#include <stddef.h>

#include "common/error.h"
#include "common/scenes/scene.h"

enum model_fidelity { MODEL_AUTO, MODEL_SDOF };

/* "auto", "sdof"; DT_E_UNKNOWN for another name. */
DT_MUST_USE int model_fidelity_parse(const char *name, enum model_fidelity *fidelity);

enum model_axis { MODEL_S1X, MODEL_S1Y, MODEL_S2X, MODEL_S2Y, MODEL_AXES };

struct model_peak {
	double value_g;
	double time_s;
};

struct model_prediction {
	const char *fidelity; /* the rung taken */
	char reason[160];     /* why that one */
	bool has_plate;
	double impact_speed_m_s;
	double velocity_change_m_s; /* of the centre of gravity */
	double contact_time_s;
	double plate_frequency_hz; /* damped, free-free; 0 without a plate */
	double plate_damping_ratio;
	struct model_peak peak[MODEL_AXES];
	struct model_peak resultant[2]; /* S1, S2 */
	double lag_s;                   /* S1's resultant peak after S2's */
};

/* Predicts the drop of a checked scene. 0, or DT_E_NUMERIC. */
DT_MUST_USE int model_predict(const struct scene *scene, enum model_fidelity fidelity,
                              struct model_prediction *prediction);

/* Fills value_g[count] with one axis at times start_s + k step_s after first touch (negative times: 0). */
DT_MUST_USE int model_history(const struct scene *scene, enum model_fidelity fidelity, enum model_axis axis,
                              double start_s, double step_s, double *value_g, size_t count);

#endif
