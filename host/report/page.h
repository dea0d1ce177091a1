/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_REPORT_PAGE_H
#define DT_HOST_REPORT_PAGE_H
/*
 * The HTML page while it is written: what its sections share. html.c puts them in their order; private to it
 * and to the page_*.c beside it.
 */
#include "host/report/facts.h"

/* The first picture that fails is remembered and the rest are left out. */
struct page {
	FILE *out;
	const struct report *report;
	struct report_zero zero;
	size_t pictures;
	int error; /* DT_E_* of that picture, its line in message */
	char *message;
	size_t size;
};

/* A text of the user's, escaped. */
void page_text(FILE *out, const char *text);

/* A dash when it is not known. */
void page_number(FILE *out, int decimals, double value);
void page_with_sigma(FILE *out, int decimals, double value, double sigma);

/* "S1X" as "S1 X"; other names as they are. */
void page_channel_name(FILE *out, const char *name);

/* The sections that are pictures, and those that are tables. */
void page_pictures(struct page *page);
void page_tables(struct page *page);

#endif
