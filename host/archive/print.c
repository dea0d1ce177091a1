/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/base/number.h"
#include "host/archive/print_private.h"

void print_key(char key[PRINT_KEY_MAX], enum archive_value value, const char *part)
{
	snprintf(key, PRINT_KEY_MAX, "%s_%s%s", archive_value_name(value), part, archive_value_unit(value));
}

int print_done(FILE *out)
{
	return fflush(out) == 0 && !ferror(out) ? 0 : DT_E_SYSTEM;
}

double print_ratio(const struct archive_mean *a, const struct archive_mean *b)
{
	return a->n > 0 && b->n > 0 && fabs(b->mean) > 0 ? a->mean / b->mean : (double)NAN;
}

void put_mean(struct builder *b, cJSON *object, const char *key, enum archive_value value,
              const struct archive_mean *mean)
{
	cJSON *item = put_object(b, object, key);
	char name[PRINT_KEY_MAX];

	snprintf(name, sizeof(name), "mean_%s", archive_value_unit(value));
	put_number(b, item, name, mean->mean);
	snprintf(name, sizeof(name), "sd_%s", archive_value_unit(value));
	put_number(b, item, name, mean->sd);
	put_number(b, item, "n", mean->n);
	put_number(b, item, "not_ok", mean->not_ok);
}

void csv_text(FILE *out, const char *text)
{
	if (strpbrk(text, ",\"\n") == NULL) {
		fprintf(out, "%s,", text);
		return;
	}
	fputc('"', out);
	for (; *text != '\0'; text++)
		fprintf(out, *text == '"' ? "\"\"" : "%c", *text);
	fputs("\",", out);
}

void csv_number(FILE *out, double value)
{
	char text[NUMBER_CHARS] = "";

	if (isfinite(value))
		number_format(text, value, 6);
	fprintf(out, "%s,", text);
}

void csv_mean(FILE *out, const struct archive_mean *mean)
{
	csv_number(out, mean->mean);
	csv_number(out, mean->sd);
	fprintf(out, "%u,", mean->n);
}

struct archive_filter print_begin(struct print *p, const struct archive_filter *filter)
{
	struct archive_filter wider = *filter;

	p->limit = filter->limit;
	if (p->limit != 0)
		wider.limit++;
	return wider;
}

bool print_is_full(struct print *p)
{
	p->more = p->limit != 0 && p->lines == p->limit;
	return p->more;
}

void print_more(const struct print *p)
{
	if (p->more)
		fprintf(p->out, "there are more: these are the newest %zu\n", p->lines);
}

/* ---- series ---- */

void put_series_keys(struct builder *b, cJSON *object, const struct archive_series *series)
{
	put_text(b, object, "name", series->name);
	put_text(b, object, "campaign", series->campaign);
	put_text(b, object, "scene", series->scene_name);
	put_number(b, object, "angle_deg", series->angle_deg);
	put_number(b, object, "height_m", series->height_m);
	put_number(b, object, "planned", series->planned);
	put_text(b, object, "created", series->created);
}

static int series_json(void *context, const struct archive_series *series)
{
	struct print *p = context;
	cJSON *item;

	if (print_is_full(p))
		return 0;
	p->lines++;
	item = put_append(&p->builder, p->array);
	put_series_keys(&p->builder, item, series);
	put_number(&p->builder, item, "recorded", series->recorded);
	put_number(&p->builder, item, "accepted", series->accepted);
	put_number(&p->builder, item, "rejected", series->rejected);
	put_number(&p->builder, item, "partial", series->partial);
	put_number(&p->builder, item, "faulty", series->faulty);
	put_text(&p->builder, item, "last", series->last);
	return 0;
}

static int series_csv(void *context, const struct archive_series *series)
{
	struct print *p = context;

	if (print_is_full(p))
		return 0;
	p->lines++;
	csv_text(p->out, series->name);
	csv_text(p->out, series->campaign);
	csv_text(p->out, series->scene_name);
	csv_number(p->out, series->angle_deg);
	csv_number(p->out, series->height_m);
	fprintf(p->out, "%u,%u,%u,%u,%u,%s,%s,%u\n", series->planned, series->recorded, series->accepted,
	        series->rejected, series->partial, series->created, series->last, series->faulty);
	return 0;
}

