/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_MODEL_CORNER_H
#define DT_HOST_MODEL_CORNER_H
/*
 * What a right-angled edge would feel of a rubber mat on a rigid floor: the contact's stiffness predicted
 * from a table of finite elements (corner.def, made by corner.py) for a box whose contact nobody has
 * measured. The edge runs along Z over the product's thickness. README.md has what the table says and how far
 * it is off.
 *
 * Pure functions, any thread; SI units.
 */
#include <stdbool.h>

#include "common/error.h"
#include "common/scenes/scene.h"

enum { CORNER_DEPTHS = 6 };
#define CORNER_DEPTH_STEP (1.0 / 15.0) /* of the mat's thickness */
#define CORNER_RADIUS_MIN 0.25         /* of it */
#define CORNER_RADIUS_MAX 2.0
#define CORNER_POISSON_MIN 0.48

/* Force over E* length thickness at the depths of the table. angle_deg from 10 to 80; radius over thickness.
 */
void corner_forces(double angle_deg, double radius, double force[CORNER_DEPTHS]);

struct corner {
	double stiffness_n_m15; /* of K d^1.5 that stores the same energy at the same depth */
	double depth_m;         /* the deepest of this drop */
	double misfit;          /* of that law's force there, as a share */
	double table_u;         /* relative standard uncertainties: of table and law, */
	double relative_u;      /* and with the mat's modulus */
};

/* Of the scene's drop. 0, or DT_E_RANGE and in message, if wanted, which key the table does not reach. */
DT_MUST_USE int corner_predict(const struct scene *scene, struct corner *corner, char *message);

/* Puts numbers in place of stiffness_n_m15 and duration_s of a scene that leaves both to it (NAN), and the
 * uncertainty where that of a fit would stand; leaves another scene alone. 0, or as corner_predict. */
DT_MUST_USE int corner_fill(struct scene *scene, char *message);

/* Whether all that is known of a scene's uncertainty is that of its stiffness: it was predicted. A fit finds
 * restitution with it. */
bool corner_predicted(const struct scene *scene);

/* Sets one number of such a scene, and both after it; to NAN beyond the table. */
void corner_follow(struct scene *scene, double *number, double value);

#endif
