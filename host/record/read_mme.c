/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * ISO/TS 13499 (MME): a text file NAME.mme of a test, and in the folder Channel beside it NAME.001 ... with a
 * channel each: lines "key :value", of which NOVALUE is none, then a number a line. A channel's file is read
 * by itself, too. Equidistant samples only; what tells no interval or unit is not guessed.
 */
#include <ctype.h>
#include <dirent.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "common/base/number.h"
#include "host/record/mme.h"
#include "host/record/table_data.h"

enum { LOOK_BYTES = 1 << 14 };

struct mme_header {
	char name[64], unit[32];
	double interval_s, start_s, samples; /* 0 or less where not told; start_s 0 */
	bool has_interval, explicit_times, has_no_start;
	char status[32]; /* of its data, where that is no measurement */
};

/* "key   :value" of a line, without blanks around; false where there is no such value. */
static bool mme_line(const struct source_line *line, const char *key, char *value, size_t size)
{
	const char *colon = memchr(line->text, ':', line->length);
	size_t length = strlen(key), before = colon != NULL ? (size_t)(colon - line->text) : 0, at, end;

	while (before > 0 && isspace((unsigned char)line->text[before - 1]))
		before--;
	if (colon == NULL || before != length || strncasecmp(line->text, key, length) != 0)
		return false;
	at = (size_t)(colon - line->text) + 1;
	end = line->length;
	while (at < end && isspace((unsigned char)line->text[at]))
		at++;
	while (end > at && isspace((unsigned char)line->text[end - 1]))
		end--;
	snprintf(value, size, "%.*s", (int)(end - at), line->text + at);
	return value[0] != '\0' && strcasecmp(value, "NOVALUE") != 0;
}

static bool has_key(const struct source *source, const char *key)
{
	struct source_line line = {0};
	char value[8];

	while (line.next < LOOK_BYTES && source_next_line(source, &line))
		if (mme_line(&line, key, value, sizeof(value)))
			return true;
	return false;
}

static bool mme_is_channel(const struct source *source)
{
	return has_key(source, "Channel code") || has_key(source, "Name of the channel")
	               ? has_key(source, "Sampling interval") || has_key(source, "Time of first sample") ||
	                         has_key(source, "Number of samples")
	               : false;
}

bool mme_is_test(const char *file)
{
	size_t length = strlen(file);

	return length > 4 && strcasecmp(file + length - 4, ".mme") == 0;
}

bool mme_is(const struct source *source)
{
	return has_key(source, "Data format edition number") || mme_is_channel(source);
}

/* ---- a channel ---- */

/* What its laboratory says of a channel that gave nothing, or whose numbers are not in its unit. */
static bool is_no_measurement(const char *status)
{
	static const char *const none[] = {"fail", "meaningless", "no data", "not applied"};

	for (size_t i = 0; i < sizeof(none) / sizeof(none[0]); i++)
		if (strcasestr(status, none[i]) != NULL)
			return true;
	return false;
}

static void take_line(struct mme_header *header, const struct source_line *line)
{
	char value[128];

	if (mme_line(line, "Name of the channel", value, sizeof(value)) ||
	    (header->name[0] == '\0' && mme_line(line, "Channel code", value, sizeof(value))))
		snprintf(header->name, sizeof(header->name), "%.63s", value);
	else if (mme_line(line, "Unit", value, sizeof(value)))
		snprintf(header->unit, sizeof(header->unit), "%.31s", value);
	else if (mme_line(line, "Reference channel", value, sizeof(value)))
		header->explicit_times = strcasecmp(value, "explicit") == 0;
	else if (mme_line(line, "Sampling interval", value, sizeof(value)))
		header->has_interval = number_read(value, 1e-9, 1e3, &header->interval_s);
	else if (mme_line(line, "Time of first sample", value, sizeof(value)))
		header->has_no_start = !number_read(value, -1e6, 1e6, &header->start_s);
	else if (mme_line(line, "Data status", value, sizeof(value)) && is_no_measurement(value))
		snprintf(header->status, sizeof(header->status), "%.31s", value);
	else if (mme_line(line, "Number of samples", value, sizeof(value)))
		(void)number_read(value, 0, 1e9, &header->samples);
}

static bool mme_number(const struct source_line *line, double *value)
{
	size_t from = 0, end = line->length;

	while (from < end && isspace((unsigned char)line->text[from]))
		from++;
	while (end > from && isspace((unsigned char)line->text[end - 1]))
		end--;
	return end > from && number_parse(line->text + from, end - from, '.', value);
}

/* The header: up to the first line that is a number. */
static void mme_head(const struct source *source, struct mme_header *header, struct source_line *line)
{
	struct source_line next = {0};
	double value;

	*header = (struct mme_header){.samples = -1};
	while (source_next_line(source, &next) && !mme_number(&next, &value)) {
		take_line(header, &next);
		*line = next;
	}
}

