/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/archive/table.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/archive/private.h"

static void mean_add(struct archive_mean *m, double value, bool not_ok, const struct budget_item *budget)
{
	double before = m->n > 0 ? value - m->mean : value;

	if (!isfinite(value))
		return;
	m->n++;
	m->not_ok += not_ok;
	m->mean = m->n > 1 ? m->mean + before / m->n : value;
	m->squares += m->n > 1 ? before * (value - m->mean) : 0;
	m->sd = m->n > 1 ? sqrt(m->squares / (m->n - 1)) : (double)NAN;
	if (budget->what[0] != '\0')
		budget_mean_add(&m->budget, budget);
}

void archive_cell_close(struct archive_cell *cell)
{
	for (int i = 0; i < ARCHIVE_VALUE_COUNT; i++) {
		struct archive_mean *m = &cell->value[i];

		if (m->n > 0 && m->budget.count == m->n)
			budget_mean_item(&m->budget, m->mean, m->sd, &m->whole);
		else
			m->whole = (struct budget_item){.expanded = NAN, .k = NAN};
	}
}

size_t archive_cell_uncertainties(const struct archive_cell *cell,
                                  struct budget_item item[ARCHIVE_VALUE_COUNT])
{
	size_t count = 0;

	for (int i = 0; i < ARCHIVE_VALUE_COUNT; i++) {
		const struct quantity_column *c = &quantity_columns[i];
		double scale = quantity_column_scale(c);

		if (cell->value[i].n == 0 || !isfinite(cell->value[i].whole.expanded))
			continue;
		item[count] = cell->value[i].whole;
		snprintf(item[count].what, sizeof(item[count].what), "%s", c->title);
		item[count].unit = c->shown;
		item[count].value *= scale;
		item[count++].expanded *= scale;
	}
	return count;
}

void archive_cell_add(struct archive_cell *cell, const struct archive_drop *drop)
{
	if (cell->campaign[0] == '\0') {
		snprintf(cell->campaign, sizeof(cell->campaign), "%s", drop->series.campaign);
		snprintf(cell->scene_name, sizeof(cell->scene_name), "%s", drop->series.scene_name);
		cell->angle_deg = drop->series.angle_deg;
		cell->height_m = drop->series.height_m;
		cell->plate_mass_kg = drop->series.plate_mass_kg;
		for (int i = 0; i < ARCHIVE_VALUE_COUNT; i++)
			cell->value[i].mean = cell->value[i].sd = NAN;
	}
	if (archive_is_faulty(drop)) {
		cell->faulty++;
		return;
	}
	cell->drops++;
	for (int i = 0; i < ARCHIVE_VALUE_COUNT; i++)
		mean_add(&cell->value[i], drop->value[i], (drop->not_ok >> i & 1u) != 0, &drop->budget[i]);
}

void archive_cell_row(const struct archive_cell *cell, enum table_of of,
                      struct table_value value[ARCHIVE_VALUE_COUNT])
{
	for (int i = 0; i < ARCHIVE_VALUE_COUNT; i++) {
		const struct archive_mean *m = &cell->value[i];

		value[i] = (struct table_value){.value = of == TABLE_VALUES ? m->mean
		                                         : of == TABLE_SDS  ? m->sd
		                                                            : m->n,
		                                .sigma = (double)NAN,
		                                .marked = of == TABLE_VALUES && m->not_ok > 0};
	}
}

bool archive_is_faulty(const struct archive_drop *drop)
{
	return strcmp(drop->state, "altered") == 0 || strcmp(drop->state, "missing") == 0;
}

bool archive_counts(const struct archive_drop *drop, bool undecided)
{
	if (archive_is_faulty(drop))
		return false;
	return strcmp(drop->decision, "accepted") == 0 ||
	       (undecided && strcmp(drop->decision, "open") == 0 && drop->sha256[0] != '\0');
}

struct growing {
	struct archive_table table;
	size_t room;
	bool undecided;
};

static bool table_equal(double a, double b)
{
	return fabs(a - b) < 1e-9;
}

static bool belongs(const struct archive_cell *cell, const struct archive_series *series)
{
	return table_equal(cell->angle_deg, series->angle_deg) &&
	       table_equal(cell->height_m, series->height_m) &&
	       strcmp(cell->scene_name, series->scene_name) == 0 &&
	       strcmp(cell->campaign, series->campaign) == 0;
}

static int table_add_drop(void *context, const struct archive_drop *drop)
{
	struct growing *g = context;
	struct archive_table *t = &g->table;

	if (!archive_counts(drop, g->undecided) &&
	    !(archive_is_faulty(drop) && strcmp(drop->decision, "accepted") == 0))
		return 0;
	if (t->count == 0 || !belongs(&t->cell[t->count - 1], &drop->series)) {
		if (t->count == g->room) {
			size_t room = 2 * g->room + 16;
			struct archive_cell *cell = realloc(t->cell, room * sizeof(*cell));

			if (cell == NULL)
				return DT_E_MEMORY;
			t->cell = cell;
			g->room = room;
		}
		memset(&t->cell[t->count++], 0, sizeof(*t->cell));
	}
	archive_cell_add(&t->cell[t->count - 1], drop);
	return 0;
}

int archive_table(struct archive *archive, const struct archive_filter *filter, bool undecided,
                  struct archive_table *table)
{
	struct growing g = {.undecided = undecided};
	int result = archive_each_numbers(archive, filter, table_add_drop, &g);

	for (size_t i = 0; i < g.table.count; i++)
		archive_cell_close(&g.table.cell[i]);
	if (result == 0)
		*table = g.table;
	else
		free(g.table.cell);
	return result;
}

void archive_table_free(struct archive_table *table)
{
	free(table->cell);
}

static bool same_place(const struct archive_cell *a, const struct archive_cell *b)
{
	return table_equal(a->angle_deg, b->angle_deg) && table_equal(a->height_m, b->height_m) &&
	       strcmp(a->campaign, b->campaign) == 0;
}

const struct archive_cell *archive_table_find(const struct archive_table *table,
                                              const struct archive_cell *cell, const char *scene_name)
{
	for (size_t i = 0; i < table->count; i++)
		if (same_place(&table->cell[i], cell) && strcmp(table->cell[i].scene_name, scene_name) == 0)
			return &table->cell[i];
	return NULL;
}

const struct archive_cell *archive_table_reference(const struct archive_table *table,
                                                   const struct archive_cell *cell)
{
	const struct archive_cell *found = NULL;

	for (size_t i = 0; i < table->count; i++) {
		if (!same_place(&table->cell[i], cell) || table->cell[i].plate_mass_kg > 0)
			continue;
		if (found != NULL)
			return NULL;
		found = &table->cell[i];
	}
	return found == cell ? NULL : found;
}
