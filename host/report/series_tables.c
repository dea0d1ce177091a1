/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <string.h>

#include "host/report/series_private.h"
#include "host/result/repeats.h"
#include "host/result/uncertainty.h"

const char *series_decision(const struct series_drop *drop)
{
	if (!drop->a.sha256[0] || archive_is_faulty(&drop->a))
		return drop->a.state;
	return strcmp(drop->a.decision, "open") ? drop->a.decision : "undecided";
}

/* ---- drops, mean, SD, n ---- */

struct drop_row {
	char name[16];
	const char *decision;
	struct table_value value[ARCHIVE_VALUE_COUNT];
};

static void series_tables_put_drop(struct table *table, const struct series_drop *drop)
{
	struct drop_row row = {.decision = series_decision(drop)};

	snprintf(row.name, sizeof(row.name), "%u", drop->a.number);
	for (int i = 0; i < ARCHIVE_VALUE_COUNT; i++)
		row.value[i] = (struct table_value){drop->a.value[i], drop->a.sigma[i],
		                                    (drop->a.not_ok >> i & 1u) != 0};
	table->row_class = drop->counts ? "" : " class=\"out\"";
	table_row(table, &row);
}

static void put_total(struct table *table, const struct archive_cell *cell)
{
	static const char *const names[] = {"mean", "SD", "n"};
	struct drop_row row = {.decision = ""};

	for (table->of = TABLE_VALUES; table->of <= TABLE_COUNTS; table->of++) {
		snprintf(row.name, sizeof(row.name), "%s", names[table->of]);
		table->row_class = table->of == TABLE_VALUES ? " class=\"mean first\"" : " class=\"mean\"";
		archive_cell_row(cell, table->of, row.value);
		table_row(table, &row);
	}
}

static bool is_filled(const struct series_page *page, int value)
{
	for (size_t i = 0; i < page->count; i++)
		if (isfinite(page->drop[i]->a.value[value]))
			return true;
	return false;
}

/* Those columns of quantity.def, in g or in other units, that any drop has a value for. */
static void put_table(const struct series_page *page, bool in_g)
{
	struct table_column column[ARCHIVE_VALUE_COUNT + 2] = {
	        TABLE_COLUMN(CHARS, struct drop_row, name, .title = "drop"),
	        TABLE_COLUMN(WORDS, struct drop_row, decision, .title = "", .width = -1)};
	struct table table = {.out = page->page.out, .format = TABLE_HTML};
	size_t count = 2;

	for (int i = 0; i < ARCHIVE_VALUE_COUNT; i++) {
		const struct quantity_column *c = &quantity_columns[i];

		if ((strcmp(c->shown, "g") == 0) == in_g && is_filled(page, i))
			column[count++] =
			        (struct table_column){.kind = TABLE_VALUE,
			                              .offset = offsetof(struct drop_row, value) +
			                                        (size_t)i * sizeof(struct table_value),
			                              .title = c->title,
			                              .unit = in_g ? "" : c->shown,
			                              .digits = c->digits,
			                              .scale = quantity_column_scale(c)};
	}
	table_begin(&table, column, count);
	for (size_t i = 0; i < page->count; i++)
		series_tables_put_drop(&table, page->drop[i]);
	if (page->cell.drops)
		put_total(&table, &page->cell);
	(void)table_end(&table);
}

static void put_uncertainties(const struct series_page *page)
{
	struct budget_item item[ARCHIVE_VALUE_COUNT];
	size_t count = archive_cell_uncertainties(&page->cell, item);
	FILE *out = page->page.out;

	if (count == 0)
		return;
	fputs("<h2>Means with expanded uncertainty</h2>\n", out);
	(void)uncertainty_table(item, count, TABLE_HTML, out);
	fputs("<p class=\"note\">U = k u of the mean covers 95.45 %. Scatter falls with the number of drops, "
	      "s over the "
	      "root of n; all other parts are the same in each drop, do not fall, and cancel in differences "
	      "between drops, SD and trends.</p>\n",
	      out);
}

