/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "host/report/series_private.h"

/* Beside page_style: what only this page has, and how it goes on paper. */
static const char style[] =
        "tr.out td{color:var(--soft);text-decoration:line-through}tr.out td.text{text-decoration:none}"
        "tr.mean td{font-weight:600}tr.mean.first td{border-top:2px solid var(--soft)}"
        "td.wrap{white-space:normal;min-width:14em;overflow-wrap:anywhere}td{vertical-align:top}th{white-"
        "space:normal;vertical-align:bottom}"
        ".facts{table-layout:fixed}.facts th{font-weight:400;width:38%;vertical-align:top}"
        ".facts td{text-align:left;white-space:normal}"
        ".hash{font:.8rem/1.4 ui-monospace,'Liberation Mono',monospace;overflow-wrap:anywhere}"
        ".scroll+.scroll{margin-top:14px}.drop{break-inside:avoid;margin:22px 0 0}"
        ".drop h3{font-size:1rem;margin:0 0 4px;font-weight:600}"
        ".drop h3 span{font-weight:400;color:var(--soft)}"
        ".photos{display:flex;flex-wrap:wrap;gap:8px 16px;margin:8px 0 0}.photos img{display:block;max-width:"
        "100%;max-height:420px}"
        ".drop.out{border-left:5px solid var(--bad);padding-left:12px}"
        "@media print{.screen{display:none}body{font-size:9.5pt;line-height:1.4}h1{font-size:15pt}"
        "h2{font-size:11.5pt;margin:18px 0 4px}.verdict{margin:6px 0 2px}"
        ".cards{gap:6px;grid-template-columns:repeat(5,1fr)}.card{padding:6px 8px}"
        ".card .value{font-size:13pt}.label,.note,.legend,figcaption,footer{font-size:8pt}"
        "table{font-size:8pt;break-inside:avoid}th,td{padding:2px 5px}tr{break-inside:avoid}"
        "tr.mean{break-before:avoid}thead{display:table-header-group}.hash{font-size:7pt}"
        ".scroll{overflow:visible}.scroll svg{min-width:0}.grid{gap:6px 14px}"
        ".drop{margin-top:10px}.drop h3{font-size:9.5pt}.keep{break-inside:avoid}"
        ".photos img{max-width:86mm;max-height:64mm}}";

static void write_style(struct series_page *page, FILE *out)
{
	fputs(style, out);
	fputs("@page{size:A4;margin:19mm 14mm 17mm;@top-left{content:\"Drop series ", out);
	fputc(HTML_OWN, out);
	for (const char *s = page->series.name; *s;
	     s++) /* within a CSS string nothing but a name's letters */
		fputc(strchr("._-", *s) || (*s >= '0' && *s <= '9') || (*s >= 'A' && *s <= 'Z') ||
		                      (*s >= 'a' && *s <= 'z')
		              ? *s
		              : '?',
		      out);
	fputc(HTML_OWN_END, out);
	fputs("\"}@bottom-right{content:\"page \" counter(page) \" of \" counter(pages)}"
	      "@top-left{font:8pt sans-serif;color:#56606b}@bottom-right{font:8pt sans-serif;color:#56606b}}",
	      out);
}

/* ---- the verdict ---- */

static size_t decided(const struct series_page *page, const char *decision)
{
	size_t count = 0;

	for (size_t i = 0; i < page->count; i++)
		count += !strcmp(page->drop[i]->a.decision, decision) && page->drop[i]->a.sha256[0];
	return count;
}

static size_t faulty(const struct series_page *page)
{
	size_t count = 0;

	for (size_t i = 0; i < page->count; i++)
		count += archive_is_faulty(&page->drop[i]->a);
	return count;
}

static size_t unfinished(const struct series_page *page)
{
	size_t count = 0;

	for (size_t i = 0; i < page->count; i++)
		count += !page->drop[i]->a.sha256[0];
	return count;
}

static bool all_whole(const struct series_page *page)
{
	for (size_t i = 0; i < page->count; i++)
		if (page->drop[i]->counts && !series_is_whole(page->drop[i]))
			return false;
	return true;
}

