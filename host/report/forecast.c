/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/report/forecast.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "host/model/auto.h"
#include "host/model/corner.h"
#include "host/base/put.h"

enum { CELL_MAX = 48, ROW_MAX = CELL_MAX * (ENSEMBLE_OUTPUTS + ENSEMBLE_KEYS_MAX) };

/* A column is as wide as its head. */
static int forecast_width_of(const char *key, int least)
{
	int length = (int)strlen(key);

	return length > least ? length : least;
}

static int written(FILE *out)
{
	return fflush(out) != 0 || ferror(out) ? DT_E_SYSTEM : 0;
}

/* ---- one prediction ---- */

/* What the rung above says otherwise, as a share; NAN without one. */
static double next_change(const struct forecast *f)
{
	return f->next ? auto_apart(f->prediction, f->next, f->asked ? f->asked : (unsigned)MODEL_ASK_ALL,
	                            0.0)
	               : (double)NAN;
}

static void text_row(FILE *out, const char *name, double value, double u, double next)
{
	if (isnan(value))
		return;
	fprintf(out, "%-22s %12.6g", name, value);
	if (isfinite(u))
		fprintf(out, " +- %-8.2g", u);
	if (isfinite(next))
		fprintf(out, " %12.6g %+8.2f %%", next, 100.0 * (next - value) / value);
	fputc('\n', out);
}

int forecast_text(const struct forecast *f, FILE *out)
{
	const struct model_prediction *p = f->prediction;
	const struct ensemble_output *outputs[ENSEMBLE_OUTPUTS];
	size_t count = ensemble_select(f->asked, outputs);
	const double none = (double)NAN;

	fprintf(out, "%s: %s, %.6g m, %.6g deg\n", f->scene->name, f->scene->title, f->scene->drop_height_m,
	        f->scene->drop_angle_deg);
	fprintf(out, "%s, %s\n", p->fidelity, p->reason);
	fprintf(out, "cost: %u evaluations, %.1f us\n\n", p->evaluations, f->cost_us);
	fprintf(out, "%-22s %12s", "", p->fidelity);
	if (f->next)
		fprintf(out, " %12s %10s", f->next->fidelity, "change");
	fputc('\n', out);
	text_row(out, "impact_speed_m_s", p->impact_speed_m_s, none, none);
	text_row(out, "velocity_change_m_s", p->velocity_change_m_s, none, none);
	text_row(out, "contact_time_s", p->contact_time_s, none, none);
	text_row(out, "restitution", p->restitution, none, none);
	text_row(out, "dent_m", p->dent_m, none, none);
	text_row(out, "plate_travel_m", p->has_plate ? p->plate_travel_m : none, none, none);
	text_row(out, "plate_damping_ratio", p->has_plate ? p->plate_damping_ratio : none, none, none);
	for (size_t i = 0; i < count; i++)
		text_row(out, outputs[i]->key, ensemble_value(p, outputs[i]),
		         f->u ? f->u[outputs[i] - ensemble_outputs] : none,
		         f->next ? ensemble_value(f->next, outputs[i]) : none);
	if (corner_predicted(f->scene))
		fprintf(out,
		        "\nthe contact is predicted: %.3g N/m^1.5 at 25 deg +- %.0f %%, for which the bars "
		        "stand\n",
		        f->scene->contact_stiffness_n_m15, 100.0 * f->scene->fitted_u[0]);
	else if (f->u)
		fputs("\n+-: standard uncertainty by [fit] of the scene; the law's own error is not in it\n",
		      out);
	if (p->notes & MODEL_NOTE_DEEP)
		fprintf(out, "\nnote: the dent is %.0f %% of the mat: its floor begins to be felt\n",
		        100.0 * p->dent_share);
	if (p->notes & MODEL_NOTE_STUCK)
		fprintf(out,
		        "\nnote: the box does not leave the mat within %.3g ms: the peaks are up to then\n",
		        1e3 * p->until_s);
	if (p->notes & MODEL_NOTE_STRUCK)
		fprintf(out, "\nnote: %s after %.3g ms: the peaks take it in\n",
		        p->second_corner == 0 ? "the corner strikes again" : "another corner strikes",
		        1e3 * p->second_touch_s);
	return written(out);
}

