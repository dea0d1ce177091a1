/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Our own CSV, read as strictly as it was written. README.md describes it.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/record/drop.h"
#include "host/record/fields.h"
#include "common/base/number.h"
#include "host/record/seal.h"

struct reading {
	const struct source *source;
	struct source_line line;
	char *message;
	struct record *record;
	size_t samples; /* announced by the channel lines */
	size_t *next;   /* [channel_count], the sample each channel waits for */
};

#define REFUSE(reading, code, ...) \
	source_refuse((reading)->message, code, (reading)->source->file, (reading)->line.number, __VA_ARGS__)

static bool starts_with(const struct source_line *line, const char *text)
{
	size_t length = strlen(text);

	return line->length >= length && memcmp(line->text, text, length) == 0;
}

static bool read_csv_is_line(const struct source_line *line, const char *text)
{
	return starts_with(line, text) && line->length == strlen(text);
}

/* ---- the header ---- */

/* "rate_hz=7000 start_s=0 range_g=500 count=3500 uneven=0 name=S1X" */
static int read_csv_channel(struct reading *reading, const char *text)
{
	double rate_hz, start_s, range_g;
	struct channel *channel;
	size_t count;
	char name[32];
	int uneven, end = 0;

	if (sscanf(text, "rate_hz=%lf start_s=%lf range_g=%lf count=%zu uneven=%d name=%31[^,]%n", &rate_hz,
	           &start_s, &range_g, &count, &uneven, name, &end) != 6 ||
	    text[end] || !isfinite(1 / rate_hz) || rate_hz <= 0 || !isfinite(start_s) || !isfinite(range_g))
		return REFUSE(
		        reading, DT_E_FORMAT,
		        "channel \"%.80s\", expected rate_hz= start_s= range_g= count= uneven= name=", text);
	/* a sample takes two bytes or more: this bounds the memory */
	if (count > reading->source->size - reading->samples)
		return REFUSE(reading, DT_E_FORMAT,
		              "channel of %zu samples, expected no more than the file holds", count);
	reading->samples += count;
	channel = record_add_channel(reading->record, name, rate_hz, count);
	if (!channel)
		return REFUSE(reading, DT_E_MEMORY, "%s", error_text(DT_E_MEMORY));
	channel->start_s = start_s;
	channel->range_g = range_g;
	channel->flags = uneven ? RECORD_FLAG_UNEVEN : 0;
	return 0;
}

static int read_csv_key(struct reading *reading, const char *key, const char *text)
{
	const struct fields_entry *entry = fields_find(key);
	double value;

	if (strcmp(key, "channel") == 0)
		return read_csv_channel(reading, text);
	if (!entry)
		return REFUSE(reading, DT_E_FORMAT, "unknown key \"%.80s\"", key);
	if (!number_parse(text, strlen(text), '.', &value) || fields_set(reading->record, entry, value) != 0)
		return REFUSE(reading, DT_E_FORMAT, "%s \"%.80s\", expected a number%s", key, text,
		              entry->kind == FIELDS_REAL ? "" : " that is whole and fits");
	return 0;
}

/* "# key value" lines up to the line of column names, on which it ends. */
static int read_header(struct reading *reading)
{
	if (!source_next_line(reading->source, &reading->line) ||
	    !read_csv_is_line(&reading->line, "# droptower csv 1"))
		return REFUSE(reading, DT_E_FORMAT, "unknown version, expected \"# droptower csv 1\"");
	while (source_next_line(reading->source, &reading->line)) {
		const struct source_line *line = &reading->line;
		char text[256], *value;
		int error;

		if (line->length == 0 || line->text[0] != '#')
			return 0;
		if (line->length < 2 || line->length >= sizeof(text) ||
		    memchr(line->text, '\0', line->length))
			return REFUSE(reading, DT_E_FORMAT, "no header line, expected \"# key value\"");
		memcpy(text, line->text, line->length);
		text[line->length] = '\0';
		value = strchr(text + 2, ' ');
		if (text[1] != ' ' || !value)
			return REFUSE(reading, DT_E_FORMAT, "\"%.80s\", expected \"# key value\"", text);
		*value++ = '\0';
		error = read_csv_key(reading, text + 2, value);
		if (error)
			return error;
	}
	return REFUSE(reading, DT_E_FORMAT, "ends in the header, expected a line of column names");
}

static int check_drop(struct reading *reading)
{
	const struct record *record = reading->record;
	int error = drop_check(record);

	if (error == DT_E_RANGE)
		return REFUSE(reading, error, "drop of ticks %lu to %lu, expected 1 to %d ticks",
		              (unsigned long)record->first_tick_ms, (unsigned long)record->last_tick_ms,
		              DROP_TICKS_MAX);
	if (error == DT_E_FORMAT)
		return REFUSE(reading, error,
		              "channels are not those of a drop of these ticks, expected "
		              "S1X S1Y S1Z S2X S2Y S2Z with 7 and 10 samples a tick and a range of %g g",
		              drop_range_g(record));
	return error ? REFUSE(reading, error, "%s", error_text(error)) : 0;
}

static int check_names(struct reading *reading)
{
	const struct record *record = reading->record;
	const char *at = reading->line.text, *end = at + reading->line.length;
	bool equal = starts_with(&reading->line, "time_s");

	at += equal ? strlen("time_s") : 0;
	for (size_t i = 0; i < record->channel_count && equal; i++) {
		char name[40];
		size_t length = (size_t)snprintf(name, sizeof(name), ",%s_g", record->channels[i].name);

		equal = (size_t)(end - at) >= length && memcmp(at, name, length) == 0;
		at += equal ? length : 0;
	}
	if (!equal || at != end)
		return REFUSE(reading, DT_E_FORMAT,
		              "column names are not those of the %zu channels above, "
		              "expected time_s,NAME_g,...",
		              record->channel_count);
	return 0;
}

