/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/report/design.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define RANGE 4.0
enum { ZOOMS = 3, ROWS_MAX = 20, COLUMNS_MAX = DESIGN_KEYS_MAX + DESIGN_LIMITS_MAX + 3 };

/* Steps of an axis by how many there are; of a finer grid, which reaches one coarser step to each side. */
static const size_t coarse[DESIGN_KEYS_MAX + 1] = {0, 64, 32, 12};
enum { FINE = 8 };

/* One design and what its drop does. */
struct design_row {
	double key[DESIGN_KEYS_MAX], quantity[DESIGN_LIMITS_MAX];
	double margin; /* the least of 1 - quantity/limit; NAN: no drop */
	double yield;
	bool front, best, within;
};

struct designs {
	const struct design *of;
	double low[DESIGN_KEYS_MAX], ratio[DESIGN_KEYS_MAX]; /* of the grid: its least values, and steps */
	size_t steps[DESIGN_KEYS_MAX];
	struct design_row *row;
};

static const struct ensemble_output more[] = {
        {"plate_travel_m", 0, offsetof(struct model_prediction, plate_travel_m)},
        {"dent_m", 0, offsetof(struct model_prediction, dent_m)},
};

int design_quantity(const char *name, struct ensemble_output *quantity)
{
	for (size_t i = 0; i < ENSEMBLE_OUTPUTS + sizeof(more) / sizeof(more[0]); i++) {
		const struct ensemble_output *q =
		        i < ENSEMBLE_OUTPUTS ? &ensemble_outputs[i] : &more[i - ENSEMBLE_OUTPUTS];

		if (strcmp(q->key, name) == 0) {
			*quantity = *q;
			return 0;
		}
	}
	return DT_E_UNKNOWN;
}

int design_add_key(struct design *design, const struct vary_key *key)
{
	struct ensemble_axis *axis = &design->ensemble.axis[design->ensemble.axes];
	double value = vary_get(design->ensemble.scene, key);

	if (design->ensemble.axes == DESIGN_KEYS_MAX)
		return DT_E_RANGE;
	if (!(value > 0.0))
		return DT_E_ARGUMENT;
	for (size_t i = 0; i < design->ensemble.axes; i++)
		if (design->ensemble.axis[i].key.offset == key->offset)
			return DT_E_STATE;
	*axis = (struct ensemble_axis){
	        .key = *key, .from = fmax(value / RANGE, key->min), .to = fmin(value * RANGE, key->max)};
	design->ensemble.axes++;
	return 0;
}

static double design_margin(const struct design *d, const struct model_prediction *p, double quantity[])
{
	double least = (double)INFINITY;

	for (size_t i = 0; i < d->limits; i++) {
		double value = fabs(ensemble_value(p, &d->limit[i].quantity));
		double margin = 1.0 - value / d->limit[i].value;

		quantity[i] = value;
		if (isnan(margin) || margin < least) /* a NaN stays: nothing is less */
			least = margin;
	}
	return least;
}

static void design_solve(const struct design *d, struct design_row *row)
{
	struct model_prediction p;
	struct scene scene;

	ensemble_set(&d->ensemble, row->key, &scene);
	row->margin = (double)NAN;
	if (model_solve(&scene, d->ensemble.fidelity, &d->ensemble.options, &p, NULL) == 0)
		row->margin = design_margin(d, &p, row->quantity);
	row->within = row->margin >= 0.0;
	row->yield = (double)NAN;
}

static void design_block(void *context, size_t first, size_t count, int thread)
{
	const struct designs *g = context;

	(void)thread;
	for (size_t k = first; k < first + count; k++) {
		size_t point = k;

		for (size_t i = g->of->ensemble.axes; i-- > 0;) {
			g->row[k].key[i] = g->low[i] * pow(g->ratio[i], (double)(point % (g->steps[i] + 1)));
			point /= g->steps[i] + 1;
		}
		design_solve(g->of, &g->row[k]);
	}
}

static size_t designs_points(const struct designs *g)
{
	size_t points = 1;

	for (size_t i = 0; i < g->of->ensemble.axes; i++)
		points *= g->steps[i] + 1;
	return points;
}

/* Index of the largest margin; count: none. */
static size_t designs_best(const struct design_row *row, size_t count)
{
	size_t best = count;

	for (size_t k = 0; k < count; k++)
		if (row[k].margin > (best < count ? row[best].margin : -(double)INFINITY))
			best = k;
	return best;
}

/* Finer and finer about the best, which comes to be row[best]. */
static int designs_zoom(struct designs *coarser, size_t best)
{
	const struct design *d = coarser->of;
	struct designs g = *coarser;
	int error = 0;

	g.row = calloc((FINE + 1) * (FINE + 1) * (FINE + 1), sizeof(*g.row));
	if (!g.row)
		return DT_E_MEMORY;
	for (int zoom = 0; zoom < ZOOMS && !error; zoom++) {
		size_t found;

		for (size_t i = 0; i < d->ensemble.axes; i++) {
			double low = fmax(coarser->row[best].key[i] / g.ratio[i], d->ensemble.axis[i].from),
			       high = fmin(coarser->row[best].key[i] * g.ratio[i], d->ensemble.axis[i].to);

			g.low[i] = low;
			g.ratio[i] = pow(high / low, 1.0 / FINE);
			g.steps[i] = FINE;
		}
		error = ensemble_run(designs_points(&g), design_block, NULL, &g);
		found = designs_best(g.row, designs_points(&g));
		if (!error && found < designs_points(&g) && g.row[found].margin > coarser->row[best].margin)
			coarser->row[best] = g.row[found];
	}
	free(g.row);
	return error;
}