int forecast_json(const struct forecast *f, FILE *out)
{
	const struct model_prediction *p = f->prediction;
	const struct ensemble_output *outputs[ENSEMBLE_OUTPUTS];
	size_t count = ensemble_select(f->asked, outputs);
	struct builder b = {.failed = false};
	cJSON *root = cJSON_CreateObject(), *scene, *cost, *predicted, *next;

	b.failed = !root;
	scene = put_object(&b, root, "scene");
	put_text(&b, scene, "name", f->scene->name);
	put_number(&b, scene, "angle_deg", f->scene->drop_angle_deg);
	put_number(&b, scene, "height_m", f->scene->drop_height_m);
	put_text(&b, root, "fidelity", p->fidelity);
	put_text(&b, root, "reason", p->reason);
	put_number(&b, root, "predicted_difference_percent", 100.0 * p->difference);
	cost = put_object(&b, root, "cost");
	put_number(&b, cost, "evaluations", p->evaluations);
	put_number(&b, cost, "time_us", f->cost_us);
	predicted = put_object(&b, root, "predicted");
	put_number(&b, predicted, "impact_speed_m_s", p->impact_speed_m_s);
	put_number(&b, predicted, "velocity_change_m_s", p->velocity_change_m_s);
	put_number(&b, predicted, "contact_time_s", p->contact_time_s);
	put_number(&b, predicted, "restitution", p->restitution);
	put_number(&b, predicted, "dent_m", p->dent_m);
	put_number(&b, predicted, "dent_share", p->dent_share);
	put_number(&b, predicted, "plate_travel_m", p->plate_travel_m);
	put_number(&b, predicted, "plate_damping_ratio", p->plate_damping_ratio);
	for (size_t i = 0; i < count; i++)
		put_number(&b, predicted, outputs[i]->key, ensemble_value(p, outputs[i]));
	if (f->u) {
		cJSON *u = put_object(&b, root, "standard_uncertainty");

		for (size_t i = 0; i < count; i++)
			put_number(&b, u, outputs[i]->key, f->u[outputs[i] - ensemble_outputs]);
	}
	if (!f->next) {
		put_item(&b, root, "next_rung", cJSON_CreateNull());
		return put_out(&b, root, out);
	}
	next = put_object(&b, root, "next_rung");
	put_text(&b, next, "fidelity", f->next->fidelity);
	put_number(&b, next, "change_percent", 100.0 * next_change(f));
	for (size_t i = 0; i < count; i++)
		put_number(&b, next, outputs[i]->key, ensemble_value(f->next, outputs[i]));
	return put_out(&b, root, out);
}

/* ---- sweeps ---- */

struct sweep {
	const struct ensemble *ensemble;
	const struct ensemble_output *outputs[ENSEMBLE_OUTPUTS];
	size_t count, failed;
	char *text[ENSEMBLE_THREADS_MAX];
	size_t length[ENSEMBLE_THREADS_MAX], failures[ENSEMBLE_THREADS_MAX];
	FILE *out;
	bool json;
};

static size_t forecast_cell(const struct sweep *s, char *to, const char *key, double value, bool first)
{
	const char *comma = first ? "" : s->json ? "," : " ";

	if (s->json && isfinite(value))
		return (size_t)snprintf(to, CELL_MAX, "%s\"%s\":%.10g", comma, key, value);
	if (s->json)
		return (size_t)snprintf(to, CELL_MAX, "%s\"%s\":null", comma, key);
	return (size_t)snprintf(to, CELL_MAX, "%s%*.6g", comma, forecast_width_of(key, 12), value);
}

static size_t forecast_row(const struct sweep *s, char *to, const double varied[],
                           const struct model_prediction *p)
{
	const struct ensemble *e = s->ensemble;
	size_t at = 0;

	if (s->json)
		to[at++] = '{';
	for (size_t i = 0; i < e->axes; i++)
		at += forecast_cell(s, to + at, e->axis[i].key.key, varied[i], i == 0);
	for (size_t i = 0; i < s->count; i++)
		at += forecast_cell(s, to + at, s->outputs[i]->key,
		                    p ? ensemble_value(p, s->outputs[i]) : (double)NAN, false);
	if (s->json)
		at += (size_t)sprintf(to + at, ",\"fidelity\":%s%s%s}", p ? "\"" : "",
		                      p ? p->fidelity : "null", p ? "\"" : "");
	else
		at += (size_t)sprintf(to + at, " %s", p ? p->fidelity : "-");
	return at;
}