/* ---- the rows ---- */

static int read_sample(struct reading *reading, size_t i, double time_s, const char *cell, size_t length)
{
	struct channel *channel = &reading->record->channels[i];
	size_t k = reading->next[i]++, whole = length;
	double value_g = NAN;
	uint8_t sample = 0;

	if (k >= channel->count)
		return REFUSE(reading, DT_E_FORMAT, "%s has more samples than the %zu announced",
		              channel->name, channel->count);
	/* rounding of a time is forgiven, a wrong place is not */
	if (!(fabs(time_s - (channel->start_s + (double)k / channel->rate_hz)) * channel->rate_hz < 0.01))
		return REFUSE(reading, DT_E_FORMAT, "sample of %s at %.9g s, expected at %.9g s",
		              channel->name, time_s, channel->start_s + (double)k / channel->rate_hz);
	if (cell[length - 1] == '*') {
		sample = SAMPLE_CLIPPED;
		length--;
	}
	if (length == 4 && memcmp(cell, "lost", 4) == 0)
		sample |= SAMPLE_LOST;
	else if (length == 3 && memcmp(cell, "bad", 3) == 0)
		sample |= SAMPLE_BAD;
	else if (!number_parse(cell, length, '.', &value_g))
		return REFUSE(reading, DT_E_FORMAT,
		              "\"%.*s\" for %s, expected a number, lost, bad or nothing",
		              (int)(length < 80 ? length : 80), cell, channel->name);
	else if (reading->record->is_drop && !drop_is_count(value_g))
		return REFUSE(reading, DT_E_FORMAT,
		              "\"%.*s\" for %s, expected a whole count of 1/32 g within full scale",
		              (int)(length < 80 ? length : 80), cell, channel->name);
	if (reading->record->is_drop && (sample & SAMPLE_CLIPPED) != drop_mark(channel, value_g))
		return REFUSE(reading, DT_E_FORMAT,
		              "\"%.*s\" for %s, expected * behind a sample beyond %g g and no other",
		              (int)(whole < 80 ? whole : 80), cell, channel->name, channel->range_g);
	channel->value_g[k] = value_g;
	channel->sample[k] = sample;
	return 0;
}

static size_t count_cells(const struct source_line *line)
{
	size_t cells = 1;

	for (size_t i = 0; i < line->length; i++)
		cells += line->text[i] == ',';
	return cells;
}

static int read_csv_row(struct reading *reading)
{
	const struct source_line *line = &reading->line;
	size_t expected = reading->record->channel_count + 1, found = count_cells(line);
	const char *cell = line->text, *end = line->text + line->length;
	double time_s = NAN;

	if (found != expected)
		return REFUSE(reading, DT_E_FORMAT, "%zu columns, expected %zu", found, expected);
	for (size_t i = 0; i < expected; i++) {
		const char *comma = memchr(cell, ',', (size_t)(end - cell));
		size_t length = (size_t)((comma ? comma : end) - cell);
		int error = 0;

		if (i == 0 && !number_parse(cell, length, '.', &time_s))
			return REFUSE(reading, DT_E_FORMAT, "no time in the first column, expected a number");
		if (i > 0 && length > 0)
			error = read_sample(reading, i - 1, time_s, cell, length);
		if (error)
			return error;
		cell += length + 1;
	}
	return 0;
}

static int read_rows(struct reading *reading)
{
	const struct record *record = reading->record;

	while (source_next_line(reading->source, &reading->line)) {
		int error;

		if (starts_with(&reading->line, "# " SEAL_WORD) &&
		    reading->line.next == reading->source->size)
			break; /* read_record has checked it */
		error = read_csv_row(reading);
		if (error)
			return error;
	}
	for (size_t i = 0; i < record->channel_count; i++)
		if (reading->next[i] != record->channels[i].count)
			return REFUSE(reading, DT_E_FORMAT, "%s ends after %zu samples, expected %zu",
			              record->channels[i].name, reading->next[i], record->channels[i].count);
	return 0;
}

static int read_csv_all(struct reading *reading)
{
	int error = read_header(reading);

	if (!error && reading->record->channel_count == 0)
		error = REFUSE(reading, DT_E_FORMAT, "no channel, expected \"# channel\" lines above");
	if (!error && reading->record->is_drop)
		error = check_drop(reading);
	if (!error)
		error = check_names(reading);
	if (error)
		return error;
	reading->next = calloc(reading->record->channel_count, sizeof(*reading->next));
	if (!reading->next)
		return REFUSE(reading, DT_E_MEMORY, "%s", error_text(DT_E_MEMORY));
	error = read_rows(reading);
	free(reading->next);
	return error;
}

int read_csv(struct record *record, const struct source *source, char message[READ_MESSAGE_MAX])
{
	struct record filled;
	struct reading reading = {.source = source, .message = message, .record = &filled};
	int error;

	record_init(&filled);
	error = read_csv_all(&reading);
	if (error) {
		record_free(&filled);
		return error;
	}
	strcpy(filled.format, "csv");
	if (filled.is_drop) {
		error = drop_close(&filled);
		if (error)
			return source_refuse(message, error, source->file, 0, "%s", error_text(error));
	} else {
		record_finish(&filled);
	}
	*record = filled;
	return 0;
}
