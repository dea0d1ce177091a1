/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_UNIT_DRAWN_SCENE_H
#define DT_TESTS_UNIT_DRAWN_SCENE_H
/*
 * Random products and drops, the same ones for each seed: cubes to crates, 8 to 60 deg, 0.05 to 2.4 m, plates
 * of 0.001 to 2 times the box, contacts of 0.5 to 15 ms.
 */
#include <math.h>
#include <stdint.h>

#include "common/scenes/scene.h"
#include "common/units.h"

static inline double drawn_uniform(uint64_t *seed, double low, double high)
{
	*seed = *seed * 6364136223846793005u + 1442695040888963407u;
	return low + (high - low) * (double)(*seed >> 11) / 9007199254740992.0;
}

static inline double drawn_spread(uint64_t *seed, double low, double high)
{
	return low * pow(high / low, drawn_uniform(seed, 0.0, 1.0));
}

/* Cubes to crates; the mat is thicker than any dent. */
static inline struct scene drawn_scene(uint64_t *seed)
{
	double side = drawn_spread(seed, 0.03, 2.0), contact_s = drawn_spread(seed, 0.5e-3, 15e-3),
	       mass = drawn_spread(seed, 0.05, 50.0);
	struct scene s = {
	        .drop_height_m = drawn_spread(seed, 0.05, 2.4),
	        .drop_gravity_m_s2 = UNITS_G_M_S2,
	        .drop_angle_deg = drawn_uniform(seed, 8.0, 60.0),
	        .product_case_mass_kg = mass,
	        .product_length_m = side,
	        .product_width_m = side * drawn_uniform(seed, 0.3, 1.0),
	        .product_balance_angle_deg = drawn_uniform(seed, 15.0, 45.0),
	        .product_inertia_ratio = drawn_uniform(seed, 0.7, 1.6),
	        .contact_duration_s = contact_s,
	        .contact_restitution = drawn_uniform(seed, 0.01, 0.99),
	        .contact_mass_kg = mass,
	        .contact_mat_thickness_m = 10.0,
	        .contact_tangential_ratio = drawn_uniform(seed, 0.0, 3.0),
	        .contact_friction = drawn_uniform(seed, 0.05, 1.0),
	        .sensor_s2_offset_m = side * drawn_uniform(seed, 0.0, 0.4),
	        .mount_plate_mass_kg = mass * drawn_spread(seed, 0.001, 2.0),
	        .mount_cube_m = 0.003,
	        .mount_softening = drawn_uniform(seed, 0.0, 1.0),
	        .mount_softening_strain = 0.8,
	        .mount_damping_ratio = 0.1,
	};
	double plate = s.mount_plate_mass_kg,
	       omega = 2.0 * UNITS_PI * drawn_spread(seed, 0.08, 6.0) / contact_s;

	s.contact_duration_height_m = s.drop_height_m;
	s.mount_stiffness_n_m = omega * omega / (1.0 / plate + 1.0 / mass);
	s.mount_damping_n_s_m = 2.0 * drawn_uniform(seed, 0.01, 0.5) * s.mount_stiffness_n_m / omega;
	s.contact_stiffness_n_m15 =
	        mass * pow(3.3 / contact_s, 2.5) / pow(2.0 * UNITS_G_M_S2 * s.drop_height_m, 0.25);
	return s;
}

#endif
