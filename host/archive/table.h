/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ARCHIVE_TABLE_H
#define DT_HOST_ARCHIVE_TABLE_H
/*
 * Means and standard deviations of drops, by campaign, scene, height and angle.
 */
#include "host/archive/archive.h"
#include "host/base/table.h"

struct archive_mean {
	unsigned n;                /* drops that have the value */
	unsigned not_ok;           /* of them, those whose status says to look */
	double mean;               /* NAN without any */
	double sd;                 /* of a single drop, over n - 1; NAN below two */
	double squares;            /* while it grows: sum of squared deviations */
	struct budget_mean budget; /* of those that have one, while it grows */
	struct budget_item
	        whole; /* the mean's uncertainty; expanded NAN: none, since one of them has no budget */
};

struct archive_cell {
	char campaign[ARCHIVE_NAME_MAX + 1];
	char scene_name[64];
	double angle_deg, height_m, plate_mass_kg;
	unsigned drops;
	unsigned faulty; /* accepted, and left out since their files are altered or missing */
	struct archive_mean value[ARCHIVE_VALUE_COUNT];
};

/* Means, SDs or counts of a cell, as a row of a table has them; a mean is marked when one of its values is.
 */
void archive_cell_row(const struct archive_cell *cell, enum table_of of,
                      struct table_value value[ARCHIVE_VALUE_COUNT]);

struct archive_table {
	struct archive_cell *cell; /* in the order of campaign, scene, height and angle */
	size_t count;
};

/* Adds a drop, or notes that it is faulty; a cell is begun zeroed. (Welford 1962) */
void archive_cell_add(struct archive_cell *cell, const struct archive_drop *drop);

/* Its means' uncertainties, once all drops are in. */
void archive_cell_close(struct archive_cell *cell);

/* Those that there are, by the values' titles and in the units that people read. Returns how many. */
size_t archive_cell_uncertainties(const struct archive_cell *cell,
                                  struct budget_item item[ARCHIVE_VALUE_COUNT]);

/* Whether a drop counts: accepted, or with undecided, also recorded and not yet decided; and its files are
 * what was recorded. */
bool archive_counts(const struct archive_drop *drop, bool undecided);

/* Of the drops that pass and count. To be freed by archive_table_free after 0. */
DT_MUST_USE int archive_table(struct archive *archive, const struct archive_filter *filter, bool undecided,
                              struct archive_table *table);
void archive_table_free(struct archive_table *table);

/* The cell of that scene in cell's campaign, at its angle and height; NULL when there is none. */
const struct archive_cell *archive_table_find(const struct archive_table *table,
                                              const struct archive_cell *cell, const char *scene_name);

/* The scene that others are compared with: the only one of cell's campaign, angle and height without a plate.
 * NULL when there is none or more than one, or it is cell's own. */
const struct archive_cell *archive_table_reference(const struct archive_table *table,
                                                   const struct archive_cell *cell);

#endif
