/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <inttypes.h>
#include <math.h>

#include "host/model/corner.h"
#include "host/model/ensemble.h"
#include "host/report/page.h"
#include "host/result/quantity.h"
#include "host/result/uncertainty.h"

enum { GAPS_MAX = 20 }; /* listed */

static void result_row(struct page *page, size_t i)
{
	const struct channel *c = &page->report->record->channels[i];
	const struct estimate_channel *e = &page->report->analysis->channels[i];
	FILE *out = page->out;
	char status[48];

	fputs("<tr><td>", out);
	page_channel_name(out, c->name);
	fputs("</td><td>", out);
	html_number(out, 1, c->rate_hz);
	fputs("</td><td>", out);
	html_with_sigma(out, 2, e->peak.value_g, e->peak.sigma_g);
	fputs("</td><td>", out);
	html_with_sigma(out, 4, (e->peak.time_s - page->zero.time_s) * 1e3, e->peak.sigma_time_s * 1e3);
	fputs("</td><td>", out);
	html_with_sigma(out, 3, e->pulse.duration_s * 1e3, e->pulse.sigma_duration_s * 1e3);
	fputs("</td><td>", out);
	html_with_sigma(out, 3, e->pulse.velocity_change_m_s, e->pulse.sigma_velocity_m_s);
	fputs("</td><td>", out);
	html_number(out, 2, e->baseline.noise_g);
	fprintf(out, "</td><td class=\"text\">%s</td></tr>\n",
	        report_channel_status(e, status, sizeof(status)));
}

static void results(struct page *page)
{
	const struct analysis *a = page->report->analysis;
	FILE *out = page->out;

	fputs("<h2>Results</h2>\n<div class=\"scroll\" tabindex=\"0\"><table><tr><th>channel</th><th>rate, "
	      "Hz</th><th>peak, "
	      "g</th><th>at, ms</th><th>width at 10 %, ms</th><th>velocity change, m/s</th><th>noise, g</th>"
	      "<th class=\"text\">status</th></tr>\n",
	      out);
	for (size_t i = 0; i < a->channel_count; i++)
		result_row(page, i);
	for (size_t i = 0; i < a->resultant_count; i++) {
		const struct estimate_resultant *r = &a->resultants[i];

		fprintf(out, "<tr><td>%s X, Y</td><td></td><td>", r->sensor);
		html_with_sigma(out, 2, r->peak_g, r->sigma_g);
		fputs("</td><td>", out);
		html_with_sigma(out, 4, (r->time_s - page->zero.time_s) * 1e3, r->sigma_time_s * 1e3);
		fputs("</td><td colspan=\"3\" class=\"text soft\">", out);
		if (isfinite(r->axes_apart_s))
			fprintf(out, "Y peaks %.3f ms %s X", fabs(r->axes_apart_s) * 1e3,
			        r->axes_apart_s < 0.0 ? "before" : "after");
		fprintf(out, "</td><td class=\"text\">%s</td></tr>\n", estimate_status_name(r->how.status));
	}
	fputs("</table></div>\n<p class=\"note\">&plusmn; is one standard uncertainty. Velocity change: the "
	      "integral over the pulse.</p>\n",
	      out);
}

/* A row for each value that has a label; "?" in front of it: none without a value. */
static void joint_rows(FILE *out, enum quantity_object which, const void *object)
{
	const struct quantity *q = NULL;

	while ((q = quantity_next(which, q))) {
		bool optional = q->label[0] == '?';
		double value = quantity_number(q, object), scale = quantity_scale(q);

		if (!q->label[0] || (optional && !isfinite(value)))
			continue;
		fprintf(out, "<tr><td>%s</td><td>", q->label + optional);
		html_with_sigma(out, q->digits, value * scale, quantity_sigma(q, object) * scale);
		fprintf(out, " %s</td><td class=\"text\">%s</td></tr>\n", q->shown,
		        estimate_status_name(quantity_status(q, object)));
	}
}

static void joint(struct page *page)
{
	const struct analysis *a = page->report->analysis;
	FILE *out = page->out;

	if (!a->has_lag && !a->has_plate && !a->has_rebound && !a->has_motion)
		return;
	fputs("<h2>S1 against S2</h2>\n<div class=\"scroll\" tabindex=\"0\"><table "
	      "class=\"small\"><tr><th>quantity</th><th>value</th>"
	      "<th class=\"text\">status</th></tr>\n",
	      out);
	if (a->has_lag && report_driven(page->report))
		joint_rows(out, QUANTITY_DRIVEN, &a->lag);
	if (a->has_lag)
		joint_rows(out, QUANTITY_LAG, &a->lag);
	if (a->has_plate)
		joint_rows(out, QUANTITY_RINGDOWN, &a->plate);
	if (a->has_rebound)
		joint_rows(out, QUANTITY_REBOUND, &a->rebound);
	if (a->has_motion)
		joint_rows(out, QUANTITY_MOTION, &a->motion);
	fputs("</table></div>\n", out);
	if (a->has_motion && a->motion.status != ESTIMATE_OK) {
		fputs("<p class=\"note\">The body of the fitted scene is not laid over this drop: ", out);
		html_text(out, a->motion.refused);
		fputs(".</p>\n", out);
	}
}

