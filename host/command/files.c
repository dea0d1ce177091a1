/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/command/files.h"

#include <dirent.h>
#include <errno.h>
#include <fnmatch.h>
#include <limits.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "host/command/command.h"

bool files_add(struct files *files, const char *path)
{
	char *copy = strdup(path);

	if (copy != NULL && files->count == files->room) {
		size_t room = files->room > 0 ? 2 * files->room : 64;
		char **more = realloc(files->file, room * sizeof(*more));

		files->file = more != NULL ? more : files->file;
		files->room = more != NULL ? room : files->room;
	}
	if (copy == NULL || files->count == files->room) {
		free(copy);
		return false;
	}
	files->file[files->count++] = copy;
	return true;
}

static bool ends_in(const char *name, const char *end)
{
	size_t length = strlen(name), of_end = strlen(end);

	return length >= of_end && strcmp(name + length - of_end, end) == 0;
}

static bool files_wants(const char *path, const char *name, const char *pattern)
{
	struct stat status;

	if (name[0] == '.' || ends_in(name, "import.ini") || ends_in(name, ".index"))
		return false;
	if (pattern != NULL && fnmatch(pattern, name, 0) != 0)
		return false;
	return stat(path, &status) == 0 && S_ISREG(status.st_mode);
}

/* Of a folder the files, of those that match where there is a pattern. False without memory. */
static bool files_of_folder(struct files *files, const char *folder, const char *pattern)
{
	struct dirent **entry;
	int count = scandir(folder, &entry, NULL, versionsort);
	bool whole = true;

	if (count < 0)
		return errno != ENOMEM;
	for (int i = 0; i < count; i++) {
		char path[PATH_MAX];
		int length = snprintf(path, sizeof(path), "%s/%s", folder, entry[i]->d_name);

		if (length < (int)sizeof(path) && files_wants(path, entry[i]->d_name, pattern))
			whole = whole && files_add(files, path);
		free(entry[i]);
	}
	free(entry);
	return whole;
}

static bool files_of_pattern(struct files *files, const char *word)
{
	const char *slash = strrchr(word, '/');
	char folder[PATH_MAX] = ".";

	if (slash != NULL)
		snprintf(folder, sizeof(folder), "%.*s", (int)(slash - word), word);
	return files_of_folder(files, folder[0] != '\0' ? folder : "/", slash != NULL ? slash + 1 : word);
}

static int files_of_word(struct files *files, const char *word)
{
	size_t before = files->count;
	struct stat status;
	bool there = stat(word, &status) == 0, whole;

	if (there && S_ISDIR(status.st_mode)) {
		whole = files_of_folder(files, word, NULL);
	} else if (!there && strpbrk(word, "*?[") != NULL) {
		whole = files_of_pattern(files, word);
	} else {
		whole = files_add(files, word);
		files->named++;
	}
	if (!whole) {
		command_error("%s: %s", word, strerror(ENOMEM));
		return COMMAND_INPUT;
	}
	if (files->count > before)
		return COMMAND_DONE;
	command_error("%s: no file in it, expected recordings", word);
	return COMMAND_INPUT;
}

int files_expand(struct files *files, char **words, int count)
{
	int code = COMMAND_DONE;

	*files = (struct files){.count = 0};
	for (int i = 0; i < count && code == COMMAND_DONE; i++)
		code = files_of_word(files, words[i]);
	if (code != COMMAND_DONE)
		files_free(files);
	return code;
}

void files_free(struct files *files)
{
	for (size_t i = 0; i < files->count; i++)
		free(files->file[i]);
	free(files->file);
	*files = (struct files){.count = 0};
}

int files_read(struct record *record, const char *file, const char *columns, unsigned drop)
{
	char message[READ_MESSAGE_MAX];

	if (read_nth(record, file, columns, drop, message) == 0)
		return COMMAND_DONE;
	command_error("%s", message);
	return COMMAND_INPUT;
}
