/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * A record as a universal file: two datasets 58 for each channel, its samples and what is known of them.
 */
#include <math.h>
#include <string.h>

#include "host/record/metadata.h"
#include "common/base/number.h"
#include "host/record/seal.h"
#include "host/record/uff58.h"

enum { ID_MAX = UFF58_ID_CHARS - 2 }; /* some programs take lines of less than 80 */

struct axis {
	int quantity;
	const char *label, *unit;
};

struct dataset {
	const char *id[5];
	int function, precision;
	int node, direction;
	const char *entity;
	size_t count;
	double start_s, step_s;
	struct axis ordinate;
};

static void write_uff58_put_axis(FILE *out, struct axis axis)
{
	fprintf(out, "%10d%5d%5d%5d %-20s %-20s\n", axis.quantity, 0, 0, 0, axis.label, axis.unit);
}

static void write_uff58_put_head(FILE *out, const struct dataset *dataset)
{
	const struct axis none = {UFF58_UNKNOWN, "NONE", "NONE"};

	fputs("    -1\n    58\n", out);
	for (int i = 0; i < 5; i++)
		fprintf(out, "%s\n", dataset->id[i]);
	fprintf(out, "%5d%10d%5d%10d %-10s%10d%4d %-10s%10d%4d\n", dataset->function, 0, 0, 0,
	        dataset->entity, dataset->node, dataset->direction, "NONE", 0, 0);
	fprintf(out, "%10d%10zu%10d%13.5E%13.5E%13.5E\n", dataset->precision, dataset->count, 1,
	        dataset->start_s, dataset->step_s, 0.0);
	write_uff58_put_axis(out, (struct axis){UFF58_TIME, "Time", "s"});
	write_uff58_put_axis(out, dataset->ordinate);
	write_uff58_put_axis(out, none);
	write_uff58_put_axis(out, none);
}

/* ---- a channel ---- */

/* Blanks at the ends of a line do not survive it. */
static bool write_uff58_can_name(const char *name)
{
	size_t length = strlen(name);

	for (size_t i = 0; i < length; i++)
		if ((unsigned char)name[i] < ' ')
			return false;
	return length > 0 && name[0] != ' ' && name[length - 1] != ' ';
}

/* What a modal program is to know of it: sensor 1 or 2 and the axis for a drop's, else its number. */
static void write_uff58_place(const struct record *record, size_t i, struct dataset *dataset)
{
	dataset->node = (int)(record->is_drop ? i / 3 + 1 : i + 1);
	dataset->direction = record->is_drop ? (int)(i % 3) + 1 : 0;
	dataset->entity = record->is_drop ? dataset->node == 1 ? "S1" : "S2" : "NONE";
}

static void put_values(FILE *out, const struct channel *channel)
{
	for (size_t k = 0; k < channel->count; k++) {
		double value = isfinite(channel->value_g[k]) ? channel->value_g[k] : 0;

		fprintf(out, "%20.12E%s", value, k % 4 == 3 || k + 1 == channel->count ? "\n" : "");
	}
	fputs("    -1\n", out);
}

static unsigned mask_of(const struct channel *channel, size_t k)
{
	unsigned mask = channel->sample[k] & UFF58_MASK;

	return isfinite(channel->value_g[k]) || mask & SAMPLE_LOST ? mask : mask | SAMPLE_BAD;
}

/* The which-th of what a record knows in words, in a line of its own; "NONE" if there are not so many. */
static void fill_words(const struct record *record, size_t which, char line[UFF58_ID_CHARS + 1])
{
	const struct metadata_entry *entry;
	char text[METADATA_TEXT_MAX];

	strcpy(line, "NONE");
	for (size_t i = 0; (entry = metadata_entry(i)) != NULL; i++) {
		if (entry->kind != METADATA_TEXT || !metadata_known(record, entry) || which-- != 0)
			continue;
		metadata_format(record, entry, text);
		snprintf(line, UFF58_ID_CHARS + 1, "%s=%s", entry->name, text);
		return;
	}
}

