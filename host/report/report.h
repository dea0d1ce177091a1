/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_REPORT_REPORT_H
#define DT_HOST_REPORT_REPORT_H
/*
 * An analysis for people and programs: a table for the terminal, JSON, and one self-contained HTML page.
 * The functions only read what they are given.
 */
#include <stdio.h>

#include "common/scenes/scene.h"
#include "host/estimate/estimate.h"
#include "host/model/model.h"
#include "host/record/record.h"
#include "host/report/language.h"
#include "host/result/verdict.h"
#include "host/shock/band.h"
#include "host/shock/events.h"
#include "host/shock/free_fall.h"

struct report {
	const struct record *record;
	const struct analysis *analysis;
	struct estimate_options options; /* by which it was analysed: what was done to the samples */
	const struct scene *scene;       /* NULL: none was given */
	const struct model_prediction *prediction; /* NULL: no scene */
	const struct model_prediction *below;      /* by the rung below; NULL: none */
	const struct events *events;               /* NULL: none were looked for */
	const struct free_falls *falls;            /* as events */
	const struct band *band;                   /* NULL: no band was given */
	const struct verdict *verdict;             /* NULL: no limits were given */
	const struct sensors *sensors;         /* NULL: none has a file, the uncertainties are noise only */
	const struct budget *budget;           /* NULL: as sensors */
	bool show_events;                      /* in the table too */
	bool simulated;                        /* no product fell: the page says so */
	bool unattended;                       /* nobody was asked before it fell */
	bool tolerance_asked;                  /* what is less certain than it gets a note */
	const char *version;                   /* of the program, for the page's foot; NULL: not said */
	const struct translation *translation; /* of the page; NULL: English */
};

/* The result table. 0 or DT_E_SYSTEM. */
DT_MUST_USE int report_text(const struct report *report, FILE *out);

/* One JSON object on one line; keys in snake_case with units, numbers with as many digits as give the same
 * double again, NAN as null, texts as valid UTF-8. Times count from the record's first instant. What does
 * not apply (drop, lag, plate, scene, model) is null. 0, DT_E_SYSTEM or DT_E_MEMORY. */
DT_MUST_USE int report_json(const struct report *report, FILE *out);

/* One HTML file without outside references; pictures are SVG made by gnuplot, which is run for it. The file
 * is whole or not there: it is written beside and then renamed. 0, or DT_E_* with a line in message. */
DT_MUST_USE int report_html(const struct report *report, const char *file, char *message, size_t size);

/* The JSON Schema of what report_json writes, as far as quantity.def has it: one object on one line. 0,
 * DT_E_SYSTEM or DT_E_MEMORY. */
DT_MUST_USE int report_schema(FILE *out);

#endif
