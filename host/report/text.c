/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "host/report/facts.h"
#include "host/result/measured.h"
#include "host/report/shock.h"
#include "host/result/quantity.h"
#include "host/result/uncertainty.h"

enum { TEXT_GAPS_MAX = 8, TEXT_WIDTH = 90 };

static void text_cell(FILE *out, int width, int decimals, double value)
{
	if (isfinite(value))
		fprintf(out, " %*.*f", width, decimals, value);
	else
		fprintf(out, " %*s", width, "-");
}

/* Writes text behind what ends at column, a blank before each word, its last one followed by end; no line
 * becomes longer than the table. Returns the column after it. */
static int text_fill(FILE *out, int column, const char *text, const char *end)
{
	while (*text) {
		size_t length = strcspn(text, " ");
		const char *next = text + length + strspn(text + length, " ");
		const char *behind = *next ? "" : end;

		if (column + 1 + (int)(length + strlen(behind)) > TEXT_WIDTH)
			column = fprintf(out, "\n ") - 1;
		column += fprintf(out, " %.*s%s", (int)length, text, behind);
		text = next;
	}
	return column;
}

/* Names the channels of a flag that some have and others have not. */
static void write_flagged(const struct report *report, unsigned flag, int column, FILE *out)
{
	const struct analysis *a = report->analysis;
	size_t flagged = 0, named = 0;
	char name[48];

	for (size_t i = 0; i < a->channel_count; i++)
		flagged += (a->channels[i].flags & flag) != 0;
	if (flagged == a->channel_count)
		return;
	for (size_t i = 0; i < a->channel_count; i++) {
		if (!(a->channels[i].flags & flag))
			continue;
		snprintf(name, sizeof(name), "%s%s", named++ ? "" : "(", report->record->channels[i].name);
		column = text_fill(out, column, name, named == flagged ? ")" : ",");
	}
}

static void write_flags(const struct report *report, FILE *out)
{
	for (unsigned flags = report_flags(report); flags; flags &= flags - 1) {
		unsigned flag = flags & ~(flags - 1);
		int column = fprintf(out, "  %s: %s", record_flag_name(flag), report_flag_words(flag));

		write_flagged(report, flag, column, out);
		fputc('\n', out);
	}
}

static void write_head(const struct report *report, FILE *out)
{
	const struct record *r = report->record;
	char verdict[160], tower[400];

	fprintf(out, "%s (%s%s)", r->file, r->format, record_lacks_seal(r) ? ", not sealed" : "");
	if (r->is_drop)
		fprintf(out, ", drop %u", (unsigned)r->drop_id);
	if (r->log_number > 0)
		fprintf(out, ", number %u in the log", r->log_number);
	if (r->shock > 0)
		fprintf(out, ", shock %u of %u", r->shock, r->shocks);
	if (r->is_drop && isfinite(r->frame_speed_m_s))
		fprintf(out, ", frame %.3f m/s between the gates", r->frame_speed_m_s);
	fputc('\n', out);
	if (r->read_as[0] != '\0')
		fprintf(out, "read as %s\n", r->read_as);
	if (report->scene)
		fprintf(out, "%s, %g deg, from %g m\n",
		        report->scene->title[0] ? report->scene->title : report->scene->name,
		        report->scene->drop_angle_deg, report->scene->drop_height_m);
	(void)report_verdict(report, verdict, sizeof(verdict));
	fprintf(out, "%s\n", verdict);
	measured_text(r, tower, sizeof(tower));
	if (tower[0] != '\0') {
		(void)text_fill(out, fprintf(out, "tower:"), tower, "");
		fputc('\n', out);
	}
	write_flags(report, out);
}

static int name_width(const struct record *record)
{
	size_t width = 7;

	for (size_t i = 0; i < record->channel_count; i++)
		if (strlen(record->channels[i].name) > width)
			width = strlen(record->channels[i].name);
	return (int)width;
}

