/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/mat/put.h"

#include <ctype.h>
#include <matio.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/base/process.h"
#include "common/link/temporary.h"
#include "host/record/metadata.h"
#include "host/record/source.h"

enum { NAME_CHARS = 63 };

static int put_refuse(const char *what)
{
	fprintf(stderr, "MAT file cannot be made: %s\n", what);
	return -1;
}

static matvar_t *new_number(const char *name, double value)
{
	size_t one[2] = {1, 1};

	return Mat_VarCreate(name, MAT_C_DOUBLE, MAT_T_DOUBLE, 2, one, &value, 0);
}

static matvar_t *words(const char *name, const char *text)
{
	size_t size[2] = {1, strlen(text)};

	return Mat_VarCreate(name, MAT_C_CHAR, MAT_T_UTF8, 2, size, (void *)(uintptr_t)text, 0);
}

/* The library owns what it takes; -1 where there is none of it. */
static int set(matvar_t *of, const char *field, matvar_t *value)
{
	if (value == NULL)
		return -1;
	Mat_VarSetStructFieldByName(of, field, 0, value);
	return 0;
}

static int write_and_free(mat_t *mat, matvar_t *variable, int result)
{
	if (result == 0)
		result = variable != NULL ? Mat_VarWrite(mat, variable, MAT_COMPRESSION_ZLIB) : -1;
	Mat_VarFree(variable);
	return result == 0 ? 0 : put_refuse("no memory, or no room where it is written");
}

/* ---- channels ---- */

/* Letters, digits and underscores, a letter first. */
static void name_plainly(const char *of, char name[NAME_CHARS + 1])
{
	size_t length = 0;

	if (!isalpha((unsigned char)of[0]))
		name[length++] = 'x';
	for (; *of != '\0' && length < NAME_CHARS - 6; of++)
		name[length++] = (char)(isalnum((unsigned char)*of) ? *of : '_');
	name[length] = '\0';
}

/* A name that MATLAB takes, and no other variable has. */
static void name_variable(const struct record *record, size_t i, char name[NAME_CHARS + 1])
{
	char other[NAME_CHARS + 1];
	bool taken;

	name_plainly(record->channels[i].name, name);
	taken = strcmp(name, "drop") == 0;
	for (size_t k = 0; k < i && !taken; k++) {
		name_plainly(record->channels[k].name, other);
		taken = strcmp(other, name) == 0;
	}
	if (taken)
		snprintf(name + strlen(name), 6, "_%u", (unsigned)(i + 1) % 1000);
}

static matvar_t *samples(const struct channel *channel)
{
	size_t size[2] = {channel->count, 1};

	return Mat_VarCreate("data", MAT_C_DOUBLE, MAT_T_DOUBLE, 2, size, channel->value_g, 0);
}

static int put_channel(mat_t *mat, const struct record *record, size_t i)
{
	static const char *fields[] = {"name", "units", "rate_hz", "start_s", "data"};
	const struct channel *channel = &record->channels[i];
	size_t one[2] = {1, 1};
	char name[NAME_CHARS + 1];
	matvar_t *variable;
	int result = -1;

	name_variable(record, i, name);
	variable = Mat_VarCreateStruct(name, 2, one, fields, sizeof(fields) / sizeof(fields[0]));
	if (variable != NULL)
		result = set(variable, "name", words("name", channel->name)) |
		         set(variable, "units", words("units", "g")) |
		         set(variable, "rate_hz", new_number("rate_hz", channel->rate_hz)) |
		         set(variable, "start_s", new_number("start_s", channel->start_s)) |
		         set(variable, "data", samples(channel));
	return write_and_free(mat, variable, result);
}

/* ---- what is known of the drop ---- */

static int put_drop(mat_t *mat, const struct record *record)
{
	const struct metadata_entry *entry;
	size_t one[2] = {1, 1};
	matvar_t *variable = Mat_VarCreateStruct("drop", 2, one, NULL, 0);
	int result = variable != NULL ? 0 : -1;

	for (size_t i = 0; result == 0 && (entry = metadata_entry(i)) != NULL; i++) {
		char text[METADATA_TEXT_MAX];
		double value;

		if (!metadata_known(record, entry))
			continue;
		metadata_format(record, entry, text);
		value = entry->kind == METADATA_REAL ? metadata_real(record, entry)
		                                     : (double)metadata_whole(record, entry);
		result = Mat_VarAddStructField(variable, entry->name);
		if (result == 0)
			result = set(variable, entry->name,
			             entry->kind >= METADATA_TIME ? words(entry->name, text)
			                                          : new_number(entry->name, value));
	}
	return write_and_free(mat, variable, result);
}

/* ---- the file ---- */

static int put_all(mat_t *mat, const struct record *record)
{
	int result = 0;

	for (size_t i = 0; i < record->channel_count && result == 0; i++)
		result = put_channel(mat, record, i);
	return result == 0 && record->is_drop ? put_drop(mat, record) : result;
}

static int copy_out(const char *path)
{
	char message[READ_MESSAGE_MAX];
	struct source source;
	int result;

	if (source_load(&source, path, "what was written", message) != 0)
		return put_refuse(message);
	result = fwrite(source.bytes, 1, source.size, stdout) == source.size && fflush(stdout) == 0 ? 0 : -1;
	source_free(&source);
	return result;
}

/* The library writes to a name. Its own head would tell the time of day. */
int put_record(const struct record *record)
{
	struct temporary folder;
	char path[TEMPORARY_PATH_MAX + 8];
	mat_t *mat;
	int result = -1;

	if (temporary_make(&folder, "mat") != 0)
		return put_refuse("no temporary folder");
	snprintf(path, sizeof(path), "%s/out.mat", folder.path);
	mat = Mat_CreateVer(path, "MATLAB 5.0 MAT-file, written by droptower", MAT_FT_MAT5);
	if (mat != NULL) {
		result = put_all(mat, record);
		Mat_Close(mat);
	}
	if (result == 0)
		result = copy_out(path);
	temporary_remove(&folder);
	return result;
}
