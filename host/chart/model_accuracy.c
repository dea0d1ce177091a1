/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/chart/model_accuracy.h"

#include <math.h>
#include <stdlib.h>
#include <time.h>

#include <gsl/gsl_sort.h>
#include <gsl/gsl_statistics_double.h>

#include "host/chart/chart.h"
#include "host/chart/model_study.h"
#include "host/chart/timing.h"
#include "host/chart/plot.h"
#include "host/model/model.h"

static const struct {
	const char *name;
	enum model_fidelity fidelity;
	unsigned refinements;
	bool measured_time;
	int style;
} rungs[LADDER_RUNGS] = {
        {"paper, as printed", MODEL_PAPER, 0, false, 7},
        {"paper, contact time as measured", MODEL_PAPER, 0, true, 8},
        {"steady", MODEL_STEADY, 0, false, 6},
        {"sdof", MODEL_SDOF, 0, false, 5},
        {"coupled", MODEL_COUPLED, 0, false, 3},
        {"coupled + wedge", MODEL_COUPLED, MODEL_WEDGE, false, 9},
        {"planar, no refinement", MODEL_PLANAR, 0, false, 10},
        {"planar + wedge", MODEL_PLANAR, MODEL_WEDGE, false, 2},
        {"planar, all", MODEL_PLANAR, MODEL_REFINEMENTS, false, 1},
};

/* What the deviations are taken of: S1 (the plate's, in geometry 1 the box's) and S2. */
struct answer {
	double s1_r, s2_x, s2_y;
};

/* A mean over what has a value; count NAN when something has none. */
struct mean {
	double sum, count;
};

static void model_accuracy_add(struct mean *mean, double value, double truth)
{
	mean->sum += 100 * fabs(fabs(value) / truth - 1);
	mean->count++;
}

static void add_answer(struct mean mean[LADDER_QUANTITIES], enum study_product product,
                       const struct answer *a, const struct answer *truth)
{
	model_accuracy_add(&mean[product == STUDY_BOX ? LADDER_BOX : LADDER_PLATE], a->s1_r, truth->s1_r);
	model_accuracy_add(&mean[LADDER_S2], a->s2_x, truth->s2_x);
	model_accuracy_add(&mean[LADDER_S2], a->s2_y, truth->s2_y);
}

static struct answer answer_of(const struct model_prediction *p)
{
	return (struct answer){p->has_plate ? p->resultant[0].value_g : p->box.value_g,
	                       p->peak[MODEL_S2X].value_g, p->peak[MODEL_S2Y].value_g};
}

static struct answer answer_of_study(enum study_product product, size_t angle)
{
	const struct study_mean *m = &study_means[product][angle];

	return (struct answer){m->s1_r, m->s2_x, m->s2_y};
}

struct question {
	const struct scene *scene;
	enum model_fidelity fidelity;
	const struct model_options *options;
};

static void ask_model(const void *context)
{
	const struct question *q = context;
	struct model_prediction p;

	if (model_solve(q->scene, q->fidelity, q->options, &p, NULL) != 0)
		return;
}

static int ask_drop(size_t rung, enum study_product product, size_t angle, struct ladder *ladder,
                    double *cost_us, struct mean tables[LADDER_QUANTITIES],
                    struct mean finest[LADDER_QUANTITIES])
{
	const struct model_options options = {.refinements = rungs[rung].refinements,
	                                      .paper_measured_time = rungs[rung].measured_time},
	                           tight = {.refinements = MODEL_REFINEMENTS,
	                                    .tolerance = MODEL_TOLERANCE_MIN};
	const struct scene scene = study_scene(product, study_angles_deg[angle]);
	const struct question question = {&scene, rungs[rung].fidelity, &options};
	struct model_prediction p, best;
	int status = model_solve(&scene, rungs[rung].fidelity, &options, &p, NULL);
	struct answer a, truth;

