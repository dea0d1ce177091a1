/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/command/repeats.h"

#include <math.h>
#include <stdio.h>

#include "host/base/put.h"

static int repeats_json(const struct repeats *repeats)
{
	struct builder b = {.failed = false};
	cJSON *root = cJSON_CreateObject(), *rows;

	b.failed = root == NULL;
	put_number(&b, root, "repeats", (double)repeats->repeats);
	put_text(&b, root, "quantities", quantity_version());
	rows = put_array(&b, root, "rows");
	for (size_t i = 0; i < repeats->rows; i++) {
		const struct repeats_row *r = &repeats->row[i];
		cJSON *row = put_append(&b, rows);

		put_text(&b, row, "channel", r->channel);
		put_text(&b, row, "quantity", r->quantity->key);
		put_number(&b, row, "count", (double)r->count);
		put_number(&b, row, "left_out", (double)r->left_out);
		put_number(&b, row, "mean", r->mean);
		put_number(&b, row, "sd", r->sd);
		put_number(&b, row, "trend_per_repeat", r->trend);
		put_number(&b, row, "sigma_trend_per_repeat", r->sigma_trend);
		put_number(&b, row, "change_percent", 100 * r->change);
		put_number(&b, row, "sigma_change_percent", 100 * r->sigma_change);
		put_bool(&b, row, "moves", r->moves);
		put_number(&b, row, "changes_at", r->change_at > 0 ? (double)r->change_at : (double)NAN);
		put_number(&b, row, "stands_out", r->stands_out > 0 ? (double)r->stands_out : (double)NAN);
		put_numbers(&b, row, "number", r->number, r->count);
		put_numbers(&b, row, "value", r->value, r->count);
	}
	return put_out(&b, root, stdout);
}

int repeats_print(const struct repeats *repeats, bool json)
{
	if (json)
		return repeats_json(repeats);
	printf("%zu repeats; values whose status is not ok are left out; first to last by a straight line, "
	       "+- one "
	       "standard uncertainty\n%-16s %-20s %5s %4s %12s %11s %18s\n",
	       repeats->repeats, "channel", "value", "n", "out", "mean", "SD", "first to last %");
	for (size_t i = 0; i < repeats->rows; i++) {
		const struct repeats_row *r = &repeats->row[i];
		char words[REPEATS_WORDS_MAX];

		repeats_words(r, words);
		printf("%-16.16s %-20s %5zu %4zu ", r->channel, r->quantity->key, r->count, r->left_out);
		if (r->count > 0)
			printf("%12.6g %11.3g", r->mean, r->sd);
		if (isfinite(r->trend))
			printf(" %8.2f +- %6.2f", 100 * r->change, 100 * r->sigma_change);
		printf("  %s\n", words);
	}
	return 0;
}
