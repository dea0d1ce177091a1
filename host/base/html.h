/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_BASE_HTML_H
#define DT_HOST_BASE_HTML_H
/*
 * Texts and numbers within HTML.
 */
#include <stddef.h>
#include <stdio.h>

/* A text, escaped: harmless between tags and within a quoted attribute. */
void html_text(FILE *out, const char *text);
void html_text_part(FILE *out, const char *text, size_t length);

/* The same of the user's words, between marks, so that no translation takes them for the page's. A page in
 * memory has the marks, a finished one has not (host/report/language.h). */
#define HTML_OWN '\1'
#define HTML_OWN_END '\2'
void html_own(FILE *out, const char *text);

/* A dash when it is not known; negative decimals: so many significant digits, three of the uncertainty. */
void html_number(FILE *out, int decimals, double value);
void html_with_sigma(FILE *out, int decimals, double value, double sigma);

#endif