static bool any_remark(const struct series_page *page)
{
	for (size_t i = 0; i < page->count; i++)
		if (page->drop[i]->counts && page->drop[i]->a.flags[0])
			return true;
	return false;
}

/* One line, and whether all is as it should be. */
static bool verdict(const struct series_page *page, char line[240])
{
	size_t counted = series_counted(page), rejected = decided(page, "rejected");
	unsigned planned = page->series.planned;
	size_t partial = unfinished(page), wrong = faulty(page);
	char more[140] = "";

	if (rejected)
		snprintf(more, sizeof(more), "; %zu rejected and in no mean", rejected);
	if (partial)
		snprintf(more + strlen(more), sizeof(more) - strlen(more), "; %zu never finished", partial);
	if (wrong)
		snprintf(more + strlen(more), sizeof(more) - strlen(more),
		         "; %zu altered or missing and in no mean", wrong);
	if (!page->count)
		snprintf(line, 240, "EMPTY: no drop yet of %u planned", planned);
	else if (!counted)
		snprintf(line, 240, "NO RESULT: none of %zu drops is accepted, so there is no mean%s",
		         page->count, more);
	else if (counted < planned)
		snprintf(line, 240, "SHORT: %zu of %u planned drops count%s", counted, planned, more);
	else if (!all_whole(page))
		snprintf(line, 240, "UNPROVEN: %zu drops count, but not every one has its log and result%s",
		         counted, more);
	else if (any_remark(page))
		snprintf(line, 240, "COMPLETE, WITH REMARKS: %zu drops count, %u were planned%s", counted,
		         planned, more);
	else
		snprintf(line, 240, "complete: %zu drops count, %u were planned%s", counted, planned, more);
	return counted && counted >= planned && !wrong && all_whole(page) && !any_remark(page);
}

/* What is known of it: of drops whose origin nobody noted nothing is said. */
static void simulated(const struct series_page *page)
{
	FILE *out = page->page.out;
	size_t count = 0, named = 0;

	for (size_t i = 0; i < page->count; i++)
		count += page->drop[i]->a.simulated;
	if (!count)
		return;
	fputs("<p><b>Simulated tower: no product fell", out);
	for (size_t i = 0; i < page->count && count < page->count; i++)
		if (page->drop[i]->a.simulated)
			fprintf(out, "%s %u",
			        named++     ? ","
			        : count > 1 ? " in drops"
			                    : " in drop",
			        page->drop[i]->a.number);
	fputs(".</b></p>\n", out);
}

/* ---- the means that matter most ---- */

static void card(struct series_page *page, const char *label, enum archive_value value, double scale,
                 int decimals, const char *unit)
{
	const struct archive_mean *m = &page->cell.value[value];
	char note[80];

	if (!page->cell.drops || !m->n)
		return;
	page_begin_card(page->page.out, label);
	html_number(page->page.out, decimals, m->mean * scale);
	if (m->n > 1)
		snprintf(note, sizeof(note), "SD %.*f, %u drops%s", decimals, m->sd * scale, m->n,
		         m->not_ok ? ", see remarks" : "");
	else
		snprintf(note, sizeof(note), "one drop");
	page_end_card(page->page.out, unit, note);
}

static void series_head_cards(struct series_page *page)
{
	fputs("<div class=\"cards\">", page->page.out);
	card(page, "S1, resultant peak, mean", ARCHIVE_S1_R, 1.0, 1, "g");
	card(page, "S2, resultant peak, mean", ARCHIVE_S2_R, 1.0, 1, "g");
	card(page, "S1 after S2, mean", ARCHIVE_LAG, 1e3, 3, "ms");
	card(page, "Plate frequency, damped", ARCHIVE_FREQUENCY, 1.0, 2, "Hz");
	card(page, "Plate damping ratio", ARCHIVE_DAMPING, 1.0, 4, "");
	fputs("</div>\n", page->page.out);
}

