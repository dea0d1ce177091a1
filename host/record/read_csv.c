/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Our own CSV, read as strictly as it was written. README.md describes it.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/record/drop.h"
#include "host/record/metadata.h"
#include "common/base/number.h"
#include "host/record/seal.h"
#include "host/record/write.h"

struct reading {
	bool table; /* version 2 */
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
	const struct metadata_entry *entry = metadata_find(key);

	if (strcmp(key, "channel") == 0)
		return read_csv_channel(reading, text);
	if (!entry)
		return REFUSE(reading, DT_E_FORMAT, "unknown key \"%.80s\"", key);
	if (metadata_parse(reading->record, entry, text) != 0)
		return REFUSE(reading, DT_E_FORMAT, "%s \"%.80s\", expected %s", key, text,
		              entry->kind == METADATA_TIME   ? "a time as 2026-11-27T23:18:58+00:00"
		              : entry->kind == METADATA_TEXT ? "a text of less than 64 letters"
		              : entry->kind == METADATA_REAL ? "a number"
		                                             : "a number that is whole and fits");
	return 0;
}

static int read_key_value(struct reading *reading, const char *from, size_t length)
{
	char text[256], *value;

	if (length >= sizeof(text) || memchr(from, '\0', length))
		return REFUSE(reading, DT_E_FORMAT, "too much of \"%.20s\", expected \"key value\"", from);
	memcpy(text, from, length);
	text[length] = '\0';
	value = strchr(text, ' ');
	if (!value)
		return REFUSE(reading, DT_E_FORMAT, "\"%.80s\", expected \"key value\"", text);
	*value++ = '\0';
	return read_csv_key(reading, text, value);
}

/* Of a table: the cells of the last column, of all rows. */
static int read_about(struct reading *reading)
{
	struct source_line names;

	if (!source_next_line(reading->source, &reading->line))
		return REFUSE(reading, DT_E_FORMAT, "empty, expected a line of column names");
	names = reading->line;
	while (source_next_line(reading->source, &reading->line)) {
		const struct source_line *line = &reading->line;
		const char *comma = memrchr(line->text, ',', line->length),
		           *cell = comma != NULL ? comma + 1 : line->text;
		size_t length = (size_t)(line->text + line->length - cell);
		int error = 0;

		if (comma == NULL)
			return REFUSE(reading, DT_E_FORMAT, "no column, expected as many as there are names");
		if (length > 0 &&
		    (length < strlen(SEAL_WORD) || memcmp(cell, SEAL_WORD, strlen(SEAL_WORD)) != 0))
			error = read_key_value(reading, cell, length);
		if (error)
			return error;
	}
	reading->line = names;
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
		int error;

		if (line->length == 0 || line->text[0] != '#')
			return 0;
		if (line->length < 2 || line->text[1] != ' ')
			return REFUSE(reading, DT_E_FORMAT, "no header line, expected \"# key value\"");
		error = read_key_value(reading, line->text + 2, line->length - 2);
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
	if (reading->table && equal && (size_t)(end - at) == strlen("," CSV_TABLE))
		at = memcmp(at, "," CSV_TABLE, (size_t)(end - at)) == 0 ? end : at;
	if (!equal || at != end)
		return REFUSE(reading, DT_E_FORMAT,
		              "column names are not those of the %zu channels above, "
		              "expected time_s,NAME_g,...",
		              record->channel_count);
	return 0;
}

/* ---- the rows ---- */

static int read_sample(struct reading *reading, size_t i, double time_s, const char *cell, size_t length,
                       uint8_t sample)
{
	struct channel *channel = &reading->record->channels[i];
	size_t k = reading->next[i]++;
	double value_g = NAN;

	if (k >= channel->count)
		return REFUSE(reading, DT_E_FORMAT, "%s has more samples than the %zu announced",
		              channel->name, channel->count);
	/* rounding of a time is forgiven, a wrong place is not */
	if (!(fabs(time_s - (channel->start_s + (double)k / channel->rate_hz)) * channel->rate_hz < 0.01))
		return REFUSE(reading, DT_E_FORMAT, "sample of %s at %.9g s, expected at %.9g s",
		              channel->name, time_s, channel->start_s + (double)k / channel->rate_hz);
	if (!(sample & (SAMPLE_LOST | SAMPLE_BAD)) && !number_parse(cell, length, '.', &value_g))
		return REFUSE(reading, DT_E_FORMAT, "\"%.*s\" for %s, expected a number, %s",
		              (int)(length < 80 ? length : 80), cell, channel->name,
		              reading->table ? "or nothing" : "lost, bad or nothing");
	if (!(sample & (SAMPLE_LOST | SAMPLE_BAD)) && reading->record->is_drop && !drop_is_count(value_g))
		return REFUSE(reading, DT_E_FORMAT,
		              "\"%.*s\" for %s, expected a whole count of 1/32 g within full scale",
		              (int)(length < 80 ? length : 80), cell, channel->name);
	if (reading->record->is_drop && (sample & SAMPLE_CLIPPED) != drop_mark(channel, value_g))
		return REFUSE(
		        reading, DT_E_FORMAT,
		        "\"%.*s\" for %s, expected a mark as clipped for samples beyond %g g and no other",
		        (int)(length < 80 ? length : 80), cell, channel->name, channel->range_g);
	channel->value_g[k] = value_g;
	channel->sample[k] = sample;
	return 0;
}

