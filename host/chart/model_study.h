/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CHART_MODEL_STUDY_H
#define DT_HOST_CHART_MODEL_STUDY_H
/*
 * The study's drops as the model's charts take them: its three products and the means it published for them
 * (Tables 1 to 3, magnitudes in g). The charts are about these numbers, so they need no scene file; that
 * they are those of common/scenes is tested.
 */
#include "common/scenes/scene.h"

enum study_product { STUDY_BOX, STUDY_2A, STUDY_2B, STUDY_PRODUCTS };
enum { STUDY_ANGLES = 5 };

extern const double study_angles_deg[STUDY_ANGLES];

struct study_mean {
	double s1_x, s1_y, s1_r, s2_x, s2_y;
};
extern const struct study_mean study_means[STUDY_PRODUCTS][STUDY_ANGLES];

struct scene study_scene(enum study_product product, double angle_deg);

#endif
