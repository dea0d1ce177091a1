/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * `droptower scene new`: a first scene of a product from its masses and sizes, which `droptower fit`
 * improves.
 */
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "common/base/number.h"
#include "common/scenes/scene.h"
#include "common/units.h"
#include "host/base/atomic_file.h"
#include "host/command/command.h"
#include "host/model/contact.h"
#include "host/model/corner.h"

struct arguments {
	double mass_kg, length_m, width_m, thickness_m, height_m, s2_offset_m, plate_kg, cube_m;
	double mat_modulus_pa, mat_thickness_m, edge_radius_m; /* all or none */
};

static const struct option_row rows[] = {
        OPTION_NUMBER("mass", "KG", struct arguments, mass_kg, 0.001, 50,
                      "the box with what is fixed in it, S2 included"),
        OPTION_NUMBER("length", "M", struct arguments, length_m, 0.005, 2, "along X"),
        OPTION_NUMBER("width", "M", struct arguments, width_m, 0.005, 2, "along Y"),
        OPTION_NUMBER("thickness", "M", struct arguments, thickness_m, 0.001, 2, "along Z"),
        OPTION_NUMBER("height", "M", struct arguments, height_m, 0.05, 5, "of the drops"),
        OPTION_NUMBER("s2-offset", "M", struct arguments, s2_offset_m, -1, 1,
                      "S2 from the centre of gravity along X"),
        OPTION_NUMBER("plate", "KG", struct arguments, plate_kg, 0, 50,
                      "the plate with S1; 0: there is none"),
        OPTION_NUMBER("cube", "M", struct arguments, cube_m, 0, 0.1,
                      "side of one of the four rubber cubes under it"),
        OPTION_NUMBER("mat-modulus", "PA", struct arguments, mat_modulus_pa, 1e3, 1e12,
                      "of the rubber it falls on, to predict the contact with the next two"),
        OPTION_NUMBER("mat-thickness", "M", struct arguments, mat_thickness_m, 1e-4, 1, "of that mat"),
        OPTION_NUMBER("edge-radius", "M", struct arguments, edge_radius_m, 1e-5, 1,
                      "of the edge that strikes, 0.25 to 2 mats' thickness"),
};

enum { ASKED = 8 }; /* the first rows; the others are given or not */

static const struct option_table scene_options = {
        .program = "droptower",
        .command = "scene",
        .head = "usage: droptower scene new FILE.ini [OPTIONS]\n"
                "\n"
                "A first scene of a product. What no option gives is asked for on a terminal, mat and\n"
                "edge excepted. Contact, grip and mounts are filled by rules of the study's boxes, to be\n"
                "improved by 'droptower fit'; with mat and edge the contact is 'corner', which predicts it\n"
                "with its uncertainty.\n"
                "\n",
        OPTION_ROWS(rows),
        .words = true,
};

/* Of the study's boxes: mat and corner, and the rubber under the plate. */
#define RULE_STIFFNESS_N_M15 3.81e6
#define RULE_RESTITUTION 0.5
#define RULE_RUBBER_PA 629e3 /* stiffness of four cubes over four times their side */
#define RULE_SOFTENING 0.2
#define RULE_DAMPING_S 2.76e-4

/* The value of a row, asked for where it is not given. */
static int scene_ask(const struct option_row *row, double *value)
{
	char line[128];

	if (!isnan(*value))
		return COMMAND_DONE;
	if (!isatty(STDIN_FILENO))
		return command_usage("scene", "--%s is missing: %s", row->name, row->help);
	for (;;) {
		fprintf(stderr, "%s (%s), %s: ", row->name, row->value, row->help);
		if (fgets(line, sizeof(line), stdin) == NULL)
			return COMMAND_USAGE;
		line[strcspn(line, "\n")] = '\0';
		if (number_read(line, row->min, row->max, value))
			return COMMAND_DONE;
		fprintf(stderr, "expected a number from %g to %g\n", row->min, row->max);
	}
}

