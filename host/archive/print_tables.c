/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The study's tables: 1 to 3 are means and SDs of a scene at each angle, 4 is S1 over S1 of the reference.
 */
#include <math.h>
#include <string.h>

#include "host/archive/print_private.h"

enum { X, Y, R, Z, AXES };
static const enum archive_value sensor_values[2][AXES] = {
        {ARCHIVE_S1_X, ARCHIVE_S1_Y, ARCHIVE_S1_R, ARCHIVE_S1_Z},
        {ARCHIVE_S2_X, ARCHIVE_S2_Y, ARCHIVE_S2_R, ARCHIVE_S2_Z},
};

static const struct archive_mean *print_tables_mean_of(const struct archive_cell *cell, int sensor, int axis)
{
	return &cell->value[sensor_values[sensor][axis]];
}

/* mean a / mean b; NAN where there is none. */
static double ratio(const struct archive_mean *a, const struct archive_mean *b)
{
	return a->n > 0 && b->n > 0 && fabs(b->mean) > 0 ? a->mean / b->mean : (double)NAN;
}

static const struct archive_cell *reference_of(const struct archive_table *table,
                                               const struct archive_cell *cell, const char *name)
{
	const struct archive_cell *found =
	        name != NULL ? archive_table_find(table, cell, name) : archive_table_reference(table, cell);

	return found == cell ? NULL : found;
}

/* ---- JSON and CSV: a row for each sensor ---- */

struct sensor_row {
	struct archive_cell cell;
	const char *sensor, *reference;
	struct archive_mean mean[AXES];
	double r_of_means_g, ratio[AXES], over[AXES];
};
#define COLUMN(KIND, member, ...) TABLE_COLUMN(KIND, struct sensor_row, member, __VA_ARGS__)

/* Where a cell stands; then what is of a sensor. */
static const struct table_column sensor_columns[] = {
        COLUMN(CHARS, cell.campaign, .key = "campaign"),
        COLUMN(CHARS, cell.scene_name, .key = "scene"),
        COLUMN(NUMBER, cell.angle_deg, .key = "angle_deg"),
        COLUMN(NUMBER, cell.height_m, .key = "height_m"),
        COLUMN(WORDS, sensor, .key = "sensor"),
        COLUMN(WHOLE, cell.drops, .key = "drops"),
        PRINT_MEAN(struct sensor_row, mean[X], "x", "g"),
        PRINT_MEAN(struct sensor_row, mean[Y], "y", "g"),
        PRINT_MEAN(struct sensor_row, mean[R], "r", "g"),
        PRINT_MEAN(struct sensor_row, mean[Z], "z", "g"),
        COLUMN(NUMBER, r_of_means_g, .key = "r_of_means_g"),
        COLUMN(NUMBER, ratio[X], .key = "x", .group = "s1_over_s2"),
        COLUMN(NUMBER, ratio[Y], .key = "y", .group = "s1_over_s2"),
        COLUMN(NUMBER, ratio[R], .key = "r", .group = "s1_over_s2"),
        COLUMN(NUMBER, over[X], .key = "x", .group = "over_reference"),
        COLUMN(NUMBER, over[Y], .key = "y", .group = "over_reference"),
        COLUMN(NUMBER, over[R], .key = "r", .group = "over_reference"),
        COLUMN(WORDS, reference, .key = "reference"),
        COLUMN(WHOLE, cell.faulty, .key = "faulty"),
};
#undef COLUMN

/* The study's resultant is made of the means of X and Y; ours is the mean of the drops' own. */
static void put_sensor(struct table *table, const struct archive_cell *cell, int sensor,
                       const struct archive_cell *reference)
{
	struct sensor_row row = {.cell = *cell,
	                         .sensor = sensor == 0 ? "S1" : "S2",
	                         .reference = reference != NULL ? reference->scene_name : ""};

	for (int axis = X; axis < AXES; axis++) {
		row.mean[axis] = *print_tables_mean_of(cell, sensor, axis);
		row.ratio[axis] =
		        ratio(print_tables_mean_of(cell, 0, axis), print_tables_mean_of(cell, 1, axis));
		row.over[axis] = reference != NULL ? ratio(&row.mean[axis],
		                                           print_tables_mean_of(reference, sensor, axis))
		                                   : (double)NAN;
	}
	row.r_of_means_g = hypot(row.mean[X].mean, row.mean[Y].mean);
	table_row(table, &row);
}

static int put_sensors(struct table *out, const struct archive_table *table, const char *reference)
{
	table_begin(out, sensor_columns, TABLE_COUNT(sensor_columns));
	for (size_t i = 0; i < table->count; i++)
		for (int sensor = 0; sensor < 2; sensor++)
			put_sensor(out, &table->cell[i], sensor,
			           reference_of(table, &table->cell[i], reference));
	return table_end(out);
}

/* ---- JSON: all that is of a cell ---- */

#define COLUMN(KIND, member, ...) TABLE_COLUMN(KIND, struct archive_cell, member, __VA_ARGS__)
#define MEAN(NAME, name, unit) PRINT_MEAN(struct archive_cell, value[ARCHIVE_##NAME], name, unit)
static const struct table_column plate_columns[] = {
        COLUMN(CHARS, campaign, .key = "campaign"),    COLUMN(CHARS, scene_name, .key = "scene"),
        COLUMN(NUMBER, angle_deg, .key = "angle_deg"), COLUMN(NUMBER, height_m, .key = "height_m"),
        COLUMN(WHOLE, drops, .key = "drops"),          COLUMN(WHOLE, faulty, .key = "faulty"),
#define QUANTITY_COLUMN(NAME, name, unit, ...) MEAN(NAME, name, unit),
#include "host/result/quantity.def"
};
#undef MEAN
#undef COLUMN