void series_head(struct series_page *page)
{
	FILE *out = page->page.out;
	const struct scene *scene = &page->scene;
	struct text more;
	char line[240];
	bool good = verdict(page, line);

	page->page.error = text_open(&more);
	if (page->page.error)
		return;
	write_style(page, more.out);
	page->page.error = text_close(&more, 0);
	if (page->page.error)
		return;
	page_begin(out, scene->title[0] ? scene->title : scene->name, more.bytes);
	free(more.bytes);
	fputs("<p>Drop series <b>", out);
	html_own(out, page->series.name);
	fprintf(out, "</b>: dropped from %g m at %g&deg;. <span class=\"soft\">Campaign ",
	        scene->drop_height_m, scene->drop_angle_deg);
	html_own(out, page->series.campaign);
	fprintf(out, "</span></p>\n<div class=\"verdict %s\">%s %s</div>\n", good ? "good" : "bad",
	        good ? "&#10003;" : "&#9888;", line);
	simulated(page);
	series_head_cards(page);
}

/* ---- what and how ---- */

static void begin_fact(FILE *out, const char *label)
{
	fprintf(out, "<tr><th>%s</th><td>", label);
}

static void end_fact(FILE *out)
{
	fputs("</td></tr>\n", out);
}

static void subject_product(const struct series_page *page)
{
	const struct scene *s = &page->scene;
	FILE *out = page->page.out;
	bool plate = s->mount_plate_mass_kg > 0.0;

	fputs("<div><table class=\"facts\">", out);
	begin_fact(out, "geometry");
	html_own(out, s->name);
	end_fact(out);
	begin_fact(out, "outside");
	fprintf(out, "%g &times; %g &times; %g mm", s->product_length_m * 1e3, s->product_width_m * 1e3,
	        s->product_thickness_m * 1e3);
	end_fact(out);
	begin_fact(out, "mass");
	fprintf(out, "%g g", (s->product_case_mass_kg + s->mount_plate_mass_kg) * 1e3);
	if (plate)
		fprintf(out, ": box %g g, plate inside %g g", s->product_case_mass_kg * 1e3,
		        s->mount_plate_mass_kg * 1e3);
	end_fact(out);
	begin_fact(out, "mount");
	if (!plate)
		fputs("none: both sensors sit on the box", out);
	else
		fprintf(out, "%g N/m, damping ratio %g", s->mount_stiffness_n_m, s->mount_damping_ratio);
	if (plate && s->mount_cube_m > 0.0)
		fprintf(out, ", rubber cubes of %g mm", s->mount_cube_m * 1e3);
	end_fact(out);
	begin_fact(out, "S1");
	fputs(plate ? "on the plate" : "on the box", out);
	end_fact(out);
	begin_fact(out, "S2");
	fprintf(out, "on the box, %g mm along X from its centre of gravity", s->sensor_s2_offset_m * 1e3);
	end_fact(out);
	begin_fact(out, "sensors");
	fprintf(out, "range %g g, noise %g g", s->sensor_range_g, s->sensor_noise_g);
	end_fact(out);
	begin_fact(out, "struck");
	fprintf(out, "a mat of %g mm, with a corner at %g&deg; between the vertical and X",
	        s->contact_mat_thickness_m * 1e3, s->drop_angle_deg);
	end_fact(out);
	fputs("</table></div>\n", out);
}

/* The first drop whose log or result tells how it was sampled. */
static const struct series_drop *sampled(const struct series_page *page)
{
	for (size_t i = 0; i < page->count; i++)
		if (page->drop[i]->counts && page->drop[i]->record.channel_count)
			return page->drop[i];
	return NULL;
}

static bool same_rate(const struct channel *a, const struct channel *b)
{
	return fabs(a->rate_hz - b->rate_hz) < 1e-9 * a->rate_hz;
}

