/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_UNIT_TOWER_BY_HAND_H
#define DT_TESTS_UNIT_TOWER_BY_HAND_H
/*
 * A tower whose numbers a test can work out: 2A at a site of 9.81 m/s2, all marks and times round.
 */
#include <math.h>

#include "common/wire.h"
#include "hil/tower.h"

enum { LATCH, MAGNET, RELIEVE, CAMERA };
enum { KEEPER = 2 }; /* the capture behind those of the gates */

#define G 9.81 /* at the site; of a reading it is G_M_S2 */
#define G_M_S2 9.80665
#define HEIGHT_M 0.894
#define ALL_M_S2 (G - 0.3 / 3.183) /* frame and product together */
#define FRAME_M_S2 (G - 0.3 / 3.0)
#define BRAKE_M_S2 (G * 0.8 / (0.8 * 0.1))

static inline struct scene test_scene(void)
{
	struct scene scene;
	char message[SCENE_MESSAGE_MAX];

	if (scene_read(&scene, "common/scenes/geometry-2A.ini", message) != 0)
		fail_msg("%s", message);
	scene.drop_height_m = HEIGHT_M;
	scene.drop_gravity_m_s2 = G;
	scene.tower_frame_mass_kg = 3.0;
	scene.tower_frame_friction_n = 0.3;
	scene.tower_latch_delay_s = 0.012;
	scene.tower_magnet_dropout_s = 0.008;
	scene.tower_gate_upper_m = 0.2;
	scene.tower_gate_lower_m = 0.7;
	scene.tower_separation_m = 0.78;
	scene.tower_dampers_m = 0.8;
	scene.tower_damper_stroke_m = 0.1;
	return scene;
}

static inline struct tower *make(const struct scene *scene, bool ideal, uint64_t seed)
{
	const struct tower_options options = {.seed = seed, .ideal = ideal};
	struct tower *tower = tower_create(scene, &options);

	assert_non_null(tower);
	return tower;
}

static inline struct tower *make_ideal(void)
{
	const struct scene scene = test_scene();

	return make(&scene, true, 1);
}

/* Magnet on, latch energised at 0.1 s: open at 0.112 s. */
static inline struct tower *falling_of(const struct scene *scene)
{
	struct tower *tower = make(scene, true, 1);

	tower_output(tower, MAGNET, true, 0.01);
	tower_output(tower, LATCH, true, 0.1);
	return tower;
}

static inline struct tower *falling(void)
{
	const struct scene scene = test_scene();

	return falling_of(&scene);
}

static inline double fall_time(double travel_m)
{
	return 0.112 + sqrt(2 * travel_m / ALL_M_S2);
}

#endif