/* As many of the drop's numbers as fit into one line, from *next on; "NONE" if none is left. */
static void fill_line(const struct record *record, size_t *next, char line[UFF58_ID_CHARS + 1])
{
	const struct metadata_entry *entry;
	size_t used = 0;

	strcpy(line, "NONE");
	for (; (entry = metadata_entry(*next)) != NULL; ++*next) {
		char number[METADATA_TEXT_MAX], word[2 * UFF58_ID_CHARS];
		size_t length;

		if (!metadata_known(record, entry) || entry->kind == METADATA_TEXT)
			continue;
		metadata_format(record, entry, number);
		length =
		        (size_t)snprintf(word, sizeof(word), "%s%s=%s", used ? " " : "", entry->name, number);
		if (used + length > ID_MAX)
			return;
		memcpy(line + used, word, length + 1);
		used += length;
	}
}

static void write_uff58_put_channel(const struct record *record, size_t i, size_t *next_field, FILE *out)
{
	const struct channel *channel = &record->channels[i];
	char rate[NUMBER_CHARS], start[NUMBER_CHARS], range[NUMBER_CHARS];
	char own[UFF58_ID_CHARS + 1], more[UFF58_ID_CHARS + 1], words[UFF58_ID_CHARS + 1],
	        line[4][UFF58_ID_CHARS + 1];
	struct dataset dataset = {
	        .id = {channel->name, own, words, more, i == 0 ? SEAL_BLANK : line[0]},
	        .function = UFF58_TIME_RESPONSE,
	        .precision = UFF58_DOUBLE,
	        .count = channel->count,
	        .start_s = channel->start_s,
	        .step_s = 1 / channel->rate_hz,
	        .ordinate = {UFF58_ACCELERATION, "Acceleration", "g"},
	};

	number_format(rate, channel->rate_hz, 15);
	number_format(start, channel->start_s, 15);
	number_format(range, channel->range_g, 15);
	snprintf(own, sizeof(own), UFF58_OWN "rate_hz=%s start_s=%s", rate, start);
	snprintf(more, sizeof(more), "range_g=%s uneven=%d", range,
	         (channel->flags & RECORD_FLAG_UNEVEN) != 0);
	fill_words(record, i, words);
	for (int k = i == 0; k < 4; k++)
		fill_line(record, next_field, line[k]);
	write_uff58_place(record, i, &dataset);
	write_uff58_put_head(out, &dataset);
	put_values(out, channel);

	dataset.id[1] = UFF58_OWN "mask: 1 lost, 2 not taken, 4 beyond the range";
	for (int k = 1; k < 4; k++)
		dataset.id[1 + k] = line[k];
	dataset.function = UFF58_UNKNOWN;
	dataset.precision = UFF58_SINGLE;
	dataset.ordinate = (struct axis){UFF58_UNKNOWN, "Mask", "NONE"};
	write_uff58_put_head(out, &dataset);
	for (size_t k = 0; k < channel->count; k++)
		fprintf(out, "%13.5E%s", (double)mask_of(channel, k),
		        k % 6 == 5 || k + 1 == channel->count ? "\n" : "");
	fputs("    -1\n", out);
}

int write_uff58(const struct record *record, FILE *out)
{
	size_t next_field = 0;

	for (size_t i = 0; i < record->channel_count; i++)
		if (!write_uff58_can_name(record->channels[i].name))
			return DT_E_ARGUMENT;
	for (size_t i = 0; i < record->channel_count; i++)
		write_uff58_put_channel(record, i, &next_field, out);
	if (record->is_drop && metadata_entry(next_field) != NULL)
		return DT_E_FULL; /* a number that no line has room for */
	return fflush(out) || ferror(out) ? DT_E_SYSTEM : 0;
}
