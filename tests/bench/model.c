/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * make bench, the model: what a prediction costs on one core, beside GSL's rk8pd on the same equations
 * written plainly, and what the least rung saves against always taking planar.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include <gsl/gsl_errno.h>

#include "host/chart/model_numerics.h"
#include "host/model/drop.h"
#include "host/model/ensemble.h"
#include "tests/bench/stopwatch.h"

#define SCENE "common/scenes/geometry-2A.ini"

/* At this grid a parabola through rk8pd's samples finds peaks to some 1e-5. */
enum { GRID = 120, SWEEP = 1000000, QUESTIONS = 500 };
#define GRID_S 5e-5
#define GSL_TOLERANCE 1e-6

static struct scene scene;

static void must(bool done, const char *what)
{
	if (done)
		return;
	fprintf(stderr, "bench: %s failed\n", what);
	exit(1);
}

/* ---- one scene ---- */

struct task {
	enum model_fidelity fidelity;
	struct model_options options;
};

static void predict(void *context)
{
	const struct task *task = context;
	struct model_prediction p;

	must(model_solve(&scene, task->fidelity, &task->options, &p, NULL) == 0, "a prediction");
}

static struct motion plain;

static void by_gsl(void *context)
{
	double y[GRID][MOTION_STATES_MAX], box = 0.0, plate = 0.0;

	plain.planar = context != NULL;
	must(motion_by_gsl(&plain, "rk8pd", GSL_TOLERANCE, GRID_S, GRID, y) == 0, "GSL");
	for (int k = 0; k < GRID; k++) {
		box = fmax(box, motion_box(&plain, y[k]));
		plate = fmax(plate, motion_plate(&plain, y[k]));
	}
	must(box > 1000.0 && plate > 1000.0, "GSL's peaks");
}

/* ---- the least rung ---- */

static struct {
	struct scene scene;
	struct model_options options;
} questions[QUESTIONS];

static void prepare_questions(void)
{
	static const double accuracy[] = {0.01, 0.02, 0.05, 0.1, 0.2};
	struct ensemble e = {.scene = &scene, .seed = 5};
	static const struct {
		const char *name;
		double sd;
	} vary[] = {{"angle", 8},
	            {"height", 0.3},
	            {"restitution", 0.12},
	            {"contact-time", 0.0007},
	            {"stiffness", 3000},
	            {"mount.plate_mass_kg", 0.006},
	            {"product.balance_angle_deg", 4},
	            {"contact.tangential_ratio", 1}};

	for (size_t i = 0; i < sizeof(vary) / sizeof(vary[0]); i++) {
		must(vary_find(vary[i].name, &e.axis[i].key) == 0, "a key");
		e.axis[i].sd = vary[i].sd;
		e.axes++;
	}
	for (size_t i = 0, point = 0; i < QUESTIONS; point++) {
		double value[ENSEMBLE_KEYS_MAX];
		struct model_prediction p;

		ensemble_random_scene(&e, point, &questions[i].scene, value);
		if (model_solve(&questions[i].scene, MODEL_PLANAR, NULL, &p, NULL) != 0)
			continue;
		questions[i].options = model_defaults;
		questions[i].options.asked = 1u << (i % 6);
		questions[i].options.accuracy = accuracy[i / 6 % 5];
		i++;
	}
}

/* All questions, by what is taken for each. */
static void answer(void *context)
{
	enum model_fidelity fidelity = *(enum model_fidelity *)context;

	for (int i = 0; i < QUESTIONS; i++) {
		struct model_prediction p;

		must(model_solve(&questions[i].scene, fidelity,
		                 fidelity == MODEL_AUTO ? &questions[i].options : NULL, &p, NULL) == 0,
		     "an answer");
	}
}

/* ---- a million ---- */

static void sweep_block(void *context, size_t first, size_t count, int thread)
{
	const struct ensemble *e = context;

	(void)thread;
	for (size_t k = first; k < first + count; k++) {
		double value[ENSEMBLE_KEYS_MAX];
		struct model_prediction p;
		struct scene at;

		ensemble_grid_scene(e, k, &at, value);
		must(model_solve(&at, e->fidelity, &e->options, &p, NULL) == 0, "a point of the sweep");
	}
}

