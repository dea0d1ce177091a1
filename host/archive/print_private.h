/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ARCHIVE_PRINT_PRIVATE_H
#define DT_HOST_ARCHIVE_PRINT_PRIVATE_H
/*
 * What the printers share.
 */
#include "host/archive/print.h"
#include "host/base/put.h"

/* What is being printed, as the context of the archive_each_* calls. */
struct print {
	FILE *out;
	struct archive *archive;
	bool undecided, with_events;
	struct builder builder;
	cJSON *array;              /* of what is printed as JSON */
	size_t lines, limit;       /* limit 0: none */
	bool more;                 /* than limit */
	bool marked;               /* a value has a star */
	unsigned faulty;           /* drops whose files are altered or missing */
	struct archive_cell total; /* of the drops that count */
};

/* The filter of a list: one more than its limit is asked for, so that more can be told. */
struct archive_filter print_begin(struct print *p, const struct archive_filter *filter);

/* There is no room for another: for the head of each call. */
bool print_is_full(struct print *p);

/* Says in a line of text that there are more. */
void print_more(const struct print *p);

/* "name_unit", or "name_sigma_unit". */
enum { PRINT_KEY_MAX = 48 };
void print_key(char key[PRINT_KEY_MAX], enum archive_value value, const char *part);

void put_mean(struct builder *b, cJSON *object, const char *key, enum archive_value value,
              const struct archive_mean *mean);
void put_series_keys(struct builder *b, cJSON *object, const struct archive_series *series);

void csv_text(FILE *out, const char *text); /* quoted where it must be; then a comma */
void csv_number(FILE *out, double value);   /* nothing when NAN; then a comma */
void csv_mean(FILE *out, const struct archive_mean *mean);
int print_done(FILE *out);

/* mean a / mean b; NAN where there is none. */
double print_ratio(const struct archive_mean *a, const struct archive_mean *b);

#endif
