/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/model/vary.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "host/model/contact.h"
#include "host/model/corner.h"

static const struct vary_key keys[] = {
#define SCENE_KEY(section, key, min, max, initial, doc) \
	{#section "." #key, #key, offsetof(struct scene, section##_##key), min, max, false},
#include "common/scenes/scene.def"
#undef SCENE_KEY
};

static const struct {
	const char *name, *key;
} short_names[] = {
        {"angle", "drop.angle_deg"},
        {"height", "drop.height_m"},
        {"mass", "product.case_mass_kg"},
        {"contact-time", "contact.duration_s"},
        {"restitution", "contact.restitution"},
        {"cube", "mount.cube_m"},
        {"stiffness", "mount.stiffness_n_m"},
        {"damping", "mount.damping_ratio"},
};

static const struct vary_key *full(const char *name)
{
	for (size_t i = 0; i < sizeof(keys) / sizeof(keys[0]); i++)
		if (strcmp(keys[i].name, name) == 0)
			return &keys[i];
	return NULL;
}

int vary_find(const char *name, struct vary_key *key)
{
	const struct vary_key *found = full(name);

	if (found) {
		*key = *found;
		return 0;
	}
	for (size_t i = 0; i < sizeof(short_names) / sizeof(short_names[0]); i++) {
		if (strcmp(short_names[i].name, name) != 0)
			continue;
		*key = *full(short_names[i].key);
		key->name = short_names[i].name;
		key->linked = true;
		return 0;
	}
	return DT_E_UNKNOWN;
}

void vary_each(void (*each)(const struct vary_key *key, void *context), void *context)
{
	for (size_t i = 0; i < sizeof(keys) / sizeof(keys[0]); i++)
		each(&keys[i], context);
}

double vary_get(const struct scene *scene, const struct vary_key *key)
{
	return *(const double *)(const void *)((const char *)scene + key->offset);
}

void vary_set(struct scene *scene, const struct vary_key *key, double value)
{
	double *at = (double *)(void *)((char *)scene + key->offset), times = value / *at;

	if (scene->predicted_u > 0.0 && at != &scene->contact_stiffness_n_m15)
		corner_follow(scene, at, value);
	else
		*at = value;
	if (!key->linked || !(times > 0.0) || !isfinite(times))
		return;
	if (at == &scene->contact_duration_s) {
		scene->contact_stiffness_n_m15 *= pow(times, -2.5);
	} else if (at == &scene->mount_cube_m) {
		scene->mount_stiffness_n_m *= times;
		scene->mount_damping_n_s_m *= times;
	} else if (at == &scene->mount_damping_ratio) {
		scene->mount_damping_n_s_m *= times;
	}
}

/* Of the contact's law, as the scene has it; NAN: there is no such law. */
static double vary_contact_time(const struct scene *s)
{
	double speed = sqrt(2.0 * s->drop_gravity_m_s2 * s->contact_duration_height_m);
	struct contact_law law;

	return contact_law_init(&law, s->contact_restitution) == 0
	               ? contact_duration(&law, s->contact_mass_kg, speed, s->contact_stiffness_n_m15)
	               : (double)NAN;
}

/* In the order of scene_fitted. */
void vary_fitted(struct scene *s, const double move[SCENE_FITTED])
{
	double before = vary_contact_time(s);
	double *const relative[SCENE_FITTED] = {
	        [0] = &s->contact_stiffness_n_m15, [3] = &s->contact_tangential_ratio,
	        [4] = &s->mount_stiffness_n_m,     [6] = &s->mount_softening_strain,
	        [7] = &s->mount_damping_n_s_m,
	};

	for (int i = 0; i < SCENE_FITTED; i++)
		if (relative[i])
			*relative[i] *= exp(move[i]);
	s->contact_restitution = 1.0 / (1.0 + (1.0 / s->contact_restitution - 1.0) * exp(-move[1]));
	s->contact_duration_s *= vary_contact_time(s) / before;
	s->product_balance_angle_deg += move[2];
	s->mount_softening = fmax(s->mount_softening + move[5], 0.0);
	s->sensor_s1_yaw_deg += move[8];
}
