/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <string.h>

#include "host/archive/print_private.h"

/* ---- JSON ---- */

static int event_json(void *context, const struct archive_event *event)
{
	struct print *p = context;
	cJSON *item = put_append(&p->builder, p->array);

	put_text(&p->builder, item, "time", event->time);
	put_text(&p->builder, item, "what", event->what);
	put_text(&p->builder, item, "operator", event->operator_name);
	put_text(&p->builder, item, "text", event->text);
	return 0;
}

static int put_events(struct print *p, cJSON *item, const struct archive_drop *drop)
{
	struct print events = {.builder = p->builder};
	char name[ARCHIVE_NAME_MAX + 16];
	int result;

	snprintf(name, sizeof(name), "%s/%u", drop->series.name, drop->number);
	events.array = put_array(&events.builder, item, "events");
	result = archive_each_event(p->archive, name, event_json, &events);
	p->builder = events.builder;
	return result;
}

static void put_values(struct builder *b, cJSON *item, const struct archive_drop *drop)
{
	char key[PRINT_KEY_MAX];
	cJSON *not_ok;

	for (int i = 0; i < ARCHIVE_VALUE_COUNT; i++) {
		print_key(key, (enum archive_value)i, "");
		put_number(b, item, key, drop->value[i]);
		print_key(key, (enum archive_value)i, "sigma_");
		put_number(b, item, key, drop->sigma[i]);
	}
	not_ok = put_array(b, item, "not_ok");
	for (int i = 0; i < ARCHIVE_VALUE_COUNT; i++)
		if ((drop->not_ok >> i & 1u) != 0 && !isnan(drop->value[i]))
			cJSON_AddItemToArray(not_ok,
			                     cJSON_CreateString(archive_value_name((enum archive_value)i)));
}

static int drop_json(void *context, const struct archive_drop *drop)
{
	struct print *p = context;
	struct builder *b = &p->builder;
	cJSON *item;
	int result;

	if (print_is_full(p))
		return 0;
	item = cJSON_CreateObject();
	if (archive_counts(drop, p->undecided))
		archive_cell_add(&p->total, drop);
	p->faulty += archive_is_faulty(drop);
	put_text(b, item, "series", drop->series.name);
	put_number(b, item, "number", drop->number);
	put_text(b, item, "campaign", drop->series.campaign);
	put_text(b, item, "scene", drop->series.scene_name);
	put_number(b, item, "angle_deg", drop->series.angle_deg);
	put_number(b, item, "height_m", drop->series.height_m);
	put_text(b, item, "time", drop->time);
	put_text(b, item, "state", drop->state);
	put_text(b, item, "fault", drop->fault);
	put_item(b, item, "sealed", cJSON_CreateBool(drop->sealed));
	put_text(b, item, "decision", drop->decision);
	put_text(b, item, "reason", drop->reason);
	put_text(b, item, "operator", drop->operator_name);
	put_text(b, item, "note", drop->note);
	put_text(b, item, "raw", drop->raw);
	put_number(b, item, "bytes", (double)drop->bytes);
	put_text(b, item, "sha256", drop->sha256);
	put_item(b, item, "simulated", drop->simulated ? cJSON_CreateTrue() : cJSON_CreateNull());
	if (drop->version != NULL)
		put_text(b, item, "version", drop->version);
	else
		put_item(b, item, "version", cJSON_CreateNull());
	put_text(b, item, "quantities", drop->quantities);
	put_text(b, item, "flags", drop->flags);
	put_values(b, item, drop);
	result = p->with_events ? put_events(p, item, drop) : 0;
	if (result != 0) {
		cJSON_Delete(item);
		return result;
	}
	if (p->lines++ > 0)
		fputc(',', p->out);
	return put_part(b, item, p->out);
}

static int series_of_drops(void *context, const struct archive_series *series)
{
	struct print *p = context;
	cJSON *object = cJSON_CreateObject();

	put_series_keys(&p->builder, object, series);
	put_text(&p->builder, object, "scene_text", series->scene);
	p->lines++;
	return put_part(&p->builder, object, p->out);
}

/* What stands for all that the archive holds. */
static int put_seal(struct print *p)
{
	cJSON *object = cJSON_CreateObject();
	struct archive_seal seal;
	int result = archive_seal(p->archive, &seal);

	if (result == 0) {
		put_number(&p->builder, object, "entry", (double)seal.entry);
		put_text(&p->builder, object, "head", seal.head);
		return put_part(&p->builder, object, p->out);
	}
	cJSON_Delete(object);
	return result;
}

