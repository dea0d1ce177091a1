/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/report/spectrum.h"

#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/base/text.h"
#include "host/report/picture.h"
#include "host/base/put.h"
#include "host/shock/signal.h"

static const char *const quantity_words[SRS_QUANTITIES] = {"absolute acceleration", "pseudo velocity",
                                                           "relative displacement"};
static const char *const unit_words[SRS_QUANTITIES] = {"g", "m/s", "m"};

static const double *curve(const struct spectrum_report *report, size_t channel)
{
	return report->spectrum->channel[channel].side[report->options->side];
}

static int finished(FILE *out)
{
	return fflush(out) != 0 || ferror(out) ? DT_E_SYSTEM : 0;
}

/* ---- text ---- */

static void write_verdict(const struct spectrum_report *report, const struct spectrum_channel *c, FILE *out)
{
	if (report->options->limit && !(c->flags & SIGNAL_REFUSED)) {
		fprintf(out, "%s: %s", c->name, c->verdict.pass ? "pass" : "FAIL");
		if (c->verdict.checked == 0)
			fprintf(out, ", the limit speaks of none of these frequencies");
		else
			fprintf(out, ", %s %.2f dB at %.2f Hz",
			        c->verdict.margin < 0 ? "worst above by" : "nearest below by",
			        fabs(c->verdict.margin), c->verdict.margin_x);
		if (isfinite(c->verdict.first_x))
			fprintf(out, ", first above at %.2f Hz", c->verdict.first_x);
		fputc('\n', out);
	}
	for (unsigned flags = c->data_flags; flags; flags &= flags - 1)
		fprintf(out, "%s: %s\n", c->name, record_flag_name(flags));
	for (unsigned flags = c->flags; flags; flags &= flags - 1)
		fprintf(out, "%s: %s\n", c->name, signal_flag_name(flags));
}

int spectrum_text(const struct spectrum_report *report, FILE *out)
{
	const struct spectrum_options *o = report->options;
	const struct spectrum *s = report->spectrum;

	fprintf(out, "%s\nShock response spectrum: %s, %s, %s, damping ratio %g\n\n%10s", report->file,
	        quantity_words[o->srs.quantity], srs_side_names[o->side], srs_part_names[o->part],
	        o->srs.damping, "Hz");
	for (size_t c = 0; c < s->channel_count; c++) {
		char head[48];

		snprintf(head, sizeof(head), "%s %s", s->channel[c].name, unit_words[o->srs.quantity]);
		fprintf(out, " %12s", head);
	}
	fputc('\n', out);
	for (size_t i = 0; i < s->count; i++) {
		fprintf(out, "%10.2f", s->frequency_hz[i]);
		for (size_t c = 0; c < s->channel_count; c++) {
			if (isfinite(curve(report, c)[i]))
				fprintf(out, " %12.5g", curve(report, c)[i]);
			else
				fprintf(out, " %12s", "-");
		}
		fputc('\n', out);
	}
	fputc('\n', out);
	for (size_t c = 0; c < s->channel_count; c++)
		write_verdict(report, &s->channel[c], out);
	return finished(out);
}

/* ---- JSON ---- */

static void put_curve(struct builder *b, cJSON *item, const char *name, const char *unit, const double *value,
                      size_t count)
{
	char key[48];

	snprintf(key, sizeof(key), "%s_%s", name, unit);
	put_numbers(b, item, key, value, count);
}

static void put_limit(struct builder *b, cJSON *item, const struct spectrum_report *report,
                      const struct limit_verdict *verdict)
{
	cJSON *limit;

	if (!report->options->limit) {
		put_item(b, item, "limit", cJSON_CreateNull());
		return;
	}
	limit = put_object(b, item, "limit");
	put_bool(b, limit, "pass", verdict->pass);
	put_number(b, limit, "margin_db", verdict->margin);
	put_number(b, limit, "margin_frequency_hz", verdict->margin_x);
	put_number(b, limit, "first_fail_frequency_hz", verdict->first_x);
	put_number(b, limit, "checked_frequencies", (double)verdict->checked);
}

static void spectrum_put_channel(struct builder *b, cJSON *array, const struct spectrum_report *report,
                                 const struct spectrum_channel *c)
{
	const struct spectrum *s = report->spectrum;
	const char *unit = srs_quantity_units[report->options->srs.quantity];
	cJSON *item = put_append(b, array);

	put_text(b, item, "name", c->name);
	put_number(b, item, "rate_hz", c->rate_hz);
	put_more_flags(b, put_flags(b, item, c->data_flags, record_flag_name), c->flags, signal_flag_name);
	put_number(b, item, "offset_g", c->offset_g);
	put_number(b, item, "bridged_samples", (double)c->bridged);
	put_numbers(b, item, "frequency_hz", s->frequency_hz, s->count);
	for (unsigned side = 0; side < SRS_SIDES; side++)
		put_curve(b, item, srs_side_names[side], unit, c->side[side], s->count);
	put_curve(b, item, "primary_maximax", unit, c->maximax[0], s->count);
	put_curve(b, item, "residual_maximax", unit, c->maximax[1], s->count);
	put_limit(b, item, report, &c->verdict);
}

