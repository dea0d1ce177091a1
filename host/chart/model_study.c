/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/chart/model_study.h"

#include <math.h>

const double study_angles_deg[STUDY_ANGLES] = {15, 20, 25, 30, 35};

const struct study_mean study_means[STUDY_PRODUCTS][STUDY_ANGLES] = {{{578.7, 191.1, 609.4, 590.6, 271.6},
                                                                      {500.4, 213.2, 543.9, 509, 243.3},
                                                                      {465.1, 188.2, 501.7, 453.4, 206.2},
                                                                      {445, 234.6, 503.1, 440.6, 202.1},
                                                                      {424.3, 254.4, 494.7, 414.1, 198.1}},
                                                                     {{347.2, 129.2, 370.5, 536.4, 256.4},
                                                                      {352.6, 118.7, 372, 507.6, 241},
                                                                      {310.1, 133, 337.4, 485.1, 218.4},
                                                                      {339.5, 176.2, 382.5, 471.9, 200.4},
                                                                      {325, 169.4, 366.5, 455.2, 195.7}},
                                                                     {{420.7, 186.9, 460.3, 627.4, 302.4},
                                                                      {410.8, 224.5, 468.1, 517.9, 238.2},
                                                                      {401, 225.9, 460.3, 475.2, 220.2},
                                                                      {397.6, 245.9, 467.5, 445.8, 198.1},
                                                                      {382.1, 245, 453.9, 417.5, 184.3}}};

static const struct scene unset = {
#define SCENE_KEY(section, key, min, max, initial, doc) .section##_##key = (initial),
#include "common/scenes/scene.def"
#undef SCENE_KEY
};

struct scene study_scene(enum study_product product, double angle_deg)
{
	struct scene s = unset;

	s.drop_height_m = 0.894;
	s.drop_angle_deg = angle_deg;
	s.product_case_mass_kg = product == STUDY_BOX ? 0.173 : 0.169;
	s.product_length_m = 0.289;
	s.product_width_m = 0.101;
	s.product_thickness_m = 0.021;
	s.product_balance_angle_deg = 25;
	s.contact_duration_s = 0.003;
	s.contact_duration_height_m = 0.894;
	s.contact_mass_kg = 0.173;
	s.contact_restitution = 0.5;
	s.contact_stiffness_n_m15 = 3.81e6;
	s.contact_mat_modulus_pa = 1.6896386e6;
	s.sensor_s2_offset_m = 0.065;
	if (product == STUDY_BOX)
		return s;
	s.mount_plate_mass_kg = 0.014;
	s.mount_stiffness_n_m = product == STUDY_2A ? 7550 : 7550 * 5 / 3.0;
	s.mount_damping_n_s_m = product == STUDY_2A ? 2.0838 : 3.4730;
	s.mount_cube_m = product == STUDY_2A ? 0.003 : 0.005;
	s.mount_softening = 1 / 3.0;
	s.sensor_s1_yaw_deg = product == STUDY_2A ? 0 : 4.7;
	return s;
}
