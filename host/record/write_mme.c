/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * A record as a test of ISO/TS 13499: NAME.mme, and in the folder Channel beside it NAME.001 ... with a
 * channel each, in m/(s*s). What the format has no words for is refused: samples that are lost or bad.
 */
#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/base/number.h"
#include "common/units.h"
#include "host/base/atomic_file.h"
#include "host/record/metadata.h"
#include "host/record/mme.h"
#include "host/record/source.h"

enum { CHANNELS_MOST = 999, KEY_CHARS = 28 };

static void put_text(FILE *out, const char *key, const char *value)
{
	fprintf(out, "%-*s:%s\r\n", KEY_CHARS, key, value[0] != '\0' ? value : "NOVALUE");
}

static void put_number(FILE *out, const char *key, double value)
{
	char text[NUMBER_CHARS];

	number_format(text, value, 17);
	put_text(out, key, text);
}

/* When it fell, in UTC, as "2026-11-28 03:22:26". */
static void put_date(FILE *out, const struct record *record)
{
	char date[METADATA_TEXT_MAX] = "";

	if (metadata_known(record, metadata_find("date"))) {
		metadata_format(record, metadata_find("date"), date);
		date[10] = ' ';
		date[19] = '\0';
	}
	put_text(out, "Timestamp", date);
}

static int put_test(const struct record *record, FILE *out, const char *title)
{
	const struct metadata_entry *entry;
	char key[80], text[METADATA_TEXT_MAX];

	put_text(out, "Data format edition number", "1.6");
	put_text(out, "Laboratory name", "");
	put_text(out, "Title", title);
	put_date(out, record);
	put_number(out, "Number of test objects", 1);
	for (size_t i = 0; (entry = metadata_entry(i)) != NULL; i++) {
		if (!metadata_known(record, entry))
			continue;
		snprintf(key, sizeof(key), ".droptower %s ", entry->name);
		metadata_format(record, entry, text);
		if (entry->kind >= METADATA_TIME)
			put_text(out, key, text);
		else
			put_number(out, key,
			           entry->kind == METADATA_REAL ? metadata_real(record, entry)
			                                        : (double)metadata_whole(record, entry));
	}
	return fflush(out) || ferror(out) ? DT_E_SYSTEM : 0;
}

static int put_channel(const struct channel *channel, FILE *out)
{
	put_number(out, "Test object number", 1);
	put_text(out, "Name of the channel", channel->name);
	put_text(out, "Laboratory channel code", "");
	put_text(out, "Customer channel code", "");
	put_text(out, "Channel code", "NOVALUE");
	put_text(out, "Unit", "m/(s*s)");
	put_text(out, "Reference channel", "implicit");
	put_text(out, "Reference channel name", "");
	put_text(out, "Channel frequency class", "");
	put_text(out, "Data status", "");
	put_number(out, "Sampling interval", 1 / channel->rate_hz);
	put_number(out, "Time of first sample", channel->start_s);
	put_number(out, "Number of samples", (double)channel->count);
	for (size_t k = 0; k < channel->count; k++) {
		char text[NUMBER_CHARS];

		number_format(text, channel->value_g[k] * UNITS_G_M_S2, 17);
		fprintf(out, "%s\r\n", text);
	}
	return fflush(out) || ferror(out) ? DT_E_SYSTEM : 0;
}

static int check(const struct record *record, const char *file, char *message)
{
	if (record->channel_count > CHANNELS_MOST)
		return source_refuse(message, DT_E_ARGUMENT, file, 0, "%zu channels, ISO 13499 has up to %d",
		                     record->channel_count, CHANNELS_MOST);
	for (size_t i = 0; i < record->channel_count; i++) {
		const struct channel *channel = &record->channels[i];

		for (size_t k = 0; k < channel->count; k++)
			if ((channel->sample[k] & (SAMPLE_LOST | SAMPLE_BAD)) != 0 ||
			    !isfinite(channel->value_g[k]))
				return source_refuse(
				        message, DT_E_ARGUMENT, file, 0,
				        "sample %zu of %s is lost or bad, which ISO 13499 cannot say; "
				        "expected .csv, .unv, .h5 or .mat",
				        k + 1, channel->name);
	}
	return 0;
}

/* The folder of the channels, which has to be new or empty: all that is in it belongs to the test. */
static int make_folder(const char *file, char folder[PATH_MAX], char *message)
{
	const char *slash = strrchr(file, '/');
	struct dirent **entry;
	int there = mme_channels(file, folder, &entry);

	for (int i = 0; i < there; i++)
		free(entry[i]);
	if (there > 0) {
		free(entry);
		return source_refuse(
		        message, DT_E_ARGUMENT, folder, 0,
		        "holds channels of a test already, expected a folder of its own for this one");
	}
	if (there == 0) {
		free(entry);
		return 0;
	}
	if (snprintf(folder, PATH_MAX, "%.*sChannel", slash != NULL ? (int)(slash - file) + 1 : 0, file) >=
	    PATH_MAX)
		return source_refuse(message, DT_E_ARGUMENT, file, 0, "too long a name");
	if (mkdir(folder, 0777) != 0)
		return source_refuse(message, DT_E_SYSTEM, folder, 0, "%s", strerror(errno));
	return 0;
}

static int write_channel(const struct channel *channel, const char *folder, const char *stem, size_t i,
                         char *message)
{
	char path[PATH_MAX];
	struct atomic_file atomic;
	int error;

	if (snprintf(path, sizeof(path), "%s/%s.%03zu", folder, stem, i + 1) >= (int)sizeof(path))
		return source_refuse(message, DT_E_ARGUMENT, folder, 0, "too long a name");
	error = atomic_file_open(&atomic, path, message, READ_MESSAGE_MAX);
	return error ? error
	             : atomic_file_close(&atomic, put_channel(channel, atomic.out), message,
	                                 READ_MESSAGE_MAX);
}

int write_mme(const struct record *record, const char *file, char message[READ_MESSAGE_MAX])
{
	const char *slash = strrchr(file, '/');
	char folder[PATH_MAX], stem[NAME_MAX + 1];
	struct atomic_file atomic;
	int error = check(record, file, message);

	snprintf(stem, sizeof(stem), "%.*s", (int)(strlen(slash != NULL ? slash + 1 : file) - strlen(".mme")),
	         slash != NULL ? slash + 1 : file);
	if (!error)
		error = make_folder(file, folder, message);
	for (size_t i = 0; i < record->channel_count && !error; i++)
		error = write_channel(&record->channels[i], folder, stem, i, message);
	if (error)
		return error;
	error = atomic_file_open(&atomic, file, message, READ_MESSAGE_MAX);
	return error ? error
	             : atomic_file_close(&atomic, put_test(record, atomic.out, stem), message,
	                                 READ_MESSAGE_MAX);
}
