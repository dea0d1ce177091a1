/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/profile.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "host/base/atomic_file.h"
#include "host/record/columns.h"
#include "host/record/encoding.h"
#include "host/record/sniff.h"

static const char BESIDE[] = "import.ini";

static const struct {
	const char *name;
	char sign;
} signs[] = {{"tab", '\t'}, {"semicolon", ';'}, {"comma", ','},
             {"bar", '|'},  {"blanks", ' '},    {"point", '.'}};

static const char *sign_name(char sign)
{
	for (size_t i = 0; i < sizeof(signs) / sizeof(signs[0]); i++)
		if (signs[i].sign == sign)
			return signs[i].name;
	return "any";
}

/* ---- reading ---- */

static bool profile_sign(const char *value, char *sign)
{
	for (size_t i = 0; i < sizeof(signs) / sizeof(signs[0]); i++)
		if (strcmp(signs[i].name, value) == 0) {
			*sign = signs[i].sign;
			return true;
		}
	return false;
}

static bool profile_set(struct profile *profile, const char *key, const char *value)
{
	if (strcmp(key, "separator") == 0)
		return profile_sign(value, &profile->style.separator) && strcmp(value, "point") != 0;
	if (strcmp(key, "decimal") == 0)
		return profile_sign(value, &profile->style.decimal) &&
		       (strcmp(value, "comma") == 0 || strcmp(value, "point") == 0);
	if (strcmp(key, "columns") == 0)
		return snprintf(profile->columns, sizeof(profile->columns), "%s", value) > 0;
	return strcmp(key, "names") == 0 &&
	       snprintf(profile->names, sizeof(profile->names), "%s", value) >= 0;
}

static int profile_line(struct profile *profile, const struct source *source, const struct source_line *line,
                        char *message)
{
	char text[PROFILE_COLUMNS_MAX], *value, *key_end;

	snprintf(text, sizeof(text), "%.*s",
	         (int)(line->length < sizeof(text) ? line->length : sizeof(text) - 1), line->text);
	if (text[0] == '\0' || text[0] == '#' || text[0] == ';' || strcmp(text, "[import]") == 0)
		return 0;
	value = strchr(text, '=');
	key_end = value;
	if (value != NULL) {
		while (key_end > text && key_end[-1] == ' ')
			key_end--;
		*key_end = '\0';
		value += 1 + strspn(value + 1, " ");
	}
	if (value != NULL && line->length < sizeof(text) && profile_set(profile, text, value))
		return 0;
	return source_refuse(
	        message, DT_E_FORMAT, source->file, line->number,
	        "\"%.60s\", expected columns, names, separator (tab, semicolon, comma, bar, blanks) or "
	        "decimal (comma, point), = and its value",
	        text);
}

static int profile_read(struct profile *profile, const char *path, char *message)
{
	struct source_line line = {0};
	struct source source;
	int error;

	*profile = (struct profile){.style = {0}};
	snprintf(profile->path, sizeof(profile->path), "%s", path);
	error = source_load(&source, path, "a profile", message);
	if (error)
		return error;
	while (!error && source_next_line(&source, &line))
		error = profile_line(profile, &source, &line, message);
	if (!error && profile->columns[0] == '\0')
		error = source_refuse(message, DT_E_FORMAT, path, 0, "no columns = ..., expected a profile");
	source_free(&source);
	return error;
}

bool profile_beside(const char *file, char path[PROFILE_PATH_MAX])
{
	const char *slash = strrchr(file, '/');
	int length = slash != NULL ? (int)(slash - file) + 1 : 0;

	return snprintf(path, PROFILE_PATH_MAX, "%.*s%s", length, file, BESIDE) < PROFILE_PATH_MAX &&
	       access(path, R_OK) == 0;
}

int profile_of(struct profile **profile, const char *file, const char *columns,
               char message[READ_MESSAGE_MAX])
{
	char path[PROFILE_PATH_MAX];

	*profile = NULL;
	if (columns == NULL ? !profile_beside(file, path) : columns[0] != '@')
		return 0;
	*profile = calloc(1, sizeof(**profile));
	if (*profile == NULL)
		return source_no_memory(message, file);
	return profile_read(*profile, columns != NULL ? columns + 1 : path, message);
}

/* ---- writing ---- */

void profile_names(const struct piece *name, size_t count, char names[PROFILE_NAMES_MAX])
{
	size_t used = 0;

	for (size_t i = 0; i < count; i++) {
		if (i > 0 && used + 1 < PROFILE_NAMES_MAX)
			names[used++] = '|';
		for (size_t k = 0; k < name[i].length && used + 1 < PROFILE_NAMES_MAX; k++) {
			char c = name[i].text[k];

			names[used++] = c == '|' || (unsigned char)c < ' ' ? '_' : c;
		}
	}
	while (used > 0 && names[used - 1] == ' ')
		used--;
	names[used] = '\0';
}

static int profile_write(const char *path, const struct profile *profile, char *message)
{
	struct atomic_file atomic;
	int error = atomic_file_open(&atomic, path, message, READ_MESSAGE_MAX);

	if (error)
		return error;
	fprintf(atomic.out,
	        "# droptower: how files of this kind are read (--profile)\n[import]\ncolumns = %s\n",
	        profile->columns);
	if (profile->style.separator != '\0')
		fprintf(atomic.out, "separator = %s\ndecimal = %s\n", sign_name(profile->style.separator),
		        profile->style.decimal == ',' ? "comma" : "point");
	if (strspn(profile->names, "|") < strlen(profile->names))
		fprintf(atomic.out, "names = %s\n", profile->names);
	return atomic_file_close(&atomic, ferror(atomic.out) ? DT_E_SYSTEM : 0, message, READ_MESSAGE_MAX);
}

int profile_save(const char *path, const char *file, const char *columns, char message[READ_MESSAGE_MAX])
{
	struct profile profile = {.style = {0}};
	struct sniff *sniff = calloc(1, sizeof(*sniff));
	struct source source = {0};
	const char *encoding;
	int error = sniff != NULL ? source_load(&source, file, "a recording", message)
	                          : source_no_memory(message, file);

	if (!error)
		error = encoding_settle(&source, &encoding, message);
	if (!error) {
		error = sniff_text(sniff, &source, message);
		if (columns != NULL || (error == 0 && !sniff->time_unit_open)) {
			error = 0;
		} else if (error == 0) {
			error = source_refuse(
			        message, DT_E_FORMAT, file, 0,
			        "the unit of time is assumed, expected --columns to keep in a profile");
		}
	}
	if (!error) {
		if (columns != NULL)
			snprintf(profile.columns, sizeof(profile.columns), "%s", columns);
		else
			columns_text(&sniff->columns, profile.columns, sizeof(profile.columns));
		profile.style = sniff->style;
		profile_names(sniff->name, sniff->columns.count, profile.names);
		error = profile_write(path, &profile, message);
	}
	source_free(&source);
	free(sniff);
	return error;
}