int spectrum_json(const struct spectrum_report *report, FILE *out)
{
	const struct spectrum_options *o = report->options;
	cJSON *root = cJSON_CreateObject(), *channels;
	struct builder b = {.failed = !root};

	put_text(&b, root, "file", report->file);
	if (report->shock > 0) {
		cJSON *shock = put_object(&b, root, "shock");

		put_number(&b, shock, "number", report->shock);
		put_number(&b, shock, "of", report->shocks);
	}
	put_text(&b, root, "quantity", srs_quantity_names[o->srs.quantity]);
	put_text(&b, root, "side", srs_side_names[o->side]);
	put_text(&b, root, "part", srs_part_names[o->part]);
	put_number(&b, root, "q", o->srs.damping > 0 ? 0.5 / o->srs.damping : (double)INFINITY);
	put_number(&b, root, "damping_ratio", o->srs.damping);
	put_number(&b, root, "per_octave", o->frequency_hz != NULL ? NAN : o->per_octave);
	put_bool(&b, root, "upsampled", !o->srs.keep_rate);
	if (o->limit)
		put_bool(&b, root, "pass", spectrum_passes(report->spectrum));
	else
		put_item(&b, root, "pass", cJSON_CreateNull());
	channels = put_array(&b, root, "channels");
	for (size_t c = 0; c < report->spectrum->channel_count; c++)
		spectrum_put_channel(&b, channels, report, &report->spectrum->channel[c]);
	return put_out(&b, root, out);
}

/* ---- CSV ---- */

/* A name as a cell: quoted where it has to be (RFC 4180). */
static void write_name(const char *name, const char *unit, FILE *out)
{
	bool quote = strpbrk(name, ",;\"\n\r") != NULL;

	fputs(quote ? ",\"" : ",", out);
	for (; *name; name++) {
		if (*name == '"')
			fputc('"', out);
		fputc(*name, out);
	}
	fprintf(out, "_%s%s", unit, quote ? "\"" : "");
}

int spectrum_csv(const struct spectrum_report *report, FILE *out)
{
	const struct spectrum *s = report->spectrum;

	fputs("frequency_hz", out);
	for (size_t c = 0; c < s->channel_count; c++)
		write_name(s->channel[c].name, srs_quantity_units[report->options->srs.quantity], out);
	fputc('\n', out);
	for (size_t i = 0; i < s->count; i++) {
		fprintf(out, "%.10g", s->frequency_hz[i]);
		for (size_t c = 0; c < s->channel_count; c++) {
			if (isfinite(curve(report, c)[i]))
				fprintf(out, ",%.10g", curve(report, c)[i]);
			else
				fputc(',', out);
		}
		fputc('\n', out);
	}
	return finished(out);
}

/* ---- picture ---- */

/* Letters and digits alone: nothing of a name can act in a script. */
static void write_title(const char *name, FILE *script)
{
	fputs(" title \"", script);
	for (; *name; name++)
		fputc(isalnum((unsigned char)*name) ? *name : ' ', script);
	fputc('"', script);
}

static void write_block(const char *name, size_t number, const double *x, const double *y, size_t count,
                        FILE *script)
{
	fprintf(script, "$%s%zu << EOD\n", name, number);
	for (size_t i = 0; i < count; i++)
		if (y[i] > 0)
			fprintf(script, "%.8g %.8g\n", x[i], y[i]);
		else
			fputc('\n', script);
	fputs("EOD\n", script);
}

static bool drawable(const struct spectrum_report *report, size_t channel)
{
	for (size_t i = 0; i < report->spectrum->count; i++)
		if (curve(report, channel)[i] > 0)
			return true;
	return false;
}

static void write_script(const struct spectrum_report *report, FILE *script)
{
	const struct spectrum_options *o = report->options;
	const struct spectrum *s = report->spectrum;

	fprintf(script,
	        "set terminal svg size 900,560 font 'sans-serif,13'\n"
	        "set logscale xy\nset grid xtics ytics mxtics mytics linecolor rgb '#CCCCCC'\n"
	        "set key top left\nset xlabel 'natural frequency, Hz'\nset ylabel '%s, %s'\n"
	        "set title 'Shock response spectrum, %s, %s, damping ratio %g'\n",
	        quantity_words[o->srs.quantity], unit_words[o->srs.quantity], srs_side_names[o->side],
	        srs_part_names[o->part], o->srs.damping);
	for (size_t c = 0; c < s->channel_count; c++)
		if (drawable(report, c))
			write_block("c", c, s->frequency_hz, curve(report, c), s->count, script);
	if (o->limit) {
		fputs("$limit << EOD\n", script);
		for (size_t i = 0; i < o->limit->count; i++)
			fprintf(script, "%.8g %.8g\n", o->limit->point[i].x, o->limit->point[i].upper);
		fputs("EOD\n", script);
	}
	fprintf(script, "set xrange [%.8g:%.8g]\nplot NaN notitle", s->frequency_hz[0],
	        s->frequency_hz[s->count - 1] * (s->count > 1 ? 1 : 2));
	for (size_t c = 0; c < s->channel_count; c++) {
		if (!drawable(report, c))
			continue;
		fprintf(script, ", $c%zu with lines linewidth 2", c);
		write_title(s->channel[c].name, script);
	}
	if (o->limit)
		fputs(", $limit with lines linewidth 2 dashtype (8,4) linecolor rgb 'black' title 'limit'",
		      script);
	fputc('\n', script);
}

int spectrum_svg(const struct spectrum_report *report, FILE *out, char *message, size_t size)
{
	struct text script;
	char *svg = NULL;
	int result = text_open(&script);

	if (result == 0) {
		write_script(report, script.out);
		result = text_close(&script, 0);
	}
	if (result == 0)
		result = picture_draw(script.bytes, script.size, &svg, message, size);
	else
		snprintf(message, size, "%s", error_text(result));
	if (result == 0) {
		fputs(svg, out);
		result = finished(out);
	}
	free(svg);
	free(script.bytes);
	return result;
}