static void model(struct page *page)
{
	struct report_row rows[REPORT_ROWS_MAX];
	size_t count = report_compare(page->report, rows);
	bool fitted = count > 0 && ensemble_fitted(page->report->scene),
	     simpler = !fitted && page->report->below != NULL;
	FILE *out = page->out;

	if (!count)
		return;
	fputs("<h2>Model against drop</h2>\n<p class=\"soft\">Model ", out);
	html_text(out, page->report->prediction->fidelity);
	fputs(", ", out);
	html_text(out, page->report->prediction->reason);
	fputs(".</p>\n<div class=\"scroll\" tabindex=\"0\"><table "
	      "class=\"small\"><tr><th>quantity</th><th>model</th><th>measured</th>"
	      "<th>difference</th>",
	      out);
	fputs(simpler ? PAGE_SIMPLER "</tr>\n" : "</tr>\n", out);
	for (size_t i = 0; i < count; i++) {
		page_begin_compared(out, &rows[i]);
		html_with_sigma(out, rows[i].decimals, rows[i].measured * rows[i].scale,
		                rows[i].sigma * rows[i].scale);
		page_end_compared(out, &rows[i], simpler);
	}
	fputs("</table></div>\n<p class=\"note\">Difference: model less measured, over measured. A dash: not "
	      "known well enough to compare.",
	      out);
	if (fitted)
		fprintf(out,
		        " Behind the model's value, &plusmn;: the standard uncertainty of what one drop may "
		        "show, by %s, angle and speed about what was set and the sensors' gains; the law's "
		        "own error is not in it. Agrees: within twice both uncertainties; 2 sigma: beyond; "
		        "not possible: beyond four times.",
		        corner_predicted(page->report->scene)
		                ? "the contact's stiffness, which is predicted from the materials"
		                : "the fit of the scene");
	else if (simpler)
		fprintf(out, " Next simpler model: how far %s is from the model.",
		        page->report->below->fidelity);
	fputs("</p>\n", out);
}

static void gaps(struct page *page)
{
	const struct record *r = page->report->record;
	FILE *out = page->out;

	if (!r->gap_count)
		return;
	fputs("<h2>Missing samples</h2>\n", out);
	fputs("<table class=\"small\"><tr><th class=\"text\">missing</th><th>first tick, ms</th><th>last "
	      "tick, ms</th>"
	      "<th>blocks</th></tr>",
	      out);
	for (size_t i = 0; i < r->gap_count && i < GAPS_MAX; i++)
		fprintf(out,
		        "<tr><td>S%u</td><td>%" PRIu32 "</td><td>%" PRIu32 "</td><td>%" PRIu32 "</td></tr>",
		        r->gaps[i].sensor, r->gaps[i].first_tick_ms, r->gaps[i].last_tick_ms,
		        r->gaps[i].last_tick_ms - r->gaps[i].first_tick_ms + 1);
	fputs("</table>\n", out);
	if (r->gap_count > GAPS_MAX)
		fprintf(out, "<p class=\"soft\">and %zu more gaps, all listed in the JSON.</p>\n",
		        r->gap_count - GAPS_MAX);
}

static void uncertainties(struct page *page)
{
	const struct report *report = page->report;
	FILE *out = page->out;

	if (report->budget == NULL || report->budget->count == 0)
		return;
	fputs("<h2>Expanded uncertainties</h2>\n", out);
	(void)uncertainty_table(report->budget->item, report->budget->count, TABLE_HTML, out);
	fputs("<p class=\"note\">U = k u covers 95.45 %; &plusmn; above is one standard uncertainty of noise "
	      "and fit. By "
	      "the files of the sensors: ",
	      out);
	for (size_t i = 0; i < report->sensors->count; i++) {
		const struct sensor_used *s = &report->sensors->used[i];

		fputs(i > 0 ? "; " : "", out);
		html_own(out, s->name);
		fputs(", serial number ", out);
		html_own(out, s->serial);
		fputs(", certificate ", out);
		html_own(out, s->certificate);
		fprintf(out, " of %s, due %s%s", s->date, s->due,
		        s->overdue ? ": <b style=\"color:var(--bad)\">OVERDUE</b>" : "");
	}
	fputs(".</p>\n", out);
}

void page_tables(struct page *page)
{
	results(page);
	joint(page);
	uncertainties(page);
	model(page);
	gaps(page);
}
