/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/result/verdict.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

/* ---- back from JSON ---- */

static const char *verdict_text(const cJSON *object, const char *key)
{
	const char *text = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(object, key));

	return text != NULL ? text : "";
}

static enum decision verdict_decision(const cJSON *object)
{
	for (enum decision d = DECIDE_NONE; d <= DECIDE_FAIL; d++)
		if (strcmp(decide_name(d), verdict_text(object, "decision")) == 0)
			return d;
	return DECIDE_UNDECIDED;
}

static void verdict_read_item(struct verdict_item *item, const cJSON *json)
{
	*item = (struct verdict_item){.unit = verdict_text(json, "unit"),
	                              .value = said_number(json, "value"),
	                              .sigma = said_number(json, "sigma"),
	                              .lower = said_number(json, "lower"),
	                              .upper = said_number(json, "upper"),
	                              .at = said_number(json, "at"),
	                              .guard = said_number(json, "guard_band"),
	                              .probability = said_number(json, "probability"),
	                              .margin = said_number(json, "margin_u95"),
	                              .e_n = said_number(json, "e_n"),
	                              .decision = verdict_decision(json)};
	snprintf(item->what, sizeof(item->what), "%s", verdict_text(json, "what"));
	snprintf(item->reason, sizeof(item->reason), "%s", verdict_text(json, "reason"));
}

bool verdict_read(struct verdict *v, const cJSON *result)
{
	const cJSON *json = cJSON_GetObjectItemCaseSensitive(result, "verdict"), *item;

	if (!cJSON_IsObject(json))
		return false;
	*v = (struct verdict){.decision = verdict_decision(json),
	                      .by = verdict_text(json, "limits_by"),
	                      .rule = verdict_text(json, "rule"),
	                      .rests_on = verdict_text(json, "uncertainty"),
	                      .verified = said_number(json, "verified") > 0.0,
	                      .guard = said_number(json, "guard_ratio"),
	                      .risk = said_number(json, "risk")};
	v->name = decide_name(v->decision);
	cJSON_ArrayForEach(item,
	                   cJSON_GetObjectItemCaseSensitive(json, "items")) if (v->count < VERDICT_ITEMS_MAX)
	        verdict_read_item(&v->item[v->count++], item);
	return true;
}

/* ---- for people and programs ---- */

struct verdict_row {
	struct verdict_item item;
	char said[190];
	struct table_value value;
	const char *decision;
};
#define COLUMN(KIND, member, ...) TABLE_COLUMN(KIND, struct verdict_row, member, __VA_ARGS__)

static const struct table_column verdict_columns[] = {
        COLUMN(CHARS, item.what, .key = "what", .title = "limit on", .width = -32),
        COLUMN(VALUE, value, .key = "value", .sigma = "sigma", .title = "value", .width = 10, .digits = 3),
        COLUMN(NUMBER, item.sigma, .title = "u", .width = 8, .digits = 3),
        COLUMN(NUMBER, item.lower, .key = "lower", .title = "from", .width = 9, .digits = -5),
        COLUMN(NUMBER, item.upper, .key = "upper", .title = "to", .width = 9, .digits = -5),
        COLUMN(WORDS, item.unit, .key = "unit", .title = "", .width = -4),
        COLUMN(NUMBER, item.at, .key = "at"),
        COLUMN(NUMBER, item.guard, .key = "guard_band", .title = "guard", .width = 8, .digits = 3),
        COLUMN(NUMBER, item.margin, .key = "margin_u95", .title = "margin/U", .width = 9, .digits = 2),
        COLUMN(NUMBER, item.e_n, .key = "e_n"),
        COLUMN(NUMBER, item.probability, .key = "probability", .title = "p", .width = 7, .digits = 4),
        COLUMN(WORDS, decision, .key = "decision"),
        COLUMN(CHARS, item.reason, .key = "reason"),
        COLUMN(CHARS, said, .title = "decision", .gap = "  "),
};

int verdict_table(const struct verdict *verdict, enum table_format format, FILE *out)
{
	struct table table = {.out = out, .format = format};

	table_begin(&table, verdict_columns, TABLE_COUNT(verdict_columns));
	for (size_t i = 0; i < verdict->count; i++) {
		struct verdict_row row = {.item = verdict->item[i]};

		row.value = (struct table_value){row.item.value, row.item.sigma, false};
		row.decision = decide_name(row.item.decision);
		snprintf(row.said, sizeof(row.said), "%s%s%s", row.decision,
		         row.item.reason[0] != '\0' ? ": " : "", row.item.reason);
		if (!isfinite(row.item.lower))
			row.item.lower = (double)NAN;
		if (!isfinite(row.item.upper))
			row.item.upper = (double)NAN;
		table_row(&table, &row);
	}
	return table_end(&table);
}

void verdict_word(enum decision decision, FILE *out)
{
	for (const char *at = decide_name(decision); *at != '\0'; at++)
		fputc(toupper((unsigned char)*at), out);
}

void verdict_line(const struct verdict *verdict, FILE *out)
{
	verdict_word(verdict->decision, out);
	fprintf(out, ": %zu of %zu limits fail, %zu undecided; guard band %g U, risk of a pass up to %.2g %%",
	        verdict->failed, verdict->count, verdict->undecided, verdict->guard, 100.0 * verdict->risk);
}