static void put_trends(struct series_page *page)
{
	FILE *out = page->page.out;
	struct repeats repeats;

	page->page.error =
	        archive_trends(page->request->archive, page->series.name, page->request->undecided, &repeats);
	if (page->page.error != 0)
		return;
	if (repeats.rows > 0) {
		fputs("<h2>How the series went</h2>\n", out);
		page->page.error = repeats_table(&repeats, TABLE_HTML, out);
		fputs("<p class=\"note\">" REPEATS_NOTE "</p>\n", out);
	}
	repeats_free(&repeats);
}

void series_results(struct series_page *page)
{
	FILE *out = page->page.out;

	fputs("<h2>Peaks, g</h2>\n", out);
	if (!page->count) {
		fputs("<p class=\"soft\">No drop was made yet.</p>\n", out);
		return;
	}
	put_table(page, true);
	fputs("<p class=\"note\">&plusmn; is one standard uncertainty of that drop. XY: largest resultant of "
	      "X "
	      "and "
	      "Y. SD: standard deviation of a single drop, over n &minus; 1. Struck through: in no mean. "
	      "*: see the remarks.</p>\n<h2>Lag of S1 behind S2, and the plate</h2>\n",
	      out);
	put_table(page, false);
	fputs("<p class=\"note\">Lag between the largest and between the first peaks, and as that of an "
	      "oscillator which S2 drives. Frequency and damping from the free ring-down of S1.</p>\n",
	      out);
	put_uncertainties(page);
	put_trends(page);
}

/* ---- model ---- */

/* The means as an analysis, for the comparison that one drop has, too. What is not ok in any drop is not
 * compared. */
struct means {
	struct channel channel[MODEL_AXES];
	struct estimate_channel estimate[MODEL_AXES];
	struct record record;
	struct analysis analysis;
	struct report report;
};

static enum estimate_status mean_status(const struct archive_mean *m)
{
	return m->n && !m->not_ok ? ESTIMATE_OK : ESTIMATE_SHORT;
}

static void fill_means(struct means *means, const struct series_page *page)
{
	static const struct {
		const char *name;
		enum archive_value value;
	} axes[MODEL_AXES] = {
	        {"S1X", ARCHIVE_S1_X}, {"S1Y", ARCHIVE_S1_Y}, {"S2X", ARCHIVE_S2_X}, {"S2Y", ARCHIVE_S2_Y}};
	const struct archive_mean *m = page->cell.value;
	struct analysis *a = &means->analysis;

	memset(means, 0, sizeof(*means));
	for (size_t i = 0; i < MODEL_AXES; i++) {
		const struct archive_mean *mean = &m[axes[i].value];

		snprintf(means->channel[i].name, sizeof(means->channel[i].name), "%s", axes[i].name);
		means->estimate[i].peak.value_g = mean->mean;
		means->estimate[i].peak.sigma_g = mean->sd;
		means->estimate[i].peak.how.status = mean_status(mean);
	}
	means->record = (struct record){.channels = means->channel, .channel_count = MODEL_AXES};
	*a = (struct analysis){
	        .channels = means->estimate, .channel_count = MODEL_AXES, .resultant_count = 2};
	for (size_t i = 0; i < 2; i++) {
		const struct archive_mean *mean = &m[i ? ARCHIVE_S2_R : ARCHIVE_S1_R];

		a->resultants[i].peak_g = mean->mean;
		a->resultants[i].sigma_g = mean->sd;
		a->resultants[i].how.status = mean_status(mean);
		snprintf(a->resultants[i].sensor, sizeof(a->resultants[i].sensor), "S%zu", i + 1);
	}
	a->has_lag = a->has_plate = true;
	a->lag.largest_peak_s = m[ARCHIVE_LAG].mean;
	a->lag.sigma_s = m[ARCHIVE_LAG].sd;
	a->lag.status = mean_status(&m[ARCHIVE_LAG]);
	a->lag.driven.status = ESTIMATE_SHORT;
	a->plate.frequency_hz = m[ARCHIVE_FREQUENCY].mean;
	a->plate.sigma_hz = m[ARCHIVE_FREQUENCY].sd;
	a->plate.three_cycle_frequency_hz = m[ARCHIVE_THREE_CYCLE].mean;
	a->plate.damping_ratio = m[ARCHIVE_DAMPING].mean;
	a->plate.sigma_damping = m[ARCHIVE_DAMPING].sd;
	a->plate.how.status = mean_status(&m[ARCHIVE_FREQUENCY]);
	means->report = (struct report){.record = &means->record,
	                                .analysis = a,
	                                .scene = &page->scene,
	                                .prediction = &page->prediction,
	                                .below = page->has_below ? &page->below : NULL};
}

