/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_MODEL_DROP_H
#define DT_HOST_MODEL_DROP_H
/*
 * A scene in the terms all rungs share: angle, levers, shares of the axes, the mounts as an oscillator. Used
 * within host/model. SI units, angles in rad from the vertical to X.
 */
#include <stdbool.h>
#include <stddef.h>

#include "common/error.h"
#include "common/scenes/scene.h"
#include "host/model/body.h"
#include "host/model/model.h"

struct drop {
	const struct scene *scene;
	double angle, cosine, sine;
	double gravity_m_s2, speed_m_s;
	double duration_s; /* contact time on the scene's mat, but for a plate's part */
	bool has_plate;
	double lever_x_m, lever_y_m; /* contact corner from the centre of gravity, along -X and -Y */
	double inertia_kg_m2;
	/* What S2 reads less in Y, per unit of contact force over the box's mass, because the box turns: its
	 * offset times the lever of a vertical force over the squared radius of gyration. */
	double turning;
	double share[MODEL_AXES]; /* of a vertical acceleration, in the sensors' axes; S2's without turning */
	double plate_omega, plate_zeta; /* plate against box, both free; zeta as the scene gives it */
	double mount_damping_n_s_m; /* damping_ratio in terms of the plate alone on a box that stands still */
};

/* 0, or DT_E_ARGUMENT with what is wrong, naming the key, in message (NULL: not wanted). */
DT_MUST_USE int drop_of_scene(const struct scene *scene, struct drop *drop, char *message);

/* The law of the scene's restitution, its duration but roughly. */
DT_MUST_USE int drop_contact_law(const struct drop *drop, struct contact_law *law, char *message);

/* The law of the scene's restitution, and the stiffness that gives the scene's contact time with the height
 * and the mass it was measured with. */
DT_MUST_USE int drop_contact(const struct drop *drop, struct contact_law *law, double *stiffness_n_m15,
                             char *message);

/* The body of a drop but for its contact's law and stiffness, with those of the refinements that change it.
 */
void drop_body(const struct drop *drop, bool turns, unsigned refinements, struct body *body);

/* message, if wanted, says `format`; returns code. */
__attribute__((format(printf, 3, 4))) int drop_refuse(char *message, int code, const char *format, ...);

#endif
