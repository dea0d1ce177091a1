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
static const char *const axis_keys[AXES] = {"x", "y", "r", "z"};
static const char *const sensor_names[2] = {"S1", "S2"};

/* What is not of one sensor. */
static const enum archive_value others[] = {ARCHIVE_LAG,       ARCHIVE_LAG_FIRST,   ARCHIVE_LAG_DRIVEN,
                                            ARCHIVE_FREQUENCY, ARCHIVE_THREE_CYCLE, ARCHIVE_DAMPING};
enum { OTHERS = sizeof(others) / sizeof(others[0]) };

static const struct archive_mean *mean_of(const struct archive_cell *cell, int sensor, int axis)
{
	return &cell->value[sensor_values[sensor][axis]];
}

/* The study's resultant is made of the means of X and Y; ours is the mean of the drops' own. */
static double resultant_of_means(const struct archive_cell *cell, int sensor)
{
	return hypot(mean_of(cell, sensor, X)->mean, mean_of(cell, sensor, Y)->mean);
}

static const struct archive_cell *reference_of(const struct archive_table *table,
                                               const struct archive_cell *cell, const char *name)
{
	const struct archive_cell *found =
	        name != NULL ? archive_table_find(table, cell, name) : archive_table_reference(table, cell);

	return found == cell ? NULL : found;
}

/* ---- JSON ---- */

static void put_ratios(struct builder *b, cJSON *item, const char *key, const struct archive_cell *a,
                       int of_a, const struct archive_cell *c, int of_c)
{
	cJSON *object;

	if (c == NULL) {
		put_item(b, item, key, cJSON_CreateNull());
		return;
	}
	object = put_object(b, item, key);
	for (int axis = X; axis <= R; axis++)
		put_number(b, object, axis_keys[axis],
		           print_ratio(mean_of(a, of_a, axis), mean_of(c, of_c, axis)));
}

static void put_place(struct builder *b, cJSON *item, const struct archive_cell *cell)
{
	put_text(b, item, "campaign", cell->campaign);
	put_text(b, item, "scene", cell->scene_name);
	put_number(b, item, "angle_deg", cell->angle_deg);
	put_number(b, item, "height_m", cell->height_m);
	put_number(b, item, "drops", cell->drops);
	put_number(b, item, "faulty", cell->faulty);
}

static void put_sensor(struct builder *b, cJSON *array, const struct archive_cell *cell, int sensor,
                       const struct archive_cell *reference)
{
	cJSON *item = put_append(b, array);

	put_place(b, item, cell);
	put_text(b, item, "sensor", sensor_names[sensor]);
	for (int axis = X; axis < AXES; axis++)
		put_mean(b, item, axis_keys[axis], sensor_values[sensor][axis], mean_of(cell, sensor, axis));
	put_number(b, item, "r_of_means_g", resultant_of_means(cell, sensor));
	put_ratios(b, item, "s1_over_s2", cell, 0, cell, 1);
	put_text(b, item, "reference", reference != NULL ? reference->scene_name : "");
	put_ratios(b, item, "over_reference", cell, sensor, reference, sensor);
}

static int tables_json(const struct archive_table *table, const char *reference, FILE *out)
{
	struct builder b = {false};
	cJSON *root = cJSON_CreateObject(), *array = put_array(&b, root, "tables");

	for (size_t i = 0; i < table->count; i++)
		for (int sensor = 0; sensor < 2; sensor++)
			put_sensor(&b, array, &table->cell[i], sensor,
			           reference_of(table, &table->cell[i], reference));
	array = put_array(&b, root, "plates");
	for (size_t i = 0; i < table->count; i++) {
		cJSON *item = put_append(&b, array);

		put_place(&b, item, &table->cell[i]);
		for (int k = 0; k < OTHERS; k++)
			put_mean(&b, item, archive_value_name(others[k]), others[k],
			         &table->cell[i].value[others[k]]);
	}
	return put_out(&b, root, out);
}

/* ---- CSV ---- */

static void sensor_csv(FILE *out, const struct archive_cell *cell, int sensor,
                       const struct archive_cell *reference)
{
	csv_text(out, cell->campaign);
	csv_text(out, cell->scene_name);
	csv_number(out, cell->angle_deg);
	csv_number(out, cell->height_m);
	fprintf(out, "%s,%u,", sensor_names[sensor], cell->drops);
	for (int axis = X; axis < AXES; axis++)
		csv_mean(out, mean_of(cell, sensor, axis));
	csv_number(out, resultant_of_means(cell, sensor));
	for (int axis = X; axis <= R; axis++)
		csv_number(out, print_ratio(mean_of(cell, 0, axis), mean_of(cell, 1, axis)));
	for (int axis = X; axis <= R; axis++)
		csv_number(out, reference != NULL ? print_ratio(mean_of(cell, sensor, axis),
		                                                mean_of(reference, sensor, axis))
		                                  : (double)NAN);
	csv_text(out, reference != NULL ? reference->scene_name : "");
	fprintf(out, "%u\n", cell->faulty);
}

