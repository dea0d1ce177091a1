/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/source.h"

#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "host/base/mapped.h"

/* Nobody records this much of a drop; a device that never ends would fill the memory. */
static const size_t SIZE_MAX_BYTES = (size_t)2 << 30;

int source_refuse(char message[READ_MESSAGE_MAX], int code, const char *file, uint64_t line,
                  const char *format, ...)
{
	enum { NAME_MAX_CHARS = 256 }; /* the explanation must fit behind it */
	size_t length = strlen(file);
	char place[32] = "";
	va_list list;
	int used;

	if (length > NAME_MAX_CHARS)
		file += length - NAME_MAX_CHARS;
	if (line)
		snprintf(place, sizeof(place), ":%llu", (unsigned long long)line);
	used = snprintf(message, READ_MESSAGE_MAX, "%s%s: ", file, place);
	va_start(list, format);
	vsnprintf(message + used, READ_MESSAGE_MAX - (size_t)used, format, list);
	va_end(list);
	return code;
}

int source_no_memory(char message[READ_MESSAGE_MAX], const char *file)
{
	return source_refuse(message, DT_E_MEMORY, file, 0, "%s", error_text(DT_E_MEMORY));
}

static int refuse_system(char *message, const struct source *source)
{
	return source_refuse(message, DT_E_SYSTEM, source->file, 0, "%s, expected %s", strerror(errno),
	                     source->expected);
}

/* Makes room for at least one more byte, or says why not. */
static int source_grow(struct source *source, size_t *room, char *message)
{
	char *bytes;

	if (source->size < *room)
		return 0;
	if (*room >= SIZE_MAX_BYTES)
		return source_refuse(message, DT_E_RANGE, source->file, 0, "larger than 2 GiB, expected %s",
		                     source->expected);
	bytes = realloc(source->bytes, 2 * *room);
	if (!bytes)
		return source_refuse(message, DT_E_MEMORY, source->file, 0, "no memory for %zu bytes",
		                     2 * *room);
	source->bytes = bytes;
	*room *= 2;
	return 0;
}

static int source_read_all(struct source *source, int descriptor, size_t room, char *message)
{
	for (;;) {
		int error = source_grow(source, &room, message);
		ssize_t count;

		if (error)
			return error;
		count = read(descriptor, source->bytes + source->size, room - source->size);
		if (count < 0 && errno != EINTR)
			return refuse_system(message, source);
		if (count == 0)
			break;
		if (count > 0)
			source->size += (size_t)count;
	}
	if (source->size == 0)
		return source_refuse(message, DT_E_EMPTY, source->file, 0, "empty file, expected %s",
		                     source->expected);
	return 0;
}

/* Spreadsheets put a byte order mark in front of UTF-8. */
static void source_skip_mark(struct source *source)
{
	static const char mark[] = {(char)0xEF, (char)0xBB, (char)0xBF};

	if (source->size <= sizeof(mark) || memcmp(source->bytes, mark, sizeof(mark)) != 0)
		return;
	source->size -= sizeof(mark);
	if (source->mapped != NULL)
		source->bytes += sizeof(mark);
	else
		memmove(source->bytes, source->bytes + sizeof(mark), source->size);
}

/* All of a regular file. */
static bool source_map(struct source *source, int descriptor, const struct stat *stat)
{
	if (!S_ISREG(stat->st_mode) || stat->st_size < MAPPED_LEAST)
		return false;
	source->size = (size_t)stat->st_size;
	source->mapped = source->bytes = mapped_file(descriptor, source->size);
	source->descriptor = descriptor;
	return source->mapped != NULL;
}

static int source_copy(struct source *source, int descriptor, const struct stat *stat, char *message)
{
	size_t room = 1 << 16;

	if (S_ISREG(stat->st_mode) && stat->st_size > 0)
		room = (size_t)stat->st_size + 1; /* the byte that finds the end */
	source->size = 0;
	source->bytes = malloc(room);
	return source->bytes != NULL ? source_read_all(source, descriptor, room, message)
	                             : source_refuse(message, DT_E_MEMORY, source->file, 0,
	                                             "no memory for %zu bytes", room);
}

int source_load(struct source *source, const char *file, const char *expected, char message[READ_MESSAGE_MAX])
{
	int descriptor = open(file, O_RDONLY | O_CLOEXEC);
	struct source loaded = {.file = file, .expected = expected};
	struct stat stat;
	int error = 0;

	if (descriptor < 0)
		return refuse_system(message, &loaded);
	if (fstat(descriptor, &stat) != 0)
		stat = (struct stat){0};
	if (!source_map(&loaded, descriptor, &stat)) {
		error = source_copy(&loaded, descriptor, &stat, message);
		close(descriptor);
	}
	if (!error)
		source_skip_mark(&loaded);
	if (error) {
		source_free(&loaded);
		return error;
	}
	*source = loaded;
	return 0;
}

void source_free(struct source *source)
{
	if (source->mapped != NULL)
		close(source->descriptor);
	mapped_free(source->mapped != NULL ? source->mapped : source->bytes);
	source->mapped = source->bytes = NULL;
	source->size = 0;
}

const char *source_path(char path[SOURCE_PATH_MAX], int descriptor)
{
	snprintf(path, SOURCE_PATH_MAX, "/proc/self/fd/%d", descriptor);
	return path;
}

int source_remake(struct source *source, int fd, char message[READ_MESSAGE_MAX])
{
	struct source made;
	char path[SOURCE_PATH_MAX];
	int error = source_load(&made, source_path(path, fd), source->expected, message);

	if (error)
		return source_refuse(message, error, source->file, 0, "%s, expected %s", error_text(error),
		                     source->expected);
	made.file = source->file;
	source_free(source);
	*source = made;
	return 0;
}

bool source_is_binary(const char *head, size_t length)
{
	return memchr(head, '\0', length < 64 ? length : 64) != NULL;
}

void source_replace(struct source *source, char *bytes, size_t size)
{
	source_free(source);
	source->bytes = bytes;
	source->size = size;
}

bool source_next_line(const struct source *source, struct source_line *line)
{
	const char *end;

	if (line->next >= source->size)
		return false;
	line->text = source->bytes + line->next;
	line->length = source->size - line->next;
	end = memchr(line->text, '\n', line->length);
	if (end)
		line->length = (size_t)(end - line->text);
	line->next += line->length + (end != NULL);
	mapped_seen(line->length);
	line->number++;
	while (line->length > 0 && line->text[line->length - 1] == '\r')
		line->length--;
	return true;
}