static void model_reason(const struct series_page *page)
{
	const struct model_prediction *p = &page->prediction;
	FILE *out = page->page.out;

	fputs("<p>Taken: <b>", out);
	html_text(out, p->fidelity);
	fputs("</b>, ", out);
	html_text(out, p->reason);
	fputs(". ", out);
	if (p->next != MODEL_AUTO && isfinite(p->next_change))
		fprintf(out, "The next rung, %s, would change it by %.1f %%. ", model_fidelity_name(p->next),
		        100.0 * p->next_change);
	else if (p->next == MODEL_AUTO)
		fputs("There is no rung above it. ", out);
	if (page->has_below) {
		fputs("The next simpler one is ", out);
		html_text(out, page->below.fidelity);
		fputs(".", out);
	}
	fputs("</p>\n", out);
}

/* One drop's count of cycles has no uncertainty, that of several has their SD. */
static double row_sd(const struct means *means, const struct archive_mean *m, const struct report_row *row)
{
	bool counted = strcmp(row->key, "plate_frequency_hz") == 0 && isfinite(row->measured) &&
	               isfinite(means->analysis.plate.three_cycle_frequency_hz);

	return counted ? m[ARCHIVE_THREE_CYCLE].sd : row->sigma;
}

static void model_rows(const struct series_page *page)
{
	struct report_row rows[REPORT_ROWS_MAX];
	struct means means;
	size_t count;
	FILE *out = page->page.out;

	fill_means(&means, page);
	count = report_compare(&means.report, rows);
	fputs("<div class=\"scroll\" tabindex=\"0\"><table "
	      "class=\"small\"><thead><tr><th>quantity</th><th>model</th><th>mean of "
	      "drops</th><th>SD</th><th>difference</th>",
	      out);
	fputs(page->has_below ? PAGE_SIMPLER "</tr></thead><tbody>\n" : "</tr></thead><tbody>\n", out);
	for (size_t i = 0; i < count; i++) {
		page_begin_compared(out, &rows[i]);
		html_number(out, rows[i].decimals, rows[i].measured * rows[i].scale);
		fputs("</td><td>", out);
		html_number(out, rows[i].decimals,
		            row_sd(&means, page->cell.value, &rows[i]) * rows[i].scale);
		page_end_compared(out, &rows[i], page->has_below);
	}
	fputs("</tbody></table></div>\n", out);
}

void series_model(struct series_page *page)
{
	FILE *out = page->page.out;

	fputs("<h2>Model against drops</h2>\n", out);
	if (!page->has_model) {
		fputs("<p class=\"soft\">No model answers for this scene.</p>\n", out);
		return;
	}
	model_reason(page);
	if (!page->cell.drops) {
		fputs("<p class=\"soft\">No drop counts, so there is nothing to compare with.</p>\n", out);
		return;
	}
	model_rows(page);
	fputs("<p class=\"note\">Difference: model less measured, over measured. A dash: not known well "
	      "enough "
	      "to compare. Next simpler model: how far that one is from the model.</p>\n",
	      out);
}