static void sweep_block(void *context, size_t first, size_t count, int thread)
{
	struct sweep *s = context;
	size_t at = 0;

	s->failures[thread] = 0;
	for (size_t k = first; k < first + count; k++) {
		double varied[ENSEMBLE_KEYS_MAX];
		struct model_prediction p;
		struct scene scene;
		bool drops;

		ensemble_grid_scene(s->ensemble, k, &scene, varied);
		drops = model_solve(&scene, s->ensemble->fidelity, &s->ensemble->options, &p, NULL) == 0;
		s->failures[thread] += !drops;
		if (s->json && k > 0)
			s->text[thread][at++] = ',';
		if (s->json && k > 0)
			s->text[thread][at++] = '\n';
		at += forecast_row(s, s->text[thread] + at, varied, drops ? &p : NULL);
		if (!s->json)
			s->text[thread][at++] = '\n';
	}
	s->length[thread] = at;
}

static int sweep_out(void *context, size_t first, size_t count, int thread)
{
	struct sweep *s = context;

	(void)first;
	(void)count;
	s->failed += s->failures[thread];
	return fwrite(s->text[thread], 1, s->length[thread], s->out) == s->length[thread] ? 0 : DT_E_SYSTEM;
}

static void sweep_head(const struct sweep *s)
{
	const struct ensemble *e = s->ensemble;

	for (size_t i = 0; i < e->axes; i++)
		fprintf(s->out, "%s%12s", i ? " " : "", e->axis[i].key.key);
	for (size_t i = 0; i < s->count; i++)
		fprintf(s->out, " %12s", s->outputs[i]->key);
	fputs(" model\n", s->out);
}

int forecast_sweep(const struct ensemble *e, bool json, FILE *out, size_t *failed)
{
	struct sweep s = {.ensemble = e, .out = out, .json = json};
	int result = 0;

	s.count = ensemble_select(e->options.asked, s.outputs);
	for (int i = 0; i < ENSEMBLE_THREADS_MAX; i++)
		s.text[i] = NULL;
	for (int i = 0; i < ENSEMBLE_THREADS_MAX && result == 0; i++) {
		s.text[i] = malloc((size_t)ENSEMBLE_BLOCK * ROW_MAX);
		result = s.text[i] ? 0 : DT_E_MEMORY;
	}
	if (result == 0) {
		if (json)
			fputs("[", out);
		else
			sweep_head(&s);
		result = ensemble_run(ensemble_points(e), sweep_block, sweep_out, &s);
		if (json)
			fputs("]\n", out);
	}
	for (int i = 0; i < ENSEMBLE_THREADS_MAX; i++)
		free(s.text[i]);
	*failed = s.failed;
	return result ? result : written(out);
}

/* ---- random draws ---- */

static int monte_carlo_json(const struct ensemble *e, size_t draws, size_t failed,
                            const struct ensemble_spread spread[], FILE *out)
{
	const struct ensemble_output *outputs[ENSEMBLE_OUTPUTS];
	size_t count = ensemble_select(e->options.asked, outputs);
	struct builder b = {.failed = false};
	cJSON *root = cJSON_CreateObject(), *varied, *results;

	b.failed = !root;
	put_text(&b, root, "scene", e->scene->name);
	put_text(&b, root, "fidelity", model_fidelity_name(e->fidelity));
	put_number(&b, root, "draws", (double)draws);
	put_number(&b, root, "failed", (double)failed);
	put_number(&b, root, "seed", (double)e->seed);
	varied = put_object(&b, root, "varied");
	for (size_t i = 0; i < e->axes; i++) {
		cJSON *item = put_object(&b, varied, e->axis[i].key.key);

		put_number(&b, item, "mean", vary_get(e->scene, &e->axis[i].key));
		put_number(&b, item, "sd", e->axis[i].sd);
	}
	results = put_object(&b, root, "results");
	for (size_t i = 0; i < count; i++) {
		cJSON *item = put_object(&b, results, outputs[i]->key);

		put_number(&b, item, "mean", spread[i].mean);
		put_number(&b, item, "sd", spread[i].sd);
		put_number(&b, item, "low_95", spread[i].low);
		put_number(&b, item, "high_95", spread[i].high);
		put_number(&b, item, "without", (double)spread[i].without);
	}
	return put_out(&b, root, out);
}