static void scene_fill(const struct arguments *a, const char *file, struct scene *s)
{
	const char *name = strrchr(file, '/') ? strrchr(file, '/') + 1 : file;
	double speed;
	struct contact_law law;

	snprintf(s->name, sizeof(s->name), "%.*s", (int)strcspn(name, "."), name);
	snprintf(s->title, sizeof(s->title), "Box %.0f x %.0f x %.0f mm", 1e3 * a->length_m, 1e3 * a->width_m,
	         1e3 * a->thickness_m);
	s->drop_height_m = a->height_m;
	s->product_case_mass_kg = a->mass_kg;
	s->product_length_m = a->length_m;
	s->product_width_m = a->width_m;
	s->product_thickness_m = a->thickness_m;
	s->product_balance_angle_deg = UNITS_DEG(atan(a->width_m / a->length_m));
	s->contact_restitution = RULE_RESTITUTION;
	s->contact_duration_height_m = a->height_m;
	s->contact_mass_kg = a->mass_kg;
	s->contact_stiffness_n_m15 = RULE_STIFFNESS_N_M15;
	s->sensor_s2_offset_m = a->s2_offset_m;
	speed = sqrt(2.0 * s->drop_gravity_m_s2 * a->height_m);
	if (contact_law_init(&law, RULE_RESTITUTION) == 0)
		s->contact_duration_s = contact_duration(&law, a->mass_kg, speed, RULE_STIFFNESS_N_M15);
	if (a->mat_modulus_pa > 0.0) {
		s->contact_stiffness_n_m15 = s->contact_duration_s = (double)NAN;
		s->contact_mat_modulus_pa = a->mat_modulus_pa;
		s->contact_mat_thickness_m = a->mat_thickness_m;
		s->contact_corner_radius_m = a->edge_radius_m;
	}
	if (!(a->plate_kg > 0.0))
		return;
	s->mount_plate_mass_kg = a->plate_kg;
	s->mount_cube_m = a->cube_m;
	s->mount_stiffness_n_m = 4.0 * RULE_RUBBER_PA * a->cube_m;
	s->mount_damping_n_s_m = RULE_DAMPING_S * s->mount_stiffness_n_m;
	s->mount_damping_ratio = s->mount_damping_n_s_m / (2.0 * sqrt(s->mount_stiffness_n_m * a->plate_kg));
	s->mount_softening = RULE_SOFTENING;
}

static int scene_make(const struct arguments *a, const char *file)
{
	char message[SCENE_MESSAGE_MAX];
	struct atomic_file atomic;
	struct scene predicted, s = {
#define SCENE_KEY(section, key, min, max, initial, doc) .section##_##key = initial,
#include "common/scenes/scene.def"
#undef SCENE_KEY
	                        };

	if (access(file, F_OK) == 0) {
		command_error("%s: there is one already, expected a new file", file);
		return COMMAND_INPUT;
	}
	scene_fill(a, file, &s);
	predicted = s;
	if (corner_fill(&predicted, message) != 0) {
		command_error("%s: %s", file, message);
		return COMMAND_INPUT;
	}
	if (atomic_file_open(&atomic, file, message, sizeof(message)) == 0) {
		scene_write(&s, atomic.out);
		if (atomic_file_close(&atomic, 0, message, sizeof(message)) == 0 &&
		    scene_read(&s, file, message) == 0)
			return COMMAND_DONE;
	}
	command_error("%s", message);
	return COMMAND_INPUT;
}

int command_scene(int argc, char **argv)
{
	struct arguments a = {NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN};
	double *value[ASKED] = {&a.mass_kg,  &a.length_m,    &a.width_m,  &a.thickness_m,
	                        &a.height_m, &a.s2_offset_m, &a.plate_kg, &a.cube_m};
	int code = option_read(&scene_options, &a, argc, argv);

	if (code != OPTIONS_READ)
		return code;
	if (argc - optind != 2 || strcmp(argv[optind], "new") != 0)
		return command_usage("scene", "expected new FILE.ini");
	if (isnan(a.mat_modulus_pa) != isnan(a.mat_thickness_m) ||
	    isnan(a.mat_modulus_pa) != isnan(a.edge_radius_m))
		return command_usage("scene", "expected --mat-modulus, --mat-thickness and --edge-radius "
		                              "together, or none of them");
	for (int i = 0; i < ASKED; i++) {
		if (value[i] == &a.cube_m && !(a.plate_kg > 0.0))
			continue;
		code = scene_ask(&rows[i], value[i]);
		if (code != COMMAND_DONE)
			return code;
	}
	return scene_make(&a, argv[optind + 1]);
}