static int tables_csv(const struct archive_table *table, const char *reference, FILE *out)
{
	fputs("campaign,scene,angle_deg,height_m,sensor,drops,", out);
	for (int axis = X; axis < AXES; axis++)
		fprintf(out, "%s_mean_g,%s_sd_g,%s_n,", axis_keys[axis], axis_keys[axis], axis_keys[axis]);
	fputs("r_of_means_g,s1_over_s2_x,s1_over_s2_y,s1_over_s2_r,over_reference_x,over_reference_y,"
	      "over_reference_r,reference,faulty\n",
	      out);
	for (size_t i = 0; i < table->count; i++)
		for (int sensor = 0; sensor < 2; sensor++)
			sensor_csv(out, &table->cell[i], sensor,
			           reference_of(table, &table->cell[i], reference));
	return print_done(out);
}

/* ---- text ---- */

static void number_text(FILE *out, double value, int width, int decimals)
{
	if (isnan(value))
		fprintf(out, "%*s", width, "-");
	else
		fprintf(out, "%*.*f", width, decimals, value);
}

/* A row of means, and one of SDs with a decimal more: they are small against their means. */
static void cell_text(FILE *out, const struct archive_cell *cell)
{
	char n[16];

	fprintf(out, "%5g  mean", cell->angle_deg);
	for (int k = 0; k < 2 * AXES; k++)
		number_text(out, mean_of(cell, k / AXES, k % AXES)->mean, 9, 1);
	number_text(out, cell->value[ARCHIVE_LAG].mean * 1000, 9, 2);
	number_text(out, cell->value[ARCHIVE_FREQUENCY].mean, 9, 1);
	number_text(out, cell->value[ARCHIVE_DAMPING].mean, 9, 3);
	snprintf(n, sizeof(n), "n=%u", cell->drops);
	fprintf(out, "\n%5s  SD  ", n);
	for (int k = 0; k < 2 * AXES; k++)
		number_text(out, mean_of(cell, k / AXES, k % AXES)->sd, 9, 2);
	number_text(out, cell->value[ARCHIVE_LAG].sd * 1000, 9, 3);
	number_text(out, cell->value[ARCHIVE_FREQUENCY].sd, 9, 2);
	number_text(out, cell->value[ARCHIVE_DAMPING].sd, 9, 4);
	fputc('\n', out);
}

static bool same_scene(const struct archive_cell *a, const struct archive_cell *b)
{
	return strcmp(a->scene_name, b->scene_name) == 0 && strcmp(a->campaign, b->campaign) == 0 &&
	       fabs(a->height_m - b->height_m) < 1e-9;
}

static void means_text(const struct archive_table *table, FILE *out)
{
	for (size_t i = 0; i < table->count; i++) {
		const struct archive_cell *cell = &table->cell[i];

		if (i == 0 || !same_scene(cell, cell - 1))
			fprintf(out,
			        "%s%s from %g m, campaign %s: peaks in g\n"
			        "%5s      %9s%9s%9s%9s%9s%9s%9s%9s%9s%9s%9s\n",
			        i > 0 ? "\n" : "", cell->scene_name, cell->height_m, cell->campaign, "deg",
			        "S1 X", "S1 Y", "S1 XY", "S1 Z", "S2 X", "S2 Y", "S2 XY", "S2 Z", "lag ms",
			        "plate Hz", "damping");
		cell_text(out, cell);
		if (cell->faulty > 0)
			fprintf(out, "%5s  %u accepted, but altered or missing, and in no mean\n", "",
			        cell->faulty);
	}
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
			number_text(out, print_ratio(mean_of(cell, 0, axis), mean_of(cell, 1, axis)), 7, 2);
		for (int k = 0; k < 6 && reference != NULL; k++)
			number_text(
			        out,
			        print_ratio(mean_of(cell, k / 3, k % 3), mean_of(reference, k / 3, k % 3)), 7,
			        2);
		fprintf(out, "  %s\n", reference != NULL ? reference->scene_name : "");
	}
}

int print_tables(struct archive *archive, const struct archive_filter *filter, bool undecided,
                 const char *reference, enum print_format format, FILE *out)
{
	struct archive_table table;
	int result = archive_table(archive, filter, undecided, &table);

	if (result != 0)
		return result;
	if (format == PRINT_JSON) {
		result = tables_json(&table, reference, out);
	} else if (format == PRINT_CSV) {
		result = tables_csv(&table, reference, out);
	} else {
		means_text(&table, out);
		if (table.count > 0)
			ratios_text(&table, reference, out);
		else
			fputs("no accepted drop\n", out);
		result = print_done(out);
	}
	archive_table_free(&table);
	return result;
}
