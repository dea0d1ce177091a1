/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_MODEL_VARY_H
#define DT_HOST_MODEL_VARY_H
/*
 * Changing a scene by name: any key of scene.def as "section.key", alone; or by a short name, with what
 * depends on it:
 *
 *   angle, height, mass, restitution, stiffness   drop.angle_deg, drop.height_m, ...: nothing else
 *   contact-time  the contact's stiffness with T^-2.5
 *   cube          the mounts' stiffness and dampers with the cube's side, cubes being similar
 *   damping       the identified dampers with the damping ratio
 *
 * The contact time is that of the height and the mass it was measured with (contact.duration_height_m,
 * mass_kg): the model has it follow another height or mass.
 *
 * A contact that was predicted (corner.h) is predicted again for what is changed; where that cannot be, the
 * scene makes no drop.
 *
 * Pure functions, any thread; a scene that comes out is the caller's to check.
 */
#include <stdbool.h>
#include <stddef.h>

#include "common/error.h"
#include "common/scenes/scene.h"

struct vary_key {
	const char *name; /* as given: "angle", "mount.cube_m" */
	const char *key;  /* "angle_deg" */
	size_t offset;    /* in struct scene */
	double min, max;
	bool linked; /* a short name */
};

/* DT_E_UNKNOWN: no such name. */
DT_MUST_USE int vary_find(const char *name, struct vary_key *key);

/* Calls each(key, context) for every key of scene.def, under its full name. */
void vary_each(void (*each)(const struct vary_key *key, void *context), void *context);

/* Moves what a fit found, by so much in the coordinates of [fit]: scene_fitted of scene.h. The contact time
 * follows stiffness and restitution. */
void vary_fitted(struct scene *scene, const double move[SCENE_FITTED]);

double vary_get(const struct scene *scene, const struct vary_key *key);
void vary_set(struct scene *scene, const struct vary_key *key, double value);

#endif
