/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_REPORT_SERIES_H
#define DT_HOST_REPORT_SERIES_H
/*
 * The report of a series: one self-contained HTML file for whoever ordered the drops. Every number of its
 * tables is the archive's; the traces are drawn from the raw logs, once their SHA-256 is what was recorded,
 * with baseline, peak and time 0 of the archived results: nothing is estimated here. The model is solved
 * again from the series' scene.
 *
 * For the thread that has the archive. Memory is given back before the return.
 */
#include <stdbool.h>
#include <stdio.h>

#include "host/archive/archive.h"
#include "host/report/laboratory.h"
#include "host/report/language.h"

/* How the last comment of the page begins: what it rests on, a line each, for `droptower verify`:
 * "series NAME", "log PLACE SHA-256" for each drop, "chain ENTRY HEAD", "data TABLE", and an empty seal
 * (host/record/seal.h). TABLE is request->data in base64. */
#define SERIES_EVIDENCE "<!-- droptower evidence\n"

struct series_report {
	struct archive *archive;
	const char *series;
	const char *data; /* the table of its drops as CSV, which the page carries along; data_size bytes */
	size_t data_size;
	bool undecided;      /* drops that are not decided count, too */
	const char *version; /* of the program, for the page's foot; NULL: not said */
	bool partial;        /* even when a trace cannot be drawn or a file is not what was recorded */
	/* Called with one line for each recorded drop of which that is so, and why; NULL: nobody is told. */
	void (*lacking)(void *context, const char *text);
	void *context;
	const struct laboratory *laboratory;   /* NULL: no report under ISO/IEC 17025, 7.8 */
	const struct translation *translation; /* NULL: English */
	bool strict;                           /* no report with a sensor whose calibration was overdue */
};

/* Writes the page to out, gnuplot is run for its pictures. 0, or DT_E_* with one line in message, and what
 * out has got is of no use: DT_E_UNKNOWN, no such series; DT_E_STATE, a calibration was
 * overdue, and strict is set; DT_E_CORRUPT, a drop lacks what the page rests on,
 * and partial is not set. What is lacking is told, and stands on the page of a partial one. */
DT_MUST_USE int series_report_html(const struct series_report *request, FILE *out, char *message,
                                   size_t size);

#endif
