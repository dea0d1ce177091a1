/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_REPORT_FITTED_H
#define DT_HOST_REPORT_FITTED_H
/* A fit told: as text, as JSON and as a page with pictures. */
#include <stdio.h>

#include "host/base/table.h"
#include "host/fit/fit.h"

struct fitted {
	const struct fit *fit;
	const char (*name)[128]; /* of each of its drops */
	/* What it was made of; for the page. */
	const struct scene *start;
	const struct fit_drop *drop;
	const struct fit_options *options;
	const char *version;                   /* of the program */
	const struct translation *translation; /* of the page; NULL: English */
};

/* Whether its bars hold: nothing is left unexplained, and no parameter is beyond what is allowed. */
bool fitted_holds(const struct fit *fit);

void fitted_parameters(const struct fit *fit, enum table_format format, FILE *out);
void fitted_drops(const struct fitted *fitted, enum table_format format, FILE *out);

/* From FITTED_FROM_DEG to FITTED_TO_DEG, where the fit holds. */
enum { FITTED_FROM_DEG = 15, FITTED_TO_DEG = 45, FITTED_STEP_DEG = 5 };
void fitted_predictions(const struct fit *fit, enum table_format format, FILE *out);

/* Which drop to do next, one line; nothing where the fit does not hold. */
void fitted_next(const struct fit *fit, enum table_format format, FILE *out);

void fitted_text(const struct fitted *fitted, FILE *out);
void fitted_json(const struct fitted *fitted, FILE *out);

/* 0; DT_E_SYSTEM when a picture fails, DT_E_MEMORY: one line in message. */
DT_MUST_USE int fitted_page(const struct fitted *fitted, FILE *out, char *message, size_t size);

#endif
