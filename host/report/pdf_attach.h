/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_REPORT_PDF_ATTACH_H
#define DT_HOST_REPORT_PDF_ATTACH_H
/*
 * A table put into a PDF, as an attachment that its reader shows and saves (ISO 32000-1, 7.5.6 incremental
 * updates, 7.11.4 embedded files; ISO 32000-2, 14.13 associated files). The PDF is one as a browser prints
 * it: a table of places in plain text, no attachments yet.
 *
 * All memory is the caller's. name is ours: letters, digits and . _ - alone.
 */
#include <stddef.h>
#include <stdio.h>

#include "common/error.h"

struct pdf_file {
	const char *name;
	const char *bytes;
	size_t size;
};

/* Writes pdf and behind it the file, up to the word startxref: what a caller writes next are comments.
 * *start: the number that pdf_attach_end wants. DT_E_FORMAT: no such PDF, and nothing was written. */
DT_MUST_USE int pdf_attach(const char *pdf, size_t length, const struct pdf_file *file, FILE *out,
                           size_t *start);
void pdf_attach_end(FILE *out, size_t start);

#endif