/* What a cell of version 1 says of its sample in words, which are taken off it. */
static uint8_t marks_of_text(const char *cell, size_t *length)
{
	uint8_t sample = 0;

	if (cell[*length - 1] == '*') {
		sample = SAMPLE_CLIPPED;
		--*length;
	}
	if (*length == 4 && memcmp(cell, "lost", 4) == 0)
		return sample | SAMPLE_LOST;
	return *length == 3 && memcmp(cell, "bad", 3) == 0 ? sample | SAMPLE_BAD : sample;
}

/* What the column of marks says of a channel, "NAME lost clipped", from *at on, which moves behind it. */
static uint8_t marks_of_table(const char *name, const char **at, const char *end)
{
	static const struct {
		const char *words;
		uint8_t sample;
	} marks[] = {
	        {" lost", SAMPLE_LOST},
	        {" bad", SAMPLE_BAD},
	        {" clipped", SAMPLE_CLIPPED},
	        {" lost clipped", SAMPLE_LOST | SAMPLE_CLIPPED},
	        {" bad clipped", SAMPLE_BAD | SAMPLE_CLIPPED},
	};
	size_t named = strlen(name);

	for (size_t m = 0; m < sizeof(marks) / sizeof(marks[0]); m++) {
		size_t length = named + strlen(marks[m].words), there = (size_t)(end - *at);

		if (there < length || memcmp(*at, name, named) != 0 ||
		    memcmp(*at + named, marks[m].words, length - named) != 0 ||
		    (there > length && (*at)[length] != ';'))
			continue;
		*at += length + (there > length);
		return marks[m].sample;
	}
	return 0;
}

/* Behind its time: samples and marks. A row without a time has nothing but the last column, which was read.
 */
static int read_table_row(struct reading *reading, double time_s, const char *cell, const char *end)
{
	const struct record *record = reading->record;
	const char *marks = cell, *marks_end, *comma;
	size_t length;

	for (size_t i = 0; i < record->channel_count; i++)
		marks = (const char *)memchr(marks, ',', (size_t)(end - marks)) + 1;
	marks_end = memchr(marks, ',', (size_t)(end - marks));
	if (isnan(time_s) && (size_t)(marks_end - cell) == record->channel_count)
		return 0;
	for (size_t i = 0; i < record->channel_count; i++, cell = comma + 1) {
		uint8_t sample =
		        marks < marks_end ? marks_of_table(record->channels[i].name, &marks, marks_end) : 0;
		int error = 0;

		comma = memchr(cell, ',', (size_t)(end - cell));
		length = (size_t)(comma - cell);
		if (length > 0 && (sample & (SAMPLE_LOST | SAMPLE_BAD)) != 0)
			error = REFUSE(reading, DT_E_FORMAT,
			               "\"%.*s\" for %s, which is marked as lost or bad",
			               (int)(length < 80 ? length : 80), cell, record->channels[i].name);
		else if (length > 0 || sample != 0)
			error = read_sample(reading, i, time_s, cell, length, sample);
		if (error)
			return error;
	}
	if (marks == marks_end)
		return 0;
	return REFUSE(reading, DT_E_FORMAT,
	              "marks \"%.*s\", expected NAME lost, bad or clipped, and ; between",
	              (int)(marks_end - marks < 80 ? marks_end - marks : 80), marks);
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
	size_t expected = reading->record->channel_count + (reading->table ? 3 : 1),
	       found = count_cells(line);
	const char *cell = line->text, *end = line->text + line->length;
	double time_s = NAN;

	if (found != expected)
		return REFUSE(reading, DT_E_FORMAT, "%zu columns, expected %zu", found, expected);
	for (size_t i = 0; i < expected; i++) {
		const char *comma = memchr(cell, ',', (size_t)(end - cell));
		size_t length = (size_t)((comma ? comma : end) - cell);
		int error = 0;

		if (i == 0 && !(reading->table && length == 0) && !number_parse(cell, length, '.', &time_s))
			return REFUSE(reading, DT_E_FORMAT, "no time in the first column, expected a number");
		if (i == 0 && reading->table)
			return read_table_row(reading, time_s, comma + 1, end);
		if (i > 0 && length > 0) {
			size_t number = length;
			uint8_t sample = marks_of_text(cell, &number);

			error = read_sample(reading, i - 1, time_s, cell, number, sample);
		}
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
	int error = reading->table ? read_about(reading) : read_header(reading);

	if (!error && reading->record->channel_count == 0)
		error = REFUSE(reading, DT_E_FORMAT, "no channel, expected \"channel rate_hz=\" lines");
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

static bool is_table(const struct source *source)
{
	struct source_line line = {0};
	size_t tail = strlen(CSV_TABLE);

	return source_next_line(source, &line) && line.length > tail &&
	       memcmp(line.text + line.length - tail, CSV_TABLE, tail) == 0;
}

bool read_csv_is(const struct source *source)
{
	static const char head[] = "# droptower csv";

	return is_table(source) ||
	       (source->size >= sizeof(head) - 1 && memcmp(source->bytes, head, sizeof(head) - 1) == 0);
}

int read_csv(struct record *record, const struct source *source, char message[READ_MESSAGE_MAX])
{
	struct record filled;
	struct reading reading = {
	        .table = is_table(source), .source = source, .message = message, .record = &filled};
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
