/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/report/shock.h"

#include <math.h>

static void put_events(struct builder *b, cJSON *root, const struct events *events)
{
	cJSON *array = put_array(b, root, "events");

	for (size_t i = 0; events && i < events->count; i++) {
		const struct event *e = &events->event[i];
		cJSON *item = put_append(b, array);

		put_text(b, item, e->sensor ? "sensor" : "channel", e->name);
		put_number(b, item, "time_s", e->time_s);
		put_number(b, item, "peak_g", e->peak_g);
		put_number(b, item, "duration_s", e->duration_s);
		put_number(b, item, "velocity_change_m_s", e->velocity_change_m_s);
	}
}

static void put_falls(struct builder *b, cJSON *root, const struct free_falls *falls)
{
	cJSON *array = put_array(b, root, "free_falls");

	for (size_t i = 0; falls && i < falls->count; i++) {
		const struct free_fall *f = &falls->fall[i];
		cJSON *item = put_append(b, array);

		put_text(b, item, f->sensor ? "sensor" : "channel", f->name);
		put_number(b, item, "start_s", f->start_s);
		put_number(b, item, "end_s", f->end_s);
		put_number(b, item, "duration_s", f->duration_s);
		put_number(b, item, "sigma_duration_s", f->sigma_duration_s);
		put_number(b, item, "height_m", f->height_m);
		put_number(b, item, "sigma_height_m", f->sigma_height_m);
	}
}

static void put_band(struct builder *b, cJSON *root, const struct band *band)
{
	cJSON *item;

	if (!band) {
		put_item(b, root, "band", cJSON_CreateNull());
		return;
	}
	item = put_object(b, root, "band");
	put_text(b, item, "channel", band->channel);
	put_text(b, item, "aligned", band->at_peak ? "peak" : "start");
	put_number(b, item, "zero_s", band->zero_s);
	put_bool(b, item, "pass", band->verdict.pass);
	put_number(b, item, "margin_g", band->verdict.margin);
	put_number(b, item, "margin_time_s", band->verdict.margin_x);
	put_number(b, item, "first_fail_time_s", band->verdict.first_x);
	put_number(b, item, "checked_samples", (double)band->verdict.checked);
	put_number(b, item, "missing_samples", (double)band->verdict.missing);
}

void shock_put(struct builder *b, cJSON *root, const struct report *report)
{
	put_events(b, root, report->events);
	put_falls(b, root, report->falls);
	put_band(b, root, report->band);
}

void shock_write_band(const struct band *band, FILE *out)
{
	const struct limit_verdict *v = &band->verdict;

	fprintf(out, "band on %s, its time 0 at the pulse's %s: %s", band->channel,
	        band->at_peak ? "peak" : "10 % point", v->pass ? "pass" : "FAIL");
	if (v->checked > 0)
		fprintf(out, ", %s %.2f g at %.3f ms", v->margin < 0 ? "outside by" : "nearest",
		        fabs(v->margin), v->margin_x * 1e3);
	if (isfinite(v->first_x))
		fprintf(out, ", first outside at %.3f ms", v->first_x * 1e3);
	if (v->missing > 0)
		fprintf(out, ", %zu samples not there", v->missing);
	if (v->checked == 0)
		fprintf(out, ", no sample within the band's time");
}

static void write_events(const struct events *events, double zero_s, FILE *out)
{
	fprintf(out, "\n%zu shock%s, largest first", events->found, events->found == 1 ? "" : "s");
	if (events->found > events->count)
		fprintf(out, ", of which %zu", events->count);
	fputs(", of the samples as they are: neither filtered nor fitted\n", out);
	if (events->count > 0)
		fprintf(out, "%4s %-12s %12s %10s %9s %9s\n", "", "of", "at ms", "peak g", "width ms",
		        "dv m/s");
	for (size_t i = 0; i < events->count; i++) {
		const struct event *e = &events->event[i];

		fprintf(out, "%4zu %-12s %12.3f %10.2f %9.3f %9.3f\n", i + 1, e->name,
		        (e->time_s - zero_s) * 1e3, e->peak_g, e->duration_s * 1e3, e->velocity_change_m_s);
	}
}

static void write_falls(const struct free_falls *falls, double zero_s, FILE *out)
{
	fprintf(out, "\n%zu free fall%s\n", falls->count, falls->count == 1 ? "" : "s");
	for (size_t i = 0; i < falls->count; i++) {
		const struct free_fall *f = &falls->fall[i];

		fprintf(out, "%4zu %-12s %12.3f to %.3f ms: %.1f +- %.1f ms, from %.3f +- %.3f m\n", i + 1,
		        f->name, (f->start_s - zero_s) * 1e3, (f->end_s - zero_s) * 1e3, f->duration_s * 1e3,
		        f->sigma_duration_s * 1e3, f->height_m, f->sigma_height_m);
	}
}

void shock_write(const struct report *report, double zero_s, FILE *out)
{
	if (report->band) {
		fputc('\n', out);
		shock_write_band(report->band, out);
		fputc('\n', out);
	}
	if (!report->show_events)
		return;
	if (report->events)
		write_events(report->events, zero_s, out);
	if (report->falls)
		write_falls(report->falls, zero_s, out);
}
