/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Our own CSV, read as strictly as it was written. README.md describes it.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/record/drop.h"
#include "host/record/number.h"
#include "host/record/source.h"

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

static bool is_line(const struct source_line *line, const char *text)
{
	return starts_with(line, text) && line->length == strlen(text);
}

/* ---- the header ---- */

/* "rate_hz=7000 start_s=0 range_g=500 count=3500 uneven=0 name=S1X" */
static int read_channel(struct reading *reading, const char *text)
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

/* Where the value of a key goes. */
struct target {
	const char *key;
	double *real;
	uint64_t *u64;
	uint32_t *u32;
	uint16_t *u16;
	int16_t *i16;
	bool *seen;
};

static int read_signed(struct reading *reading, const struct target *target, const char *text)
{
	char *end;
	long value = strtol(text, &end, 10);

	if (end == text || *end || value < INT16_MIN || value > INT16_MAX)
		return REFUSE(reading, DT_E_FORMAT, "%s \"%.80s\", expected a number that is whole and fits",
		              target->key, text);
	*target->i16 = (int16_t)value;
	return 0;
}

static int read_value(struct reading *reading, const struct target *target, const char *text)
{
	uint64_t max = target->u64 ? UINT64_MAX : target->u32 ? UINT32_MAX : UINT16_MAX;
	unsigned long long value;
	char *end;

	if (target->real && number_parse(text, strlen(text), '.', target->real))
		return 0;
	if (target->i16)
		return read_signed(reading, target, text);
	errno = 0;
	value = strtoull(text, &end, 10);
	if (target->real || text[0] < '0' || text[0] > '9' || *end || errno || value > max)
		return REFUSE(reading, DT_E_FORMAT, "%s \"%.80s\", expected a number%s", target->key, text,
		              target->real ? "" : " that is whole and fits");
	if (target->u64)
		*target->u64 = value;
	if (target->u32)
		*target->u32 = (uint32_t)value;
	if (target->u16)
		*target->u16 = (uint16_t)value;
	if (target->seen)
		*target->seen = true;
	return 0;
}

static int read_key(struct reading *reading, const char *key, const char *text)
{
	struct record *record = reading->record;
	struct record_counters *counters = &record->counters;
	const struct target targets[] = {
	        {.key = "drop_id", .u16 = &record->drop_id, .seen = &record->is_drop},
	        {.key = "marks", .u16 = &record->marks},
	        {.key = "first_tick_ms", .u32 = &record->first_tick_ms},
	        {.key = "last_tick_ms", .u32 = &record->last_tick_ms},
	        {.key = "trigger_s", .real = &record->trigger_s},
	        {.key = "frame_speed_m_s", .real = &record->frame_speed_m_s},
	        {.key = "crc32", .u32 = &record->crc32, .seen = &record->crc_known},
	        {.key = "camera_frame", .i16 = &record->camera_frame},
	        {.key = "blocks", .u64 = &counters->blocks},
	        {.key = "repeated", .u64 = &counters->repeated},
	        {.key = "reordered", .u64 = &counters->reordered},
	        {.key = "corrupt", .u64 = &counters->corrupt},
	        {.key = "gaps", .u64 = &counters->gaps},
	        {.key = "resent", .u64 = &counters->resent},
	        {.key = "conflicting", .u64 = &counters->conflicting},
	};

	if (strcmp(key, "channel") == 0)
		return read_channel(reading, text);
	for (size_t i = 0; i < sizeof(targets) / sizeof(targets[0]); i++)
		if (strcmp(key, targets[i].key) == 0)
			return read_value(reading, &targets[i], text);
	return REFUSE(reading, DT_E_FORMAT, "unknown key \"%.80s\"", key);
}

/* "# key value" lines up to the line of column names, on which it ends. */
static int read_header(struct reading *reading)
{
	if (!source_next_line(reading->source, &reading->line) ||
	    !is_line(&reading->line, "# droptower csv 1"))
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
		error = read_key(reading, text + 2, value);
		if (error)
			return error;
	}
	return REFUSE(reading, DT_E_FORMAT, "ends in the header, expected a line of column names");
}

/* A drop has the channels of a drop, whole blocks of them. */
static int check_drop(struct reading *reading)
{
	const struct record *record = reading->record;
	struct record drop;
	bool equal = record->channel_count == DROP_CHANNELS;
	int error = drop_open(&drop, record->first_tick_ms, record->last_tick_ms);

	if (error)
		return REFUSE(reading, error, "drop of ticks %lu to %lu, expected 1 to %d ticks",
		              (unsigned long)record->first_tick_ms, (unsigned long)record->last_tick_ms,
		              DROP_TICKS_MAX);
	for (size_t i = 0; i < DROP_CHANNELS && equal; i++)
		equal = strcmp(record->channels[i].name, drop.channels[i].name) == 0 &&
		        record->channels[i].count == drop.channels[i].count;
	record_free(&drop);
	if (!equal)
		return REFUSE(reading, DT_E_FORMAT,
		              "channels are not those of a drop of these ticks, expected "
		              "S1X S1Y S1Z S2X S2Y S2Z with 7 and 10 samples a tick");
	return 0;
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
	size_t k = reading->next[i]++;
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

static int read_row(struct reading *reading)
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
		int error = read_row(reading);

		if (error)
			return error;
	}
	for (size_t i = 0; i < record->channel_count; i++)
		if (reading->next[i] != record->channels[i].count)
			return REFUSE(reading, DT_E_FORMAT, "%s ends after %zu samples, expected %zu",
			              record->channels[i].name, reading->next[i], record->channels[i].count);
	return 0;
}

static int read_all(struct reading *reading)
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
	error = read_all(&reading);
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