	if (!status)
		status = model_solve(&scene, MODEL_PLANAR, &tight, &best, NULL);
	if (status)
		return status;
	ladder->name[rung] = rungs[rung].name;
	a = answer_of(&p);
	truth = answer_of_study(product, angle);
	add_answer(tables, product, &a, &truth);
	truth = answer_of(&best);
	truth = (struct answer){fabs(truth.s1_r), fabs(truth.s2_x), fabs(truth.s2_y)};
	add_answer(finest, product, &a, &truth);
	if (cost_us)
		*cost_us = timing_us(ask_model, &question, TIMING_BATCH_US, TIMING_BATCHES);
	return 0;
}

/* Per product and column the mean over the angles, which no model can do without being told. */
static void find_constant(struct ladder *ladder)
{
	struct mean mean[LADDER_QUANTITIES] = {{0}};

	for (int g = 0; g < STUDY_PRODUCTS; g++) {
		struct answer constant = {0};

		for (size_t i = 0; i < STUDY_ANGLES; i++) {
			constant.s1_r += study_means[g][i].s1_r / STUDY_ANGLES;
			constant.s2_x += study_means[g][i].s2_x / STUDY_ANGLES;
			constant.s2_y += study_means[g][i].s2_y / STUDY_ANGLES;
		}
		for (size_t i = 0; i < STUDY_ANGLES; i++) {
			struct answer truth = answer_of_study((enum study_product)g, i);

			add_answer(mean, (enum study_product)g, &constant, &truth);
		}
	}
	for (int q = 0; q < LADDER_QUANTITIES; q++)
		ladder->constant[q] = mean[q].sum / mean[q].count;
}

int ladder_find(int timed, struct ladder *ladder)
{
	for (size_t rung = 0; rung < LADDER_RUNGS; rung++) {
		struct mean tables[LADDER_QUANTITIES] = {{0}}, finest[LADDER_QUANTITIES] = {{0}};
		double cost[STUDY_PRODUCTS * STUDY_ANGLES];
		size_t n = 0;

		for (int g = 0; g < STUDY_PRODUCTS; g++)
			for (size_t i = 0; i < STUDY_ANGLES; i++, n++) {
				int status = ask_drop(rung, (enum study_product)g, i, ladder,
				                      timed ? &cost[n] : NULL, tables, finest);

				if (status)
					return status;
			}
		for (int q = 0; q < LADDER_QUANTITIES; q++) {
			ladder->tables[rung][q] = tables[q].sum / tables[q].count;
			ladder->finest[rung][q] = finest[q].sum / finest[q].count;
		}
		ladder->cost_us[rung] = NAN;
		if (timed) {
			gsl_sort(cost, 1, n);
			ladder->cost_us[rung] = gsl_stats_median_from_sorted_data(cost, 1, n);
		}
	}
	find_constant(ladder);
	return 0;
}

/* ---- the pictures -----------------------------------------------------------------------------------------
 */

/* x of the line that stands for what costs nothing. */
static const double across[] = {0.05, 500};

static void model_accuracy_fill_panel(struct plot_panel *panel, const struct ladder *ladder,
                                      double (*value)[LADDER_QUANTITIES], int q, double constant[2])
{
	static const char *const title[] = {
	        [LADDER_PLATE] = "Plate (S1), resultant, 2A and 2B: 10 drops",
	        [LADDER_S2] = "Box beside its centre (S2), X and Y: 15 drops",
	        [LADDER_BOX] = "Box (S1), resultant, geometry 1: 5 drops",
	};
	size_t n = 0;

	*panel = (struct plot_panel){
	        .title = title[q],
	        .x = {"us a drop", "cost_us", across[0], across[1], true, NULL},
	        .y = {q ? "" : "mean deviation of peaks, %", "deviation_percent", 1, 3000, true, NULL},
	        .key = q == LADDER_BOX ? "at screen 0.55,0.36 left top" : NULL, /* beside it */
	};
	for (size_t rung = 0; rung < LADDER_RUNGS; rung++)
		panel->series[n++] = (struct plot_series){.name = rungs[rung].name,
		                                          .x = &ladder->cost_us[rung],
		                                          .y = &value[rung][q],
		                                          .count = 1,
		                                          .marks = true,
		                                          .colour = rungs[rung].style};
	if (constant)
		panel->series[n++] = (struct plot_series){
		        .name = "a constant fitted to the tables", .x = across, .y = constant, .count = 2};
}