static void write_channels(const struct report *report, const struct report_zero *zero, FILE *out)
{
	int width = name_width(report->record);
	char video[96];

	fprintf(out, "\n%-*s %8s %9s %7s %9s %7s %9s %9s %8s  %s\n", width, "channel", "rate Hz", "peak g",
	        "+-", "at ms", "+- us", "width ms", "dv m/s", "noise g", "status");
	for (size_t i = 0; i < report->analysis->channel_count; i++) {
		const struct estimate_channel *e = &report->analysis->channels[i];
		char status[48];

		fprintf(out, "%-*s", width, report->record->channels[i].name);
		text_cell(out, 8, 1, report->record->channels[i].rate_hz);
		text_cell(out, 9, 2, e->peak.value_g);
		text_cell(out, 7, 2, e->peak.sigma_g);
		text_cell(out, 9, 3, (e->peak.time_s - zero->time_s) * 1e3);
		text_cell(out, 7, 1, e->peak.sigma_time_s * 1e6);
		text_cell(out, 9, 3, e->pulse.duration_s * 1e3);
		text_cell(out, 9, 3, e->pulse.velocity_change_m_s);
		text_cell(out, 8, 2, e->baseline.noise_g);
		fprintf(out, "  %s\n", report_channel_status(e, status, sizeof(status)));
	}
	for (size_t i = 0; i < report->analysis->resultant_count; i++) {
		const struct estimate_resultant *r = &report->analysis->resultants[i];
		char name[16];

		snprintf(name, sizeof(name), "%s XY", r->sensor);
		fprintf(out, "%-*s %8s", width, name, "");
		text_cell(out, 9, 2, r->peak_g);
		text_cell(out, 7, 2, r->sigma_g);
		text_cell(out, 9, 3, (r->time_s - zero->time_s) * 1e3);
		text_cell(out, 7, 1, r->sigma_time_s * 1e6);
		fprintf(out, "  %s", estimate_status_name(r->how.status));
		if (isfinite(r->axes_apart_s))
			fprintf(out,
			        r->axes_coincide ? ", X and Y peak together" : ", Y peaks %+.3f ms after X",
			        r->axes_apart_s * 1e3);
		fputc('\n', out);
	}
	fprintf(out, "Time 0: %s. Width at 10 %% of the peak; dv from foot to foot.%s\n", zero->name,
	        report->sensors == NULL ? " +- is noise only." : "");
	if (report_video(report, zero, video, sizeof(video)))
		fprintf(out, "%s.\n", video);
}

/* " 1.9026 +- 0.0012" */
static void with_sigma(FILE *out, int decimals, double value, double sigma)
{
	text_cell(out, 1, decimals, value);
	if (isfinite(sigma)) {
		fprintf(out, " +-");
		text_cell(out, 1, decimals, sigma);
	}
}

/* A value among the words that the table has around it; "?" in front: nothing without a value. */
static void write_quantity(const struct quantity *q, const void *object, FILE *out)
{
	bool optional = q->text[0] == '?';
	const char *before = q->text + optional, *behind = strchr(before, '%');
	double value = quantity_number(q, object), scale = quantity_scale(q);

	if (!behind || (optional && !isfinite(value)))
		return;
	fprintf(out, "%.*s", (int)(behind - before), before);
	with_sigma(out, q->digits, value * scale, quantity_sigma(q, object) * scale);
	fputs(behind + 1, out);
}

static void text_write_all(enum quantity_object which, const void *object, FILE *out)
{
	const struct quantity *q = NULL;

	while ((q = quantity_next(which, q)))
		write_quantity(q, object, out);
}

static void write_lag(const struct report *report, FILE *out)
{
	const struct estimate_lag *lag = &report->analysis->lag;

	fprintf(out, "S1 after S2:");
	if (report_driven(report))
		text_write_all(QUANTITY_DRIVEN, lag, out);
	text_write_all(QUANTITY_LAG, lag, out);
	fprintf(out, "  %s\n", estimate_status_name(lag->status));
}

