/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RESULT_VERDICT_H
#define DT_HOST_RESULT_VERDICT_H
/*
 * A drop against its test plan (plan.h): a decision for each limit (decide.h), and the worst of them.
 *
 * The uncertainty of a value is its own, and, where the plan states one, the measuring chain's. A value that
 * is flagged, or whose channel or drop is, is undecided unless it fails. So is what has no value or no
 * uncertainty.
 */
#include "host/base/table.h"
#include "host/result/decide.h"
#include "host/result/plan.h"
#include "host/result/said.h"

enum { VERDICT_ITEMS_MAX = PLAN_LIMITS_MAX + 3 };

struct verdict_item {
	char what[112];      /* "S2X.peak.value_g", "S2X.band", "S2X.transverse_ratio", "S2X.spectrum" */
	const char *unit;    /* of the values: "g" */
	double value, sigma; /* of a curve: where it is worst, there its uncertainty */
	double lower, upper; /* infinite: none */
	double at;           /* of a curve: where that is, s after the pulse leaves 10 %, or Hz; else NAN */
	double guard;        /* w */
	double probability;  /* that the limits are met */
	double margin;       /* the smaller distance to a limit over U, negative outside */
	double e_n;          /* of a check: (value - reference) / sqrt(U^2 + its U^2); else NAN */
	enum decision decision;
	char reason[160]; /* why it is undecided, E_n of a check; "" */
};

struct verdict {
	enum decision decision; /* the worst */
	const char *name;       /* of it */
	const char *by;         /* the preset; "" none */
	const char *rule;       /* in one sentence */
	const char *rests_on;   /* what the uncertainties are of */
	bool verified;      /* the limits are not from a preset that nobody has held against its standard */
	double guard;       /* r */
	double risk;        /* the largest of a pass */
	double probability; /* the least of the items' */
	size_t count, failed, undecided;
	struct verdict_item item[VERDICT_ITEMS_MAX];
};

#define VERDICT_UNVERIFIED "The limits are not verified against the standard: entered by the laboratory"

/* plan must not be empty. The largest E_n of each sensor's checks goes to it (sensor_used). DT_E_MEMORY. */
DT_MUST_USE int verdict_judge(struct verdict *verdict, const struct plan *plan, struct result *result);

/* What the JSON of a result says, as long as that lives; false: nothing was judged. */
bool verdict_read(struct verdict *verdict, const cJSON *result);

/* The items as a table. */
int verdict_table(const struct verdict *verdict, enum table_format format, FILE *out);

/* "CONDITIONAL PASS" */
void verdict_word(enum decision decision, FILE *out);

/* "FAIL: 2 of 5 limits fail, ..." */
void verdict_line(const struct verdict *verdict, FILE *out);

#endif