static int put_total(struct print *p)
{
	cJSON *means = cJSON_CreateObject();

	put_number(&p->builder, means, "drops", p->total.drops);
	for (int i = 0; i < ARCHIVE_VALUE_COUNT && p->total.drops > 0; i++)
		put_mean(&p->builder, means, archive_value_name((enum archive_value)i), (enum archive_value)i,
		         &p->total.value[i]);
	return put_part(&p->builder, means, p->out);
}

/* One after the other: there may be ten thousand. */
static int drops_json(struct print *p, const struct archive_filter *filter)
{
	int result = 0;

	p->with_events = filter->series != NULL;
	fputc('{', p->out);
	if (filter->series != NULL) {
		fputs("\"series\":", p->out);
		result = archive_each_series(p->archive, filter, series_of_drops, p);
		fputs(p->lines > 0 ? "," : "{},", p->out);
	}
	p->lines = 0;
	fputs("\"drops\":[", p->out);
	if (result == 0)
		result = archive_each_drop(p->archive, filter, drop_json, p);
	fprintf(p->out, "],\"more\":%s,\"means\":", p->more ? "true" : "false");
	if (result == 0)
		result = put_total(p);
	fputs(",\"seal\":", p->out);
	if (result == 0)
		result = put_seal(p);
	fputs("}\n", p->out);
	return result;
}

/* ---- CSV ---- */

static int drop_csv(void *context, const struct archive_drop *drop)
{
	struct print *p = context;

	if (print_is_full(p))
		return 0;
	p->lines++;
	csv_text(p->out, drop->series.name);
	fprintf(p->out, "%u,", drop->number);
	csv_text(p->out, drop->series.campaign);
	csv_text(p->out, drop->series.scene_name);
	csv_number(p->out, drop->series.angle_deg);
	csv_number(p->out, drop->series.height_m);
	csv_text(p->out, drop->time);
	csv_text(p->out, drop->state);
	csv_text(p->out, drop->decision);
	csv_text(p->out, drop->reason);
	csv_text(p->out, drop->operator_name);
	csv_text(p->out, drop->note);
	csv_text(p->out, drop->version != NULL ? drop->version : "");
	csv_text(p->out, drop->quantities);
	csv_text(p->out, drop->flags);
	fputs(drop->simulated ? "yes," : ",", p->out);
	for (int i = 0; i < ARCHIVE_VALUE_COUNT; i++) {
		csv_number(p->out, drop->value[i]);
		csv_number(p->out, drop->sigma[i]);
	}
	fprintf(p->out, "%s,%s,", drop->sealed ? "yes" : "", drop->raw);
	csv_text(p->out, drop->fault);
	fprintf(p->out, "%s\n", drop->sha256);
	return 0;
}

static int drops_csv(struct print *p, const struct archive_filter *filter)
{
	char key[PRINT_KEY_MAX];

	fputs("series,number,campaign,scene,angle_deg,height_m,time,state,decision,reason,operator,note,"
	      "version,"
	      "quantities,flags,simulated,",
	      p->out);
	for (int i = 0; i < ARCHIVE_VALUE_COUNT; i++) {
		print_key(key, (enum archive_value)i, "");
		fprintf(p->out, "%s,", key);
		print_key(key, (enum archive_value)i, "sigma_");
		fprintf(p->out, "%s,", key);
	}
	fputs("sealed,raw,fault,sha256\n", p->out);
	return archive_each_drop(p->archive, filter, drop_csv, p);
}

/* ---- text ---- */

/* The columns of the table: a value times scale. */
static const struct column {
	enum archive_value value;
	const char *title;
	double scale;
	int decimals;
} columns[] = {
        {ARCHIVE_S1_X, "S1 X", 1, 1},       {ARCHIVE_S1_Y, "S1 Y", 1, 1},
        {ARCHIVE_S1_R, "S1 XY", 1, 1},      {ARCHIVE_S1_Z, "S1 Z", 1, 1},
        {ARCHIVE_S2_X, "S2 X", 1, 1},       {ARCHIVE_S2_Y, "S2 Y", 1, 1},
        {ARCHIVE_S2_R, "S2 XY", 1, 1},      {ARCHIVE_S2_Z, "S2 Z", 1, 1},
        {ARCHIVE_LAG, "lag ms", 1000, 2},   {ARCHIVE_FREQUENCY, "plate Hz", 1, 1},
        {ARCHIVE_DAMPING, "damping", 1, 3},
};
enum { COLUMNS = sizeof(columns) / sizeof(columns[0]) };

static void put_cell(FILE *out, double value, int decimals, char mark)
{
	if (isnan(value))
		fprintf(out, "%8s ", "-");
	else
		fprintf(out, "%8.*f%c", decimals, value, mark);
}