/* Whether b is as good as a in everything limited, and better in something. */
static bool design_beats(const struct design *d, const struct design_row *b, const struct design_row *a)
{
	bool better = false;

	for (size_t i = 0; i < d->limits; i++) {
		if (!(b->quantity[i] <= a->quantity[i]))
			return false;
		better = better || b->quantity[i] < a->quantity[i];
	}
	return better;
}

static double design_yield(const struct design *d, const struct design_row *row)
{
	struct scene scene;
	struct ensemble at = {.scene = &scene, .seed = d->ensemble.seed};
	size_t within = 0;

	ensemble_set(&d->ensemble, row->key, &scene);
	if (!ensemble_fitted(&scene))
		return (double)NAN;
	for (size_t k = 0; k < DESIGN_DRAWS; k++) {
		double quantity[DESIGN_LIMITS_MAX], none[1];
		struct model_prediction p;
		struct scene drawn;

		ensemble_random_scene(&at, k, &drawn, none);
		if (model_solve(&drawn, d->ensemble.fidelity, &d->ensemble.options, &p, NULL) == 0)
			within += design_margin(d, &p, quantity) >= 0.0;
	}
	return (double)within / DESIGN_DRAWS;
}

static int by_first_quantity(const void *a, const void *b)
{
	double x = ((const struct design_row *)a)->quantity[0],
	       y = ((const struct design_row *)b)->quantity[0];

	return (x > y) - (x < y);
}

/* The front's rows to the begin, in order; how many. */
static size_t designs_front(const struct designs *g, size_t count)
{
	size_t front = 0;

	for (size_t k = 0; k < count; k++) {
		struct design_row *a = &g->row[k];

		a->front = isfinite(a->margin);
		for (size_t j = 0; j < count && a->front; j++)
			a->front = !(isfinite(g->row[j].margin) && design_beats(g->of, &g->row[j], a));
	}
	for (size_t k = 0; k < count; k++)
		if (g->row[k].front || g->row[k].best)
			g->row[front++] = g->row[k];
	qsort(g->row, front, sizeof(*g->row), by_first_quantity);
	return front;
}

static int designs_write(const struct designs *g, size_t front, enum table_format format, FILE *out)
{
	const struct design *d = g->of;
	struct table_column columns[COLUMNS_MAX];
	struct table table = {.out = out, .format = format};
	size_t count = 0;
	double shown = -1.0, each = front > ROWS_MAX ? (double)(front - 1) / (ROWS_MAX - 1) : 1.0;

	for (size_t i = 0; i < d->ensemble.axes; i++)
		columns[count++] =
		        (struct table_column){.kind = TABLE_NUMBER,
		                              .offset = offsetof(struct design_row, key) + i * sizeof(double),
		                              .key = d->ensemble.axis[i].key.key,
		                              .title = d->ensemble.axis[i].key.key,
		                              .width = 14,
		                              .digits = TABLE_DIGITS_G};
	for (size_t i = 0; i < d->limits; i++)
		columns[count++] = (struct table_column){.kind = TABLE_NUMBER,
		                                         .offset = offsetof(struct design_row, quantity) +
		                                                   i * sizeof(double),
		                                         .key = d->limit[i].quantity.key,
		                                         .title = d->limit[i].quantity.key,
		                                         .width = 18,
		                                         .digits = TABLE_DIGITS_G};
	columns[count++] = (struct table_column)TABLE_COLUMN(NUMBER, struct design_row, yield, .key = "yield",
	                                                     .title = "yield", .width = 7, .digits = 3);
	columns[count++] = (struct table_column)TABLE_COLUMN(YES, struct design_row, within, .key = "within",
	                                                     .title = "within", .width = 7);
	columns[count++] = (struct table_column)TABLE_COLUMN(YES, struct design_row, best, .key = "best",
	                                                     .title = "best", .width = 5);
	table_begin(&table, columns, count);
	for (size_t k = 0; k < front; k++)
		if (g->row[k].best || (double)k >= shown + each - 1e-9 || shown < 0.0) {
			if (!g->row[k].best || (double)k >= shown + each - 1e-9)
				shown = (double)k;
			g->row[k].yield = design_yield(d, &g->row[k]);
			table_row(&table, &g->row[k]);
		}
	if (format == TABLE_TEXT)
		for (size_t k = 0; k < front; k++)
			if (g->row[k].best && !g->row[k].within)
				fputs("\nno design keeps all limits: the best is nearest to them\n", out);
	return table_end(&table);
}

int design_write(struct design *d, enum table_format format, FILE *out)
{
	struct designs g = {.of = d};
	size_t points, best, front;
	int error;

	for (size_t i = 0; i < d->ensemble.axes; i++) {
		g.steps[i] = coarse[d->ensemble.axes];
		g.low[i] = d->ensemble.axis[i].from;
		g.ratio[i] = pow(d->ensemble.axis[i].to / g.low[i], 1.0 / (double)g.steps[i]);
	}
	points = designs_points(&g);
	g.row = calloc(points, sizeof(*g.row));
	if (!g.row)
		return DT_E_MEMORY;
	error = ensemble_run(points, design_block, NULL, &g);
	best = designs_best(g.row, points);
	if (!error && best == points)
		error = DT_E_EMPTY;
	if (!error) {
		error = designs_zoom(&g, best);
		g.row[best].best = true;
	}
	if (!error) {
		front = designs_front(&g, points);
		error = designs_write(&g, front, format, out);
	}
	free(g.row);
	return error;
}