static void fact_sampling(FILE *out, const struct series_drop *drop)
{
	const struct record *r = &drop->record;

	begin_fact(out, "sampling");
	for (size_t i = 0; i < r->channel_count; i++) {
		size_t before = 0, named = 0;

		while (before < i && !same_rate(&r->channels[before], &r->channels[i]))
			before++;
		if (before < i)
			continue;
		fprintf(out, "%s%g Hz: ", i ? "; " : "", r->channels[i].rate_hz);
		for (size_t k = i; k < r->channel_count; k++) {
			if (!same_rate(&r->channels[i], &r->channels[k]))
				continue;
			fputs(named++ ? ", " : "", out);
			page_channel_name(out, r->channels[k].name);
		}
	}
	end_fact(out);
	if (!r->is_drop)
		return;
	begin_fact(out, "captured");
	fprintf(out, "%u ms", (unsigned)(r->last_tick_ms - r->first_tick_ms + 1));
	if (isfinite(r->trigger_s))
		fprintf(out, ", of them %.0f ms before the trigger", r->trigger_s * 1e3);
	end_fact(out);
}

static void fact_processing(FILE *out, const struct series_drop *drop)
{
	if (!(drop->options.iepe_time_constant_s > 0.0))
		return;
	begin_fact(out, "processing");
	fprintf(out, "sensor high-pass of %g s undone", drop->options.iepe_time_constant_s);
	end_fact(out);
}

static void fact_frame(const struct series_page *page)
{
	double low = (double)INFINITY, high = 0.0;
	FILE *out = page->page.out;

	for (size_t i = 0; i < page->count; i++)
		if (page->drop[i]->counts && isfinite(page->drop[i]->record.frame_speed_m_s)) {
			low = fmin(low, page->drop[i]->record.frame_speed_m_s);
			high = fmax(high, page->drop[i]->record.frame_speed_m_s);
		}
	if (!(high > 0.0))
		return;
	begin_fact(out, "frame between the gates");
	fprintf(out, high > low ? "%.3f to %.3f m/s" : "%.3f m/s", low, high);
	end_fact(out);
}

/* Every name once, in the order of the drops. */
static void fact_operators(const struct series_page *page)
{
	FILE *out = page->page.out;
	size_t named = 0;

	begin_fact(out, "operator");
	for (size_t i = 0; i < page->count; i++) {
		const char *name = page->drop[i]->a.operator_name;
		size_t before = 0;

		while (before < i && strcmp(page->drop[before]->a.operator_name, name))
			before++;
		if (before < i || !name[0])
			continue;
		fputs(named++ ? ", " : "", out);
		html_own(out, name);
	}
	fputs(named ? "" : "&ndash;", out);
	end_fact(out);
}

void series_time(FILE *out, const char *time)
{
	char text[32];

	if (strlen(time) < 16) {
		fputs("&ndash;", out);
		return;
	}
	snprintf(text, sizeof(text), "%.10s %.5s", time, time + 11);
	html_text(out, text);
}

static void fact_when(const struct series_page *page)
{
	FILE *out = page->page.out;
	const char *first = page->count ? page->drop[0]->a.time : "";
	const char *last = page->count ? page->drop[page->count - 1]->a.time : "";

	begin_fact(out, "when (UTC)");
	series_time(out, first);
	if (strncmp(first, last, 16)) {
		fputs(" to ", out);
		series_time(out, last);
	}
	end_fact(out);
}

static void subject_method(const struct series_page *page)
{
	const struct series_drop *drop = sampled(page);
	FILE *out = page->page.out;

	fputs("<div><table class=\"facts\">", out);
	begin_fact(out, "method");
	fputs("the product is held to a guided frame, let go of just before the frame meets its dampers, and "
	      "strikes in free fall",
	      out);
	end_fact(out);
	begin_fact(out, "height, angle");
	fprintf(out, "%g m, %g&deg;", page->scene.drop_height_m, page->scene.drop_angle_deg);
	end_fact(out);
	fact_frame(page);
	if (drop) {
		fact_sampling(out, drop);
		fact_processing(out, drop);
	}
	fact_operators(page);
	fact_when(page);
	begin_fact(out, "drops");
	fprintf(out, "%u planned, %zu made, %zu count%s", page->series.planned, page->count,
	        series_counted(page), page->request->undecided ? " (undecided ones, too)" : "");
	end_fact(out);
	fputs("</table></div>\n", out);
}

void series_subject(struct series_page *page)
{
	fputs("<h2>What was dropped, and how</h2>\n<div class=\"grid\">", page->page.out);
	subject_product(page);
	subject_method(page);
	fputs("</div>\n", page->page.out);
}