static int series_text(void *context, const struct archive_series *series)
{
	struct print *p = context;

	if (print_is_full(p))
		return 0;
	if (p->lines++ == 0)
		fprintf(p->out, "%-20s %-11s %-16s %5s %7s %8s %8s %8s %7s  %s\n", "series", "campaign",
		        "scene", "deg", "planned", "recorded", "accepted", "rejected", "partial",
		        "last drop");
	fprintf(p->out, "%-20s %-11s %-16s %5g %7u %8u %8u %8u %7u  %.10s", series->name, series->campaign,
	        series->scene_name, series->angle_deg, series->planned, series->recorded, series->accepted,
	        series->rejected, series->partial, series->last);
	if (series->faulty > 0)
		fprintf(p->out, "  %u altered or missing", series->faulty);
	fputc('\n', p->out);
	return 0;
}

int print_series(struct archive *archive, const struct archive_filter *filter, enum print_format format,
                 FILE *out)
{
	struct print p = {.out = out, .archive = archive};
	struct archive_filter asked = print_begin(&p, filter);
	cJSON *root;
	int result;

	if (format == PRINT_CSV) {
		fputs("series,campaign,scene,angle_deg,height_m,planned,recorded,accepted,rejected,partial,"
		      "created,last,faulty\n",
		      out);
		result = archive_each_series(archive, &asked, series_csv, &p);
		return result != 0 ? result : print_done(out);
	}
	if (format == PRINT_TEXT) {
		result = archive_each_series(archive, &asked, series_text, &p);
		if (p.lines == 0 && result == 0)
			fputs("no series\n", out);
		print_more(&p);
		return result != 0 ? result : print_done(out);
	}
	root = cJSON_CreateObject();
	p.array = put_array(&p.builder, root, "series");
	result = archive_each_series(archive, &asked, series_json, &p);
	put_item(&p.builder, root, "more", cJSON_CreateBool(p.more));
	if (result == 0)
		return put_out(&p.builder, root, out);
	cJSON_Delete(root);
	return result;
}

/* ---- calibrations ---- */

static int calibration_json(void *context, const struct archive_calibration *c)
{
	struct print *p = context;
	cJSON *item = put_append(&p->builder, p->array);

	put_text(&p->builder, item, "sensor", c->sensor);
	put_text(&p->builder, item, "date", c->date);
	put_number(&p->builder, item, "gain", c->gain);
	put_text(&p->builder, item, "note", c->note);
	return 0;
}

static int calibration_line(void *context, const struct archive_calibration *c)
{
	struct print *p = context;

	fprintf(p->out, "%-12s %s  %.6g  %s\n", c->sensor, c->date, c->gain, c->note);
	return 0;
}

static int calibration_csv(void *context, const struct archive_calibration *c)
{
	struct print *p = context;

	csv_text(p->out, c->sensor);
	csv_text(p->out, c->date);
	csv_text(p->out, c->note);
	fprintf(p->out, "%.17g\n", c->gain);
	return 0;
}

int print_calibrations(struct archive *archive, enum print_format format, FILE *out)
{
	struct print p = {.out = out, .archive = archive};
	cJSON *root;
	int result;

	if (format != PRINT_JSON) {
		if (format == PRINT_CSV)
			fputs("sensor,date,note,gain\n", out);
		result = archive_each_calibration(
		        archive, format == PRINT_CSV ? calibration_csv : calibration_line, &p);
		return result != 0 ? result : print_done(out);
	}
	root = cJSON_CreateObject();
	p.array = put_array(&p.builder, root, "calibrations");
	result = archive_each_calibration(archive, calibration_json, &p);
	if (result == 0)
		return put_out(&p.builder, root, out);
	cJSON_Delete(root);
	return result;
}