static void write_joint(const struct report *report, FILE *out)
{
	const struct analysis *a = report->analysis;

	if (a->has_lag || a->has_plate || a->has_rebound || a->has_motion)
		fputc('\n', out);
	if (a->has_lag)
		write_lag(report, out);
	if (a->has_plate) {
		fprintf(out, "plate:");
		text_write_all(QUANTITY_RINGDOWN, &a->plate, out);
		fprintf(out, "  (%s) %s\n", a->plate.how.method, estimate_status_name(a->plate.how.status));
	}
	if (a->has_rebound) {
		fprintf(out, "rebound:");
		text_write_all(QUANTITY_REBOUND, &a->rebound, out);
		fprintf(out, "  %s\n", estimate_status_name(a->rebound.status));
	}
	if (a->has_motion && a->motion.status == ESTIMATE_OK) {
		fprintf(out, "fitted body:");
		text_write_all(QUANTITY_MOTION, &a->motion, out);
		fputs("  ok\n", out);
	} else if (a->has_motion) {
		(void)text_fill(out, fprintf(out, "fitted body: refused,"), a->motion.refused, "");
		fputc('\n', out);
	}
}

/* "note: S1X peak, S2X peak: clipped; ..." for each flag. */
static void write_notes(const struct report *report, FILE *out)
{
	struct report_note notes[REPORT_NOTES_MAX];
	size_t count = report_notes(report, notes);
	int column = 0;

	for (size_t i = 0; i < count; i++) {
		bool first = i == 0 || notes[i].flag != notes[i - 1].flag;
		bool last = i + 1 == count || notes[i].flag != notes[i + 1].flag;

		if (first)
			column = fprintf(out, "note:");
		column = text_fill(out, column, notes[i].of, last ? ":" : ",");
		if (!last)
			continue;
		text_fill(out, column, report_note_words(notes[i].flag), "");
		fputc('\n', out);
	}
}

static void text_write_model(const struct report *report, FILE *out)
{
	struct report_row rows[REPORT_ROWS_MAX];
	size_t count = report_compare(report, rows);
	bool compared = false;
	int column;

	if (!count)
		return;
	fprintf(out, "\n%-20s %10s %10s %8s %12s\n", "model against drop", "model", "measured", "+-",
	        "difference");
	for (size_t i = 0; i < count; i++) {
		compared |= isfinite(rows[i].measured);
		fprintf(out, "%-17s %2s", rows[i].label, rows[i].unit);
		text_cell(out, 10, rows[i].decimals, rows[i].predicted * rows[i].scale);
		text_cell(out, 10, rows[i].decimals, rows[i].measured * rows[i].scale);
		text_cell(out, 8, rows[i].decimals, rows[i].sigma * rows[i].scale);
		if (isfinite(rows[i].difference_percent))
			fprintf(out, " %+10.1f %%", rows[i].difference_percent);
		else
			fprintf(out, " %10s", "-");
		if (isfinite(rows[i].predicted_u))
			fprintf(out, "  %s%smodel +- %.*f", rows[i].verdict, rows[i].verdict[0] ? ", " : "",
			        rows[i].decimals, rows[i].predicted_u * rows[i].scale);
		fputc('\n', out);
	}
	if (!compared)
		fputs("Nothing to compare: the model speaks of S1 and S2 of the tower, which has not "
		      "recorded this.\n",
		      out);
	column = fprintf(out, "Model %s,", report->prediction->fidelity);
	text_fill(out, column, report->prediction->reason, ".");
	fputc('\n', out);
}