static int draw_tables(const struct chart_options *options, struct ladder *ladder, char *message)
{
	struct plot_panel panel[LADDER_QUANTITIES];
	double constant[LADDER_QUANTITIES][2];
	const struct plot plot = {
	        .name = "tables",
	        .title = "What a drop should look like: every rung of the model against the study's tables",
	        .note = {"Mean deviation from the published means at 15 to 35 deg. Down and left is better. "
	                 "Of the rungs only planar, all was fitted to such drops (contact, grip, mounts).",
	                 "The plate's peak needs the transient (sdof); the box's and S2's the skewed contact "
	                 "(coupled), best with the wedge; beyond that only what was fitted helps."},
	        .panel = panel,
	        .panels = LADDER_QUANTITIES,
	};

	for (int q = 0; q < LADDER_QUANTITIES; q++) {
		constant[q][0] = constant[q][1] = ladder->constant[q];
		model_accuracy_fill_panel(&panel[q], ladder, ladder->tables, q, constant[q]);
	}
	return plot_write(&plot, options->folder, "model", message);
}

static int draw_finest(const struct chart_options *options, struct ladder *ladder, char *message)
{
	struct plot_panel panel[LADDER_QUANTITIES];
	const struct plot plot = {
	        .name = "finest",
	        .title = "What a drop should look like: every rung of the model against the finest one",
	        .note = {"Mean deviation from planar with all refinements at a tolerance of 1e-10, over the "
	                 "study's 15 drops; at its default tolerance it is within 0.0001 % and not shown.",
	                 "A refinement left out costs a few percent; without a real contact (steady, sdof) "
	                 "box and S2 are off by a third; the printed equations are off the ladder."},
	        .panel = panel,
	        .panels = LADDER_QUANTITIES,
	};

	for (int q = 0; q < LADDER_QUANTITIES; q++) {
		model_accuracy_fill_panel(&panel[q], ladder, ladder->finest, q, NULL);
		/* the finest itself, at its default tolerance, is off by less than the axis shows */
		panel[q].series[LADDER_RUNGS - 1].name = NULL;
	}
	return plot_write(&plot, options->folder, "model", message);
}

static void model_accuracy_print_table(FILE *out, const struct ladder *ladder)
{
	fprintf(out, "%-33s %27s   %27s\n%-33s %9s%9s%9s   %9s%9s%9s  us a drop\n", "Mean deviation, %",
	        "from the study's tables", "from the finest rung", "", "plate", "S2", "box", "plate", "S2",
	        "box");
	for (size_t rung = 0; rung < LADDER_RUNGS; rung++) {
		fprintf(out, "%-33s ", rungs[rung].name);
		for (int q = 0; q < LADDER_QUANTITIES; q++)
			fprintf(out, "%9.2f", ladder->tables[rung][q]);
		fputs("   ", out);
		for (int q = 0; q < LADDER_QUANTITIES; q++)
			fprintf(out, "%9.2g", ladder->finest[rung][q]);
		fprintf(out, " %10.2f\n", ladder->cost_us[rung]);
	}
	fprintf(out, "%-33s ", "a constant fitted to the tables");
	for (int q = 0; q < LADDER_QUANTITIES; q++)
		fprintf(out, "%9.2f", ladder->constant[q]);
	fputs("\n", out);
}

int chart_model(const struct chart_options *options, FILE *out, char *message)
{
	struct ladder ladder;
	int status = ladder_find(1, &ladder);

	if (status) {
		snprintf(message, CHART_MESSAGE_MAX, "the study's drops cannot be predicted: %s",
		         error_text(status));
		return status;
	}
	model_accuracy_print_table(out, &ladder);
	status = draw_tables(options, &ladder, message);
	if (!status)
		status = draw_finest(options, &ladder, message);
	if (!status)
		status = chart_integrators(options, out, message);
	return status;
}