static int check_head(const struct mme_header *header, const struct source *source, char *message)
{
	if (!header->has_interval || header->explicit_times)
		return source_refuse(message, DT_E_FORMAT, source->file, 0,
		                     "a channel of ISO 13499 %s, expected a Sampling interval in seconds",
		                     header->explicit_times ? "with times in another channel"
		                                            : "without its interval");
	if (header->has_no_start)
		return source_refuse(message, DT_E_FORMAT, source->file, 0,
		                     "a channel of ISO 13499 whose Time of first sample is no number");
	if (header->status[0] != '\0')
		return source_refuse(message, DT_E_FORMAT, source->file, 0,
		                     "a channel of ISO 13499 with Data status \"%s\", expected a measurement",
		                     header->status);
	if (header->unit[0] == '\0')
		return source_refuse(message, DT_E_FORMAT, source->file, 0,
		                     "a channel of ISO 13499 without its Unit, expected one");
	return 0;
}

static int mme_channel(struct table_data *table, const struct source *source, char *message)
{
	struct mme_header header;
	struct source_line line = {0}, count;
	struct table_column *column;
	size_t samples = 0, used = 0;
	int error;

	mme_head(source, &header, &line);
	error = check_head(&header, source, message);
	if (error)
		return error;
	for (count = line; source_next_line(source, &count);)
		samples += count.length > 0;
	column = table_data_add(table, samples);
	if (column == NULL)
		return source_no_memory(message, source->file);
	memcpy(column->name, header.name, sizeof(column->name));
	memcpy(column->unit, header.unit, sizeof(column->unit));
	column->rate_hz = 1 / header.interval_s;
	column->start_s = header.start_s;
	while (source_next_line(source, &line))
		if (line.length > 0 && !mme_number(&line, &column->value[used++]))
			return source_refuse(message, DT_E_FORMAT, source->file, line.number,
			                     "\"%.*s\", expected a number",
			                     line.length < 40 ? (int)line.length : 40, line.text);
	if (header.samples >= 0 && (double)samples > header.samples - 0.5 &&
	    (double)samples < header.samples + 0.5)
		return 0;
	if (header.samples < 0)
		return 0;
	return source_refuse(message, DT_E_FORMAT, source->file, 0,
	                     "%zu numbers, expected Number of samples = %.0f: the file is cut", samples,
	                     header.samples);
}

/* ---- a test ---- */

static int is_number_of_channel(const struct dirent *entry)
{
	const char *end = strrchr(entry->d_name, '.');

	return end != NULL && strlen(end) > 2 && strspn(end + 1, "0123456789") == strlen(end + 1);
}

int mme_channels(const char *file, char folder[PATH_MAX], struct dirent ***entry)
{
	static const char *const names[] = {"Channel", "CHANNEL", "channel"};
	const char *slash = strrchr(file, '/');
	int length = slash != NULL ? (int)(slash - file) + 1 : 0, count = -1;

	for (size_t i = 0; i < sizeof(names) / sizeof(names[0]) && count < 0; i++) {
		if (snprintf(folder, PATH_MAX, "%.*s%s", length, file, names[i]) >= PATH_MAX)
			return -1;
		count = scandir(folder, entry, is_number_of_channel, versionsort);
	}
	return count;
}

static int add_channel(struct table_data *table, const char *folder, const char *name, char *message)
{
	struct source source;
	char path[PATH_MAX];
	int error;

	if (snprintf(path, sizeof(path), "%s/%s", folder, name) >= (int)sizeof(path))
		return source_refuse(message, DT_E_ARGUMENT, folder, 0, "too long a name");
	error = source_load(&source, path, "a channel of ISO 13499", message);
	if (error)
		return error;
	error = mme_is_channel(&source)
	                ? mme_channel(table, &source, message)
	                : source_refuse(message, DT_E_FORMAT, path, 0, "no channel of ISO 13499");
	source_free(&source);
	return error;
}

int read_mme(struct table_data *table, const struct source *source, char message[READ_MESSAGE_MAX])
{
	struct dirent **entry;
	char folder[PATH_MAX];
	int count, error = 0;

	table->format = "iso13499";
	if (mme_is_channel(source))
		return mme_channel(table, source, message);
	count = mme_is_test(source->file) ? mme_channels(source->file, folder, &entry) : 0;
	if (count <= 0)
		error = source_refuse(message, DT_E_EMPTY, source->file, 0,
		                      "a test of ISO 13499, expected the name NAME.mme, and beside it a "
		                      "folder Channel with NAME.001 and so on");
	for (int i = 0; i < count; i++) {
		if (!error)
			error = add_channel(table, folder, entry[i]->d_name, message);
		free(entry[i]);
	}
	if (count > 0)
		free(entry);
	return error;
}
