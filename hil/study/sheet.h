/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HIL_STUDY_SHEET_H
#define DT_HIL_STUDY_SHEET_H
/*
 * Titles, sentences and tables, written twice at once: as plain text and as an HTML page. Texts are ours; a
 * cell ends at '|', one that ends in '*' stands out on the page.
 */
#include <stddef.h>
#include <stdio.h>

struct sheet_column {
	const char *group; /* columns beside each other with the same group share its title */
	const char *name;
	int width; /* in the text */
};

enum { SHEET_COLUMNS_MAX = 24 };

struct sheet {
	FILE *text, *page; /* set by the caller */
	const struct sheet_column *columns;
	size_t count;
};

void sheet_begin(struct sheet *sheet, const char *title);
void sheet_end(struct sheet *sheet);

void sheet_heading(struct sheet *sheet, const char *title);
void sheet_say(struct sheet *sheet, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* columns must last until the end of the table. */
void sheet_table(struct sheet *sheet, const struct sheet_column *columns, size_t count);
void sheet_row(struct sheet *sheet, const char *format, ...) __attribute__((format(printf, 2, 3)));
void sheet_table_end(struct sheet *sheet);

/* On the page only. */
void sheet_picture(struct sheet *sheet, const char *title, const char *text, const char *svg);

#endif