static void sweep(void *context)
{
	must(ensemble_run(SWEEP, sweep_block, NULL, context) == 0, "the sweep");
}

/* ---- the table ---- */

static double print_row(const char *name, void (*work)(void *), void *context, double target_us)
{
	struct stopwatch time = stopwatch_time(work, context);

	printf("%-44s %12.2f %12.2f", name, time.median_us, time.best_us);
	if (target_us > 0)
		printf(" %10.0f  %s", target_us, time.median_us <= target_us ? "met" : "NOT MET");
	printf("\n");
	fflush(stdout);
	return time.median_us;
}

static void prepare_plain(void)
{
	struct contact_law law;
	struct drop drop;

	must(drop_of_scene(&scene, &drop, NULL) == 0, "the scene");
	must(drop_contact(&drop, &law, &plain.stiffness_n_m15, NULL) == 0, "the contact");
	plain.box_kg = scene.product_case_mass_kg;
	plain.plate_kg = scene.mount_plate_mass_kg;
	plain.inertia_kg_m2 = drop.inertia_kg_m2;
	plain.speed_m_s = drop.speed_m_s;
	plain.angle_rad = drop.angle;
	plain.lever_x_m = drop.lever_x_m;
	plain.lever_y_m = drop.lever_y_m;
	plain.damping = law.damping;
	plain.mount_n_m = scene.mount_stiffness_n_m;
	plain.mount_damping_n_s_m = drop.mount_damping_n_s_m;
}

int main(void)
{
	struct task sdof = {MODEL_SDOF, model_defaults}, coupled = {MODEL_COUPLED, model_defaults};
	struct task planar = {MODEL_PLANAR, model_defaults}, peaks = {MODEL_PLANAR, model_defaults};
	struct task bare = {MODEL_PLANAR, model_defaults};
	enum model_fidelity least = MODEL_AUTO, always = MODEL_PLANAR;
	struct ensemble grid = {
	        .scene = &scene, .fidelity = MODEL_SDOF, .options = model_defaults, .axes = 2};
	char message[SCENE_MESSAGE_MAX];
	double with, without, million;

	gsl_set_error_handler_off();
	must(scene_read(&scene, SCENE, message) == 0, SCENE);
	prepare_plain();
	prepare_questions();
	peaks.options.ring = false;
	bare.options.ring = false;
	bare.options.refinements = 0;
	printf("%-44s %12s %12s %10s\n", "the model, us on one core", "median", "best", "asked for");
	print_row("sdof", predict, &sdof, 3);
	print_row("coupled, all peaks to 1e-5", predict, &coupled, 20);
	print_row("  by GSL's rk8pd, 50 us grid", by_gsl, NULL, 0);
	print_row("planar, bare, all peaks to 1e-5", predict, &bare, 0);
	print_row("  by GSL's rk8pd, 50 us grid", by_gsl, &plain, 0);
	print_row("planar, all refinements, peaks to 1e-5", predict, &peaks, 60);
	print_row("planar, all refinements and the ring-down", predict, &planar, 60);
	without = print_row("500 random questions, always planar", answer, &always, 0);
	with = print_row("500 random questions, the least rung", answer, &least, 0);
	printf("the least rung costs %.1f times less than always planar (asked: 5)\n", without / with);
	must(vary_find("contact.duration_s", &grid.axis[0].key) == 0 &&
	             vary_find("drop.angle_deg", &grid.axis[1].key) == 0,
	     "a key");
	grid.axis[0].from = 0.002;
	grid.axis[0].step = 2e-6;
	grid.axis[1].from = 15;
	grid.axis[1].step = 0.02;
	grid.axis[0].count = grid.axis[1].count = 1000;
	million = print_row("10^6 sdof scenes on all cores", sweep, &grid, 3e6);
	printf("that is %.2f s\n", million * 1e-6);
	return 0;
}