static void text_write_verdict(const struct verdict *verdict, FILE *out)
{
	int column;

	if (verdict == NULL)
		return;
	fprintf(out, "\nlimits%s%s: ", verdict->by[0] != '\0' ? " of " : "", verdict->by);
	verdict_line(verdict, out);
	fputc('\n', out);
	(void)verdict_table(verdict, TABLE_TEXT, out);
	column = fprintf(out, "Rule:");
	column = text_fill(out, column, verdict->rule, ".");
	column = text_fill(out, column, "Uncertainty:", "");
	column = text_fill(out, column, verdict->rests_on, ".");
	if (!verdict->verified)
		(void)text_fill(out, column, VERDICT_UNVERIFIED, ".");
	fputc('\n', out);
}

/* What the table above shows; decays of single channels and instants are in JSON. */
static bool is_shown(const struct budget_item *item)
{
	return strstr(item->what, ".ringdown.") == NULL && strstr(item->what, ".contact.") == NULL &&
	       strstr(item->what, "natural") == NULL;
}

static void text_write_chain(const struct report *report, FILE *out)
{
	struct budget_item *shown;
	size_t count = 0;

	if (report->sensors == NULL)
		return;
	fputc('\n', out);
	for (size_t i = 0; i < report->sensors->count; i++) {
		const struct sensor_used *s = &report->sensors->used[i];

		fprintf(out, "sensor %s: %s, certificate %s of %s, due %s%s\n", s->name, s->serial,
		        s->certificate, s->date, s->due, s->overdue ? ": OVERDUE" : "");
	}
	shown = calloc(report->budget->count + 1, sizeof(*shown));
	for (size_t i = 0; shown != NULL && i < report->budget->count; i++)
		if (is_shown(&report->budget->item[i]))
			shown[count++] = report->budget->item[i];
	(void)uncertainty_table(shown, count, TABLE_TEXT, out);
	free(shown);
	fputs("U = k u covers 95.45 %; +- above is one standard uncertainty of noise and fit.\n", out);
	if (report->record->time_s == 0)
		fputs("The record tells no day: its certificates are held against that of its file.\n", out);
}

static void text_write_frames(const struct record *r, FILE *out)
{
	const struct record_counters *c = &r->counters;

	if (!(c->repeated | c->reordered | c->corrupt | c->gaps | c->resent | c->conflicting) &&
	    !r->gap_count)
		return;
	fprintf(out,
	        "\nframes: %" PRIu64 " block%s held, %" PRIu64 " gap%s, %" PRIu64 " resent, %" PRIu64
	        " repeated, "
	        "%" PRIu64 " reordered, %" PRIu64 " corrupt, %" PRIu64 " conflicting\n",
	        c->blocks, report_plural(c->blocks), c->gaps, report_plural(c->gaps), c->resent, c->repeated,
	        c->reordered, c->corrupt, c->conflicting);
	for (size_t i = 0; i < r->gap_count && i < TEXT_GAPS_MAX; i++) {
		fprintf(out, "  missing: S%u tick %" PRIu32, r->gaps[i].sensor, r->gaps[i].first_tick_ms);
		if (r->gaps[i].last_tick_ms != r->gaps[i].first_tick_ms)
			fprintf(out, " to %" PRIu32, r->gaps[i].last_tick_ms);
		fputc('\n', out);
	}
	if (r->gap_count > TEXT_GAPS_MAX)
		fprintf(out, "  and %zu more, all listed by --json\n", r->gap_count - TEXT_GAPS_MAX);
}

int report_text(const struct report *report, FILE *out)
{
	struct report_zero zero = report_zero(report);
	char processing[160];

	write_head(report, out);
	if (report_processing(report, processing, sizeof(processing)))
		fprintf(out, "processing: %s\n", processing);
	write_channels(report, &zero, out);
	write_joint(report, out);
	write_notes(report, out);
	text_write_chain(report, out);
	text_write_model(report, out);
	text_write_verdict(report->verdict, out);
	shock_write(report, zero.time_s, out);
	text_write_frames(report->record, out);
	return fflush(out) != 0 || ferror(out) ? DT_E_SYSTEM : 0;
}