static int drop_text(void *context, const struct archive_drop *drop)
{
	struct print *p = context;
	bool partial = drop->sha256[0] == '\0';
	char name[ARCHIVE_NAME_MAX + 16];

	if (print_is_full(p))
		return 0;
	if (archive_counts(drop, p->undecided))
		archive_cell_add(&p->total, drop);
	p->faulty += archive_is_faulty(drop);
	if (p->lines++ == 0) {
		fprintf(p->out, "%-20s %-16s %-11s", "drop", "time (UTC)", "decision");
		for (int i = 0; i < COLUMNS; i++)
			fprintf(p->out, "%8s ", columns[i].title);
		fputc('\n', p->out);
	}
	snprintf(name, sizeof(name), "%s/%u", drop->series.name, drop->number);
	fprintf(p->out, "%-20s %-16.16s %-11s", name, drop->time,
	        partial || archive_is_faulty(drop) ? drop->state : drop->decision);
	for (int i = 0; i < COLUMNS; i++) {
		bool not_ok = (drop->not_ok >> columns[i].value & 1u) != 0;

		put_cell(p->out, drop->value[columns[i].value] * columns[i].scale, columns[i].decimals,
		         not_ok ? '*' : ' ');
		p->marked |= not_ok && !isnan(drop->value[columns[i].value]);
	}
	if (drop->fault[0] != '\0')
		fprintf(p->out, " %s", drop->fault);
	if (!drop->sealed && !partial)
		fputs(" not sealed", p->out);
	if (drop->simulated)
		fputs(" simulated tower", p->out);
	fprintf(p->out, "%s%s%s%s%s%s\n", drop->flags[0] != '\0' ? " " : "", drop->flags,
	        drop->reason[0] != '\0' ? "; " : "", drop->reason, drop->note[0] != '\0' ? "; " : "",
	        drop->note);
	return 0;
}

static void total_text(const struct print *p)
{
	FILE *out = p->out;

	fprintf(out, "\n%-49s", "mean");
	for (int i = 0; i < COLUMNS; i++)
		put_cell(out, p->total.value[columns[i].value].mean * columns[i].scale, columns[i].decimals,
		         ' ');
	fprintf(out, "\n%-49s", "SD");
	for (int i = 0; i < COLUMNS; i++)
		put_cell(out, p->total.value[columns[i].value].sd * columns[i].scale, columns[i].decimals + 1,
		         ' ');
	fprintf(out, "\n%-49s", p->undecided ? "n, accepted and undecided" : "n, accepted");
	for (int i = 0; i < COLUMNS; i++)
		fprintf(out, "%8u ", p->total.value[columns[i].value].n);
	fputc('\n', out);
}

static int seal_text(const struct print *p)
{
	struct archive_seal seal;
	int result = archive_seal(p->archive, &seal);

	if (result == 0 && seal.entry > 0)
		fprintf(p->out, "chain of the archive: entry %lld, head %s\n", (long long)seal.entry,
		        seal.head);
	return result;
}

static int head_text(void *context, const struct archive_series *series)
{
	struct print *p = context;

	fprintf(p->out, "%s, campaign %s: %s at %g deg from %g m, %u of %u drops recorded; peaks in g\n\n",
	        series->name, series->campaign, series->scene_name, series->angle_deg, series->height_m,
	        series->recorded, series->planned);
	return 0;
}

static int drops_text(struct print *p, const struct archive_filter *filter)
{
	int result = 0;

	if (filter->series != NULL)
		result = archive_each_series(p->archive, filter, head_text, p);
	if (result == 0)
		result = archive_each_drop(p->archive, filter, drop_text, p);
	if (result != 0)
		return result;
	if (p->lines == 0)
		fputs("no drops\n", p->out);
	else if (filter->series != NULL && p->total.drops > 0)
		total_text(p);
	else if (filter->series != NULL)
		fputs("\nnone accepted yet: no mean\n", p->out);
	if (p->faulty > 0)
		fprintf(p->out, "%u altered or missing, and in no mean\n", p->faulty);
	if (p->marked)
		fputs("* look at its status: 'droptower analyze' on the log says what is the matter\n",
		      p->out);
	print_more(p);
	return filter->series != NULL ? seal_text(p) : 0;
}

int print_drops(struct archive *archive, const struct archive_filter *filter, bool undecided,
                enum print_format format, FILE *out)
{
	struct print p = {.out = out, .archive = archive, .undecided = undecided};
	struct archive_filter asked = print_begin(&p, filter);
	int result = 0;

	if (filter->series != NULL)
		result = archive_verify(archive, filter->series, filter->number, NULL, NULL);
	if (result >= 0)
		result = format == PRINT_JSON  ? drops_json(&p, &asked)
		         : format == PRINT_CSV ? drops_csv(&p, &asked)
		                               : drops_text(&p, &asked);
	return result != 0 ? result : print_done(out);
}
