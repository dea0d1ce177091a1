/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <string.h>

#include "host/archive/print_private.h"

struct drop_row {
	struct archive_drop drop;
	struct table_value value[ARCHIVE_VALUE_COUNT];
	double expanded[ARCHIVE_VALUE_COUNT], k[ARCHIVE_VALUE_COUNT]; /* NAN: no budget */
	cJSON *not_ok, *events;
	/* of the text */
	char name[ARCHIVE_NAME_MAX + 16];
	const char *state;
	char remarks[ARCHIVE_MESSAGE_MAX + 3 * ARCHIVE_TEXT_MAX + 64];
};
#define COLUMN(KIND, member, ...) TABLE_COLUMN(KIND, struct drop_row, member, __VA_ARGS__)

static const struct table_column first_columns[] = {
        COLUMN(CHARS, name, .title = "drop", .width = -20),
        COLUMN(WORDS, drop.time, .title = "time (UTC)", .width = -16, .digits = 16),
        COLUMN(WORDS, state, .title = "decision", .width = -11),
        COLUMN(WORDS, drop.series.name, .key = "series"),
        COLUMN(WHOLE, drop.number, .key = "number"),
        COLUMN(WORDS, drop.series.campaign, .key = "campaign"),
        COLUMN(WORDS, drop.series.scene_name, .key = "scene"),
        COLUMN(NUMBER, drop.series.angle_deg, .key = "angle_deg"),
        COLUMN(NUMBER, drop.series.height_m, .key = "height_m"),
        COLUMN(WORDS, drop.time, .key = "time"),
        COLUMN(WORDS, drop.state, .key = "state"),
        COLUMN(WORDS, drop.decision, .key = "decision"),
        COLUMN(WORDS, drop.reason, .key = "reason"),
        COLUMN(WORDS, drop.operator_name, .key = "operator"),
        COLUMN(WORDS, drop.note, .key = "note"),
        COLUMN(WORDS, drop.version, .key = "version"),
        COLUMN(WORDS, drop.quantities, .key = "quantities"),
        COLUMN(WORDS, drop.flags, .key = "flags"),
        COLUMN(KNOWN, drop.simulated, .key = "simulated"),
        COLUMN(WORDS, drop.verdict, .key = "verdict"),
};
static const struct table_column value_columns[] = {
#define QUANTITY_COLUMN(NAME, name, unit, ...)                                                    \
	COLUMN(VALUE, value[ARCHIVE_##NAME], .key = name "_" unit, .sigma = name "_sigma_" unit), \
	        COLUMN(NUMBER, expanded[ARCHIVE_##NAME], .key = name "_expanded_" unit),          \
	        COLUMN(NUMBER, k[ARCHIVE_##NAME], .key = name "_k"),
#include "host/result/quantity.def"
};
static const struct table_column last_columns[] = {
        COLUMN(YES, drop.sealed, .key = "sealed"),   COLUMN(WORDS, drop.raw, .key = "raw"),
        COLUMN(WORDS, drop.fault, .key = "fault"),   COLUMN(LARGE, drop.bytes, .key = "bytes", .csv = ""),
        COLUMN(WORDS, drop.sha256, .key = "sha256"), COLUMN(ITEM, not_ok, .key = "not_ok"),
        COLUMN(ITEM, events, .key = "events"),       COLUMN(CHARS, remarks, .title = "", .gap = ""),
};

enum { COLUMNS_MAX = TABLE_COUNT(first_columns) + 4 * ARCHIVE_VALUE_COUNT + TABLE_COUNT(last_columns) };

static size_t all_columns(struct table_column column[COLUMNS_MAX])
{
	size_t count = TABLE_COUNT(first_columns);

	memcpy(column, first_columns, sizeof(first_columns));
	count += print_narrow(column + count, TABLE_VALUE, offsetof(struct drop_row, value));
	memcpy(column + count, value_columns, sizeof(value_columns));
	count += TABLE_COUNT(value_columns);
	memcpy(column + count, last_columns, sizeof(last_columns));
	return count + TABLE_COUNT(last_columns);
}

/* ---- rows ---- */

static int print_drops_put_event(void *context, const struct archive_event *event)
{
	cJSON *item = cJSON_CreateObject();
	struct builder b = {.failed = item == NULL};

	put_text(&b, item, "time", event->time);
	put_text(&b, item, "what", event->what);
	put_text(&b, item, "operator", event->operator_name);
	put_text(&b, item, "text", event->text);
	if (!b.failed && cJSON_AddItemToArray(context, item))
		return 0;
	cJSON_Delete(item);
	return DT_E_MEMORY;
}

static void fill_remarks(struct drop_row *row)
{
	const struct archive_drop *d = &row->drop;

	snprintf(row->remarks, sizeof(row->remarks), "%s%s%s%s%s%s%s%s%s%s%s%s",
	         d->verdict[0] != '\0' ? " limits: " : "", d->verdict, d->fault[0] != '\0' ? " " : "",
	         d->fault, !d->sealed && d->sha256[0] != '\0' ? " not sealed" : "",
	         d->simulated ? " simulated tower" : "", d->flags[0] != '\0' ? " " : "", d->flags,
	         d->reason[0] != '\0' ? "; " : "", d->reason, d->note[0] != '\0' ? "; " : "", d->note);
}

static void fill_values(struct print *p, struct drop_row *row)
{
	for (int i = 0; i < ARCHIVE_VALUE_COUNT; i++) {
		bool not_ok = (row->drop.not_ok >> i & 1u) != 0 && !isnan(row->drop.value[i]);

		row->value[i] = (struct table_value){row->drop.value[i], row->drop.sigma[i], not_ok};
		row->expanded[i] = row->k[i] = (double)NAN;
		if (row->drop.budget[i].what[0] != '\0') {
			row->expanded[i] = row->drop.budget[i].expanded;
			row->k[i] = row->drop.budget[i].k;
		}
		p->marked |= not_ok && quantity_columns[i].head[0] != '\0';
		if (not_ok && row->not_ok != NULL)
			cJSON_AddItemToArray(row->not_ok,
			                     cJSON_CreateString(archive_value_name((enum archive_value)i)));
	}
}

static int print_drops_put_drop(void *context, const struct archive_drop *drop)
{
	struct print *p = context;
	struct drop_row row = {.drop = *drop, .state = drop->decision};
	int result = 0;

	if (table_is_full(&p->table))
		return 0;
	if (archive_counts(drop, p->undecided))
		archive_cell_add(&p->total, drop);
	p->faulty += archive_is_faulty(drop);
	p->faulty_accepted |= archive_is_faulty(drop) && strcmp(drop->decision, "accepted") == 0;
	if (drop->sha256[0] == '\0' || archive_is_faulty(drop))
		row.state = drop->state;
	snprintf(row.name, sizeof(row.name), "%s/%u", drop->series.name, drop->number);
	if (p->table.format == TABLE_JSON)
		row.not_ok = cJSON_CreateArray();
	if (p->table.format == TABLE_JSON && p->with_events) {
		row.events = cJSON_CreateArray();
		result = archive_each_event(p->archive, row.name, print_drops_put_event, row.events);
	}
	fill_remarks(&row);
	fill_values(p, &row);
	if (result == 0) {
		table_row(&p->table, &row);
	} else {
		cJSON_Delete(row.events);
		cJSON_Delete(row.not_ok);
	}
	return result;
}

/* ---- around them: JSON ---- */

static int print_drops_put_series(void *context, const struct archive_series *series)
{
	struct print *p = context;

	p->has_series = true;
	return table_object(print_series_columns, PRINT_SERIES_COLUMNS, series, p->table.out);
}

static const struct table_column total_columns[] = {
        TABLE_COLUMN(WHOLE, struct archive_cell, drops, .key = "drops"),
#define QUANTITY_COLUMN(NAME, name, unit, ...) \
	PRINT_MEAN(struct archive_cell, value[ARCHIVE_##NAME], name, unit),
#include "host/result/quantity.def"
};
static const struct table_column seal_columns[] = {
        TABLE_COLUMN(LARGE, struct archive_seal, entry, .key = "entry"),
        TABLE_COLUMN(CHARS, struct archive_seal, head, .key = "head"),
};

static int begin_json(struct print *p, const struct archive_filter *filter)
{
	int result = 0;

	fputc('{', p->table.out);
	if (filter->series != NULL) {
		fputs("\"series\":", p->table.out);
		result = archive_each_series(p->archive, filter, print_drops_put_series, p);
		fputs(p->has_series ? "," : "{},", p->table.out);
	}
	fputs("\"drops\":", p->table.out);
	return result;
}

/* How the series went; nothing of fewer than three drops. */
static int print_trends(const struct print *p, const char *series)
{
	FILE *out = p->table.out;
	struct repeats repeats;
	int result = archive_trends(p->archive, series, p->undecided, &repeats);

	if (result != 0)
		return result;
	if (p->table.format == TABLE_TEXT && repeats.rows > 0)
		fputc('\n', out);
	result = repeats_table(&repeats, p->table.format, out);
	if (p->table.format == TABLE_TEXT && repeats.rows > 0)
		fputs(REPEATS_NOTE "\n", out);
	repeats_free(&repeats);
	return result;
}

static int end_json(struct print *p, const struct archive_filter *filter)
{
	FILE *out = p->table.out;
	struct archive_seal seal;
	int result;

	fprintf(out, ",\"more\":%s,\"means\":", p->table.more ? "true" : "false");
	result = table_object(total_columns, p->total.drops > 0 ? TABLE_COUNT(total_columns) : 1, &p->total,
	                      out);
	if (result == 0)
		result = archive_seal(p->archive, &seal);
	if (result == 0 && filter->series != NULL && filter->number == 0) {
		fputs(",\"trends\":", out);
		result = print_trends(p, filter->series);
	}
	fputs(",\"seal\":", out);
	if (result == 0)
		result = table_object(seal_columns, TABLE_COUNT(seal_columns), &seal, out);
	fputs("}\n", out);
	return result;
}

/* ---- around them: text ---- */

static void total_text(const struct print *p)
{
	struct drop_row row = {.state = ""};
	struct table table = p->table;

	fputc('\n', table.out);
	table.limit = 0;
	for (table.of = TABLE_VALUES; table.of <= TABLE_COUNTS; table.of++) {
		const char *label = p->undecided ? "n, with undecided" : "n, accepted";

		snprintf(row.name, sizeof(row.name), "%s",
		         table.of == TABLE_VALUES ? "mean"
		         : table.of == TABLE_SDS  ? "SD"
		                                  : label);
		archive_cell_row(&p->total, table.of, row.value);
		table_row(&table, &row);
	}
	print_uncertainties(&p->total, table.out);
}

static int head_text(void *context, const struct archive_series *series)
{
	fprintf(context, "%s, campaign %s: %s at %g deg from %g m, %u of %u drops recorded; peaks in g\n\n",
	        series->name, series->campaign, series->scene_name, series->angle_deg, series->height_m,
	        series->recorded, series->planned);
	return 0;
}

static int end_text(const struct print *p, const struct archive_filter *filter)
{
	FILE *out = p->table.out;
	struct archive_seal seal = {.entry = 0};
	bool of_series = filter->series != NULL;
	int result = of_series ? archive_seal(p->archive, &seal) : 0;

	if (p->table.rows == 0)
		fputs("no drops\n", out);
	else if (of_series && p->total.drops > 0)
		total_text(p);
	else if (of_series)
		fputs(p->faulty_accepted > 0 ? "\nnone of the accepted is as it was recorded: no mean\n"
		                             : "\nnone accepted yet: no mean\n",
		      out);
	if (result == 0 && of_series && filter->number == 0)
		result = print_trends(p, filter->series);
	if (p->faulty > 0)
		fprintf(out, "%u altered or missing, and in no mean\n", p->faulty);
	if (p->marked)
		fputs("* look at its status: 'droptower analyze' on the log says what is the matter\n", out);
	print_more(p);
	if (seal.entry > 0)
		fprintf(out, "chain of the archive: entry %lld, head %s\n", (long long)seal.entry, seal.head);
	return result;
}

int print_drops(struct archive *archive, const struct archive_filter *filter, bool undecided,
                enum table_format format, FILE *out)
{
	struct print p = {.table = {.out = out, .format = format},
	                  .archive = archive,
	                  .undecided = undecided,
	                  .with_events = filter->series != NULL};
	struct archive_filter asked = print_begin(&p, filter);
	struct table_column column[COLUMNS_MAX];
	int result = 0;

	if (filter->series != NULL)
		result = archive_verify(archive, filter->series, filter->number, NULL, NULL);
	if (result >= 0 && format == TABLE_JSON)
		result = begin_json(&p, filter);
	else if (result >= 0 && format == TABLE_TEXT && filter->series != NULL)
		result = archive_each_series(archive, &asked, head_text, out);
	if (result >= 0) {
		table_begin(&p.table, column, all_columns(column));
		result = archive_each_drop(archive, &asked, print_drops_put_drop, &p);
		table_end(&p.table);
		archive_cell_close(&p.total);
	}
	if (result == 0 && format == TABLE_JSON)
		result = end_json(&p, filter);
	else if (result == 0 && format == TABLE_TEXT)
		result = end_text(&p, filter);
	return print_done(result, &p.table);
}