static int print_tables_json(struct table *out, const struct archive_table *table, const char *reference)
{
	int result;

	fputs("{\"tables\":", out->out);
	result = put_sensors(out, table, reference);
	fputs(",\"plates\":", out->out);
	table_begin(out, plate_columns, TABLE_COUNT(plate_columns));
	for (size_t i = 0; i < table->count; i++)
		table_row(out, &table->cell[i]);
	result = table_end(out);
	fputs("}\n", out->out);
	return result;
}

/* ---- text ---- */

struct text_row {
	char label[24];
	double value[ARCHIVE_VALUE_COUNT];
};

static void cell_text(struct table *table, const struct archive_cell *cell)
{
	struct text_row row;
	char n[16];

	snprintf(n, sizeof(n), "n=%u", cell->drops);
	snprintf(row.label, sizeof(row.label), "%5g  mean", cell->angle_deg);
	for (table->of = TABLE_VALUES; table->of <= TABLE_SDS; table->of++) {
		struct table_value value[ARCHIVE_VALUE_COUNT];

		archive_cell_row(cell, table->of, value);
		for (int i = 0; i < ARCHIVE_VALUE_COUNT; i++)
			row.value[i] = value[i].value;
		table_row(table, &row);
		snprintf(row.label, sizeof(row.label), "%5s  SD", n);
	}
}

static bool same_scene(const struct archive_cell *a, const struct archive_cell *b)
{
	return strcmp(a->scene_name, b->scene_name) == 0 && strcmp(a->campaign, b->campaign) == 0 &&
	       fabs(a->height_m - b->height_m) < 1e-9;
}

static void means_text(const struct archive_table *table, FILE *out)
{
	struct table_column column[ARCHIVE_VALUE_COUNT + 1] = {
	        TABLE_COLUMN(CHARS, struct text_row, label, .title = "  deg", .width = -11)};
	size_t count = 1 + print_narrow(column + 1, TABLE_NUMBER, offsetof(struct text_row, value));
	struct table means = {.out = out};

	for (size_t i = 0; i < table->count; i++) {
		const struct archive_cell *cell = &table->cell[i];

		if (i == 0 || !same_scene(cell, cell - 1)) {
			fprintf(out, "%s%s from %g m, campaign %s: peaks in g\n", i > 0 ? "\n" : "",
			        cell->scene_name, cell->height_m, cell->campaign);
			table_begin(&means, column, count);
		}
		cell_text(&means, cell);
		if (cell->faulty > 0)
			fprintf(out, "%5s  %u accepted, but altered or missing, and in no mean\n", "",
			        cell->faulty);
	}
	for (size_t i = 0; i < table->count; i++) {
		const struct archive_cell *cell = &table->cell[i];
		struct budget_item any[ARCHIVE_VALUE_COUNT];

		if (archive_cell_uncertainties(cell, any) > 0)
			fprintf(out, "\n%s from %g m at %g deg, campaign %s", cell->scene_name,
			        cell->height_m, cell->angle_deg, cell->campaign);
		print_uncertainties(cell, out);
	}
}

static void ratio_text(FILE *out, double value)
{
	if (isnan(value))
		fprintf(out, "%7s", "-");
	else
		fprintf(out, "%7.2f", value);
}

static void ratios_text(const struct archive_table *table, const char *name, FILE *out)
{
	fprintf(out, "\nratios of means\n%-16s %7s %5s %20s %20s %20s  %s\n", "scene", "m", "deg",
	        "S1/S2: X, Y, XY", "S1/S1 of reference", "S2/S2 of reference", "reference");
	for (size_t i = 0; i < table->count; i++) {
		const struct archive_cell *cell = &table->cell[i],
		                          *reference = reference_of(table, cell, name);

		fprintf(out, "%-16s %7g %5g ", cell->scene_name, cell->height_m, cell->angle_deg);
		for (int axis = X; axis <= R; axis++)
			ratio_text(out, ratio(print_tables_mean_of(cell, 0, axis),
			                      print_tables_mean_of(cell, 1, axis)));
		for (int k = 0; k < 6 && reference != NULL; k++)
			ratio_text(out, ratio(print_tables_mean_of(cell, k / 3, k % 3),
			                      print_tables_mean_of(reference, k / 3, k % 3)));
		fprintf(out, "  %s\n", reference != NULL ? reference->scene_name : "");
	}
}

int print_tables(struct archive *archive, const struct archive_filter *filter, bool undecided,
                 const char *reference, enum table_format format, FILE *out)
{
	struct table to = {.out = out, .format = format};
	struct archive_table table;
	int result = archive_table(archive, filter, undecided, &table);

	if (result != 0)
		return result;
	if (format == TABLE_JSON) {
		result = print_tables_json(&to, &table, reference);
	} else if (format == TABLE_CSV) {
		result = put_sensors(&to, &table, reference);
	} else {
		means_text(&table, out);
		if (table.count > 0)
			ratios_text(&table, reference, out);
		else
			fputs("no accepted drop\n", out);
	}
	archive_table_free(&table);
	return print_done(result, &to);
}