int forecast_monte_carlo(const struct ensemble *e, size_t draws, bool json, FILE *out, size_t *failed)
{
	const struct ensemble_output *outputs[ENSEMBLE_OUTPUTS];
	size_t count = ensemble_select(e->options.asked, outputs);
	struct ensemble_spread spread[ENSEMBLE_OUTPUTS];
	int result = ensemble_monte_carlo(e, draws, spread, failed);

	if (result != 0)
		return result;
	if (json)
		return monte_carlo_json(e, draws, *failed, spread, out);
	fprintf(out, "%s, %s, %zu draws, seed %lu\n", e->scene->name, model_fidelity_name(e->fidelity), draws,
	        e->seed);
	for (size_t i = 0; i < e->axes; i++)
		fprintf(out, "  %s %.6g +- %.6g\n", e->axis[i].key.key, vary_get(e->scene, &e->axis[i].key),
		        e->axis[i].sd);
	fprintf(out, "\n%-20s %12s %12s %14s %12s %8s\n", "", "mean", "sd", "95 % from", "to", "without");
	for (size_t i = 0; i < count; i++)
		if (isfinite(spread[i].mean))
			fprintf(out, "%-20s %12.6g %12.6g %14.6g %12.6g %8zu\n", outputs[i]->key,
			        spread[i].mean, spread[i].sd, spread[i].low, spread[i].high,
			        spread[i].without);
	return written(out);
}

/* ---- sensitivities ---- */

struct table {
	const struct ensemble *ensemble;
	const struct ensemble_output *outputs[ENSEMBLE_OUTPUTS];
	size_t count;
	FILE *out;
	struct builder *builder; /* NULL: text */
	cJSON *root;
};

static void sensitivity_row(const struct vary_key *key, void *context)
{
	struct table *t = context;
	double percent[ENSEMBLE_OUTPUTS];
	cJSON *item = NULL;

	if (!ensemble_sensitivity(t->ensemble, key, percent))
		return;
	if (t->builder)
		item = put_object(t->builder, t->root, key->name);
	else
		fprintf(t->out, "%-28s", key->name);
	for (size_t i = 0; i < t->count; i++)
		if (t->builder)
			put_number(t->builder, item, t->outputs[i]->key, percent[i]);
		else
			fprintf(t->out, " %*.4f", forecast_width_of(t->outputs[i]->key, 9), percent[i]);
	if (!t->builder)
		fputc('\n', t->out);
}

int forecast_sensitivity(const struct ensemble *e, bool json, FILE *out)
{
	struct builder builder = {.failed = false};
	struct table t = {.ensemble = e, .out = out};
	cJSON *root;

	t.count = ensemble_select(e->options.asked, t.outputs);
	if (json) {
		root = cJSON_CreateObject();
		builder.failed = !root;
		t.builder = &builder;
		put_text(&builder, root, "scene", e->scene->name);
		put_text(&builder, root, "fidelity", model_fidelity_name(e->fidelity));
		t.root = put_object(&builder, root, "percent_per_percent_or_degree");
		vary_each(sensitivity_row, &t);
		return put_out(&builder, root, out);
	}
	fprintf(out, "%s, %s: percent for a percent more, for angles percent for a degree more\n\n%-28s",
	        e->scene->name, model_fidelity_name(e->fidelity), "");
	for (size_t i = 0; i < t.count; i++)
		fprintf(out, " %9s", t.outputs[i]->key);
	fputc('\n', out);
	vary_each(sensitivity_row, &t);
	return written(out);
}
