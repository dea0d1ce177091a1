/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The test plan over a series: what its drops came to, and of each limit the drop that met it worst.
 */
#include <math.h>
#include <string.h>

#include "host/report/series_private.h"

struct limit_row {
	char drop[16];
	struct verdict_item item;
	double expanded;
	char said[200];
};
#define COLUMN(KIND, member, ...) TABLE_COLUMN(KIND, struct limit_row, member, __VA_ARGS__)

static const struct table_column limit_columns[] = {
        COLUMN(CHARS, item.what, .title = "limit on", .width = -1),
        COLUMN(NUMBER, item.lower, .title = "from", .digits = 3),
        COLUMN(NUMBER, item.upper, .title = "to", .digits = 3),
        COLUMN(WORDS, item.unit, .title = "", .width = -1),
        COLUMN(CHARS, drop, .title = "worst drop"),
        COLUMN(NUMBER, item.value, .title = "value", .digits = 3),
        COLUMN(NUMBER, expanded, .title = "U (k = 2)", .digits = 3),
        COLUMN(NUMBER, item.guard, .title = "guard band", .digits = 3),
        COLUMN(NUMBER, item.probability, .title = "p", .digits = 4),
        COLUMN(CHARS, said, .title = "decision", .width = -1),
};

/* The worse decision, and of one decision the smaller margin. */
static bool is_worse(const struct verdict_item *a, const struct verdict_item *b)
{
	return a->decision != b->decision ? a->decision > b->decision : a->margin < b->margin;
}

/* All drops of a series have the same limits in the same order, unless a channel is missing. */
static void limit_row_of(const struct series_page *page, const char *what, struct limit_row *row)
{
	row->drop[0] = '\0';
	for (size_t i = 0; i < page->count; i++) {
		const struct series_drop *d = page->drop[i];

		for (size_t k = 0; d->judged && d->counts && k < d->verdict.count; k++) {
			const struct verdict_item *item = &d->verdict.item[k];

			if (strcmp(item->what, what) || (row->drop[0] && !is_worse(item, &row->item)))
				continue;
			row->item = *item;
			snprintf(row->drop, sizeof(row->drop), "%u", d->a.number);
		}
	}
	row->expanded = DECIDE_COVERAGE * row->item.sigma;
	row->item.lower = isfinite(row->item.lower) ? row->item.lower : (double)NAN;
	row->item.upper = isfinite(row->item.upper) ? row->item.upper : (double)NAN;
	snprintf(row->said, sizeof(row->said), "%s%s%s", decide_name(row->item.decision),
	         row->item.reason[0] ? ": " : "", row->item.reason);
}

static void limit_table(struct series_page *page, const struct verdict *of)
{
	struct table table = {.out = page->page.out, .format = TABLE_HTML};

	table_begin(&table, limit_columns, TABLE_COUNT(limit_columns));
	for (size_t k = 0; k < of->count; k++) {
		struct limit_row row = {.drop = ""};

		limit_row_of(page, of->item[k].what, &row);
		table_row(&table, &row);
	}
	if (table_end(&table))
		page->page.error = DT_E_MEMORY;
}

void series_limits(struct series_page *page)
{
	size_t of[DECIDE_FAIL + 1] = {0}, counted = series_counted(page), judged = 0;
	const struct verdict *worst = NULL;
	FILE *out = page->page.out;

	if (!page->scene.limits[0])
		return;
	for (size_t i = 0; i < page->count; i++) {
		const struct series_drop *d = page->drop[i];

		if (!d->counts || !d->judged)
			continue;
		judged++;
		of[d->verdict.decision]++;
		if (worst == NULL || d->verdict.decision > worst->decision)
			worst = &d->verdict;
	}
	fputs("<h2>Limits</h2>\n", out);
	if (worst == NULL) {
		fputs("<div class=\"verdict bad\">UNDECIDED: no drop that counts could be held against the "
		      "limits</div>\n",
		      out);
		return;
	}
	fprintf(out, "<div class=\"verdict %s\">",
	        decide_meets(worst->decision) && judged == counted ? "good" : "bad");
	verdict_word(worst->decision, out);
	fprintf(out,
	        ": of %zu drops that count %zu pass, %zu pass conditionally, %zu fail conditionally, %zu "
	        "fail, %zu undecided</div>\n",
	        counted, of[DECIDE_PASS], of[DECIDE_CONDITIONAL_PASS], of[DECIDE_CONDITIONAL_FAIL],
	        of[DECIDE_FAIL], of[DECIDE_UNDECIDED] + counted - judged);
	limit_table(page, worst);
	page_limits_by(out, worst);
	fprintf(out, "<p class=\"note\">Decision rule: %s; r = %g, risk of a pass up to %.2g %%.</p>\n",
	        worst->rule, worst->guard, 100.0 * worst->risk);
}
