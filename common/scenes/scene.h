/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_COMMON_SCENES_SCENE_H
#define DT_COMMON_SCENES_SCENE_H
/*
 * A scene: what is dropped, how, and with which sensors, read from an .ini file. Linux side only (host
 * and bench). The keys stand in scene.def. A scene is data: no formula lives here, so that the bench's
 * plant and the host's model share none.
 */
#include <stdio.h>

#include "common/error.h"
#include "common/scenes/settings.h"

enum { SCENE_MESSAGE_MAX = SETTINGS_MESSAGE_MAX, SCENE_FITTED = 9, SCENE_LIMITS_MAX = 2048 };

/* What a fit finds of a product, in the order of the keys of section [fit]. There, `KEY = u r1 r2 ...` is its
 * standard uncertainty and its correlations with the keys before it. u is relative, but in deg of angles, of
 * softening absolute, of restitution e that of ln(e/(1 - e)). */
extern const char *const scene_fitted[SCENE_FITTED];

struct scene {
	char name[64];    /* key `name` before any section, e.g. "geometry-2A" */
	char title[128];  /* key `title`, for reports */
	char chain[1024]; /* keys `chain`: files of its sensors (transducer.h), commas between; "": none */
#define SCENE_KEY(section, key, min, max, initial, doc) double section##_##key;
#include "common/scenes/scene.def"
#undef SCENE_KEY
	double predicted_u;            /* relative, of a stiffness_n_m15 that was `corner`; 0: it was not */
	double fitted_u[SCENE_FITTED]; /* 0: not known; of a predicted contact the first alone */
	double fitted_correlation[SCENE_FITTED][SCENE_FITTED];
	/* Section [limits] as it stands, "LINE:KEY=VALUE\n" each: what it means is the host's
	 * (host/result/plan.h). */
	char limits[SCENE_LIMITS_MAX];
};

/* Reads and checks file. 0, or DT_E_* with "FILE:LINE: what is wrong, what was expected" in message and
 * *scene unchanged. Unknown sections and keys, missing or repeated keys, text that is no number, values
 * out of range or not finite are all errors, and so are combinations that make no product: a plate without
 * stiffness. A stiffness_n_m15 or duration_s that is `corner` comes as NAN. The drop that a contact time is
 * of, where it is not given, is this one, and stays it when height or mass are changed after reading. */
DT_MUST_USE int scene_read(struct scene *scene, const char *file, char message[SCENE_MESSAGE_MAX]);

/* The same for values changed after reading, e.g. an angle from the command line; where names it in the
 * message. */
DT_MUST_USE int scene_check(const struct scene *scene, const char *where, char message[SCENE_MESSAGE_MAX]);

/* Whether a tower can let it fall: gates, separation and dampers in order between latch and mat. Only who
 * runs a drop asks. */
DT_MUST_USE int scene_check_tower(const struct scene *scene, const char *where,
                                  char message[SCENE_MESSAGE_MAX]);

/* Takes files of sensors, commas between, names seen from beside's folder ("": from here), so that they are
 * found from anywhere. 0, or DT_E_FORMAT and there are none. */
DT_MUST_USE int scene_set_chain(struct scene *scene, const char *list, const char *beside);

/* The next file of such a list: *list is moved to where its name begins. Its length, 0 when there is none. */
size_t scene_chain_file(const char **list);

/* Writes all that differs from what a key is without being given, [fit] where u is known, and [limits]. */
void scene_write(const struct scene *scene, FILE *out);

/* What section.key of scene.def may be; NAN when there is no such key. */
void scene_limits(const char *section, const char *key, double *min, double *max);

#endif
