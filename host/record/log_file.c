/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/log_file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "host/record/can_text.h"
#include "host/record/unpack.h"

/* Small enough to stay near the processor; a window moves when a usual line no longer fits. */
enum { WINDOW_BYTES = 1 << 17, LINE_USUAL = 1 << 10 };

static int log_file_refuse(const struct log_file *log, int code, const char *why, char *message)
{
	return source_refuse(message, code, log->file, 0, "%s, expected %s", why, log->expected);
}

static int open_regular(struct log_file *log, char *message)
{
	struct stat status;

	log->descriptor = open(log->file, O_RDONLY | O_CLOEXEC);
	if (log->descriptor < 0 || fstat(log->descriptor, &status) != 0)
		return log_file_refuse(log, DT_E_SYSTEM, strerror(errno), message);
	if (status.st_size == 0)
		return log_file_refuse(log, DT_E_EMPTY, "empty file", message);
	log->size = (uint64_t)status.st_size;
	log->room = WINDOW_BYTES;
	log->window = malloc(log->room);
	if (log->window == NULL)
		return log_file_refuse(log, DT_E_MEMORY, error_text(DT_E_MEMORY), message);
	return 0;
}

/* Spreadsheets put a byte order mark in front of UTF-8; source_load has taken it away. */
static void log_file_skip_mark(struct log_file *log)
{
	size_t held;
	const char *head = log_file_get(log, 0, 3, &held);

	if (held > 3 && memcmp(head, "\xEF\xBB\xBF", 3) == 0)
		log->begin = 3;
}

/* A log in blocks is gone on with as the log that it is of. */
static int open_blocks(struct log_file *log, char *message)
{
	size_t held;
	const char *head = log_file_get(log, 0, BLOCKS_HEAD_BYTES, &held);

	if (!blocks_is(head, held))
		return 0;
	log->blocks = blocks_open(log->descriptor, log->size);
	if (log->blocks == NULL)
		return log_file_refuse(log, DT_E_SYSTEM, strerror(errno), message);
	log->size = blocks_size(log->blocks);
	log->held = 0;
	return 0;
}

/* Compressed, or a CAN log of others. */
static bool log_file_is_packed(struct log_file *log)
{
	size_t held;
	const char *head = log_file_get(log, log->begin, 512, &held);

	return unpack_program(head, held) != NULL || can_text_is(head, held);
}

/* What is no regular file, or has to be made text of, is held whole. */
static int open_whole(struct log_file *log, char *message)
{
	int error;

	log_file_close(log);
	error = source_load(&log->whole, log->file, log->expected, message);
	if (!error)
		error = unpack(&log->whole, message);
	if (!error)
		error = can_text(&log->whole, message);
	log->size = log->whole.size;
	return error;
}

int log_file_open(struct log_file *log, const char *file, const char *expected,
                  char message[READ_MESSAGE_MAX])
{
	struct log_file opened = {.file = file, .expected = expected, .descriptor = -1};
	struct stat status;
	int error;

	if (stat(file, &status) == 0 && S_ISREG(status.st_mode))
		error = open_regular(&opened, message);
	else
		error = open_whole(&opened, message);
	if (!error && opened.whole.bytes == NULL)
		error = open_blocks(&opened, message);
	if (!error && opened.whole.bytes == NULL && log_file_is_packed(&opened))
		error = open_whole(&opened, message);
	if (!error && opened.whole.bytes == NULL)
		log_file_skip_mark(&opened);
	if (error)
		log_file_close(&opened);
	else
		*log = opened;
	return error;
}

void log_file_close(struct log_file *log)
{
	source_free(&log->whole);
	blocks_close(log->blocks);
	log->blocks = NULL;
	free(log->window);
	log->window = NULL;
	if (log->descriptor >= 0)
		close(log->descriptor);
	log->descriptor = -1;
}

/* Room for so many bytes from the window's beginning on. */
static bool log_file_make_room(struct log_file *log, size_t want)
{
	size_t room = log->room;
	char *window;

	while (room < want)
		room *= 2;
	if (room == log->room)
		return true;
	window = realloc(log->window, room);
	if (window == NULL) {
		log->failed = ENOMEM;
		return false;
	}
	log->window = window;
	log->room = room;
	return true;
}

/* Reads on until the window is full or the file ends. */
static void log_file_fill(struct log_file *log)
{
	while (log->held < log->room && log->failed == 0) {
		uint64_t place = log->at + log->held;
		size_t want = log->room - log->held;
		ssize_t count;

		if (place >= log->size)
			return;
		if (want > log->size - place)
			want = (size_t)(log->size - place);
		count = log->blocks != NULL
		                ? blocks_read(log->blocks, place, log->window + log->held, want)
		                : pread(log->descriptor, log->window + log->held, want, (off_t)place);
		if (count > 0)
			log->held += (size_t)count;
		else if (count == 0)
			log->failed = ENODATA;
		else if (errno != EINTR)
			log->failed = errno;
	}
}

/* Moves the window so that it begins at offset; what is held of that stays. */
static void slide(struct log_file *log, uint64_t offset)
{
	size_t kept = 0;

	if (offset >= log->at && offset - log->at < log->held) {
		kept = log->held - (size_t)(offset - log->at);
		memmove(log->window, log->window + (offset - log->at), kept);
	}
	log->at = offset;
	log->held = kept;
}

const char *log_file_get(struct log_file *log, uint64_t offset, size_t want, size_t *held)
{
	*held = 0;
	if (offset >= log->size)
		return log->window;
	if (want > LOG_FILE_MOST)
		want = LOG_FILE_MOST;
	if (want > log->size - offset)
		want = (size_t)(log->size - offset);
	if (log->whole.bytes != NULL) {
		*held = (size_t)(log->size - offset);
		return log->whole.bytes + offset;
	}
	if (offset < log->at || offset - log->at > log->held ||
	    log->held - (size_t)(offset - log->at) < want) {
		slide(log, offset);
		if (log_file_make_room(log, want))
			log_file_fill(log);
	}
	*held = log->held - (size_t)(offset - log->at);
	return log->window + (offset - log->at);
}

unsigned log_file_damage(const struct log_file *log, uint64_t from, uint64_t to,
                         char message[BLOCKS_MESSAGE_MAX])
{
	return log->blocks != NULL ? blocks_damage(log->blocks, from, to, message) : 0;
}

int log_file_error(const struct log_file *log, char message[READ_MESSAGE_MAX])
{
	if (log->failed == 0)
		return 0;
	return log_file_refuse(log, DT_E_SYSTEM,
	                       log->failed == ENODATA ? "cut while it was read" : strerror(log->failed),
	                       message);
}

/* Where the line that begins at `at` ends, looked for beyond what a line may have. */
static uint64_t end_of_long_line(struct log_file *log, uint64_t at, uint64_t end)
{
	for (;;) {
		size_t held;
		const char *text = log_file_get(log, at, LOG_LINE_MAX, &held), *found;

		if (held > end - at)
			held = (size_t)(end - at);
		found = held > 0 ? memchr(text, '\n', held) : NULL;
		if (found != NULL)
			return at + (uint64_t)(found - text) + 1;
		at += held;
		if (held == 0 || at >= end)
			return at;
	}
}

/* The line's text as far as it is here; where it ends, NULL if not so far. */
static const char *find_end_of_line(struct log_file *log, uint64_t end, size_t want, struct log_line *line)
{
	size_t held;

	line->text = log_file_get(log, line->at, want, &held);
	if (held > end - line->at)
		held = (size_t)(end - line->at);
	line->length = held < LOG_LINE_MAX ? held : LOG_LINE_MAX;
	return memchr(line->text, '\n', line->length);
}

bool log_file_next_line(struct log_file *log, uint64_t end, struct log_line *line)
{
	size_t held;
	const char *found;

	if (end > log->size)
		end = log->size;
	if (line->next >= end)
		return false;
	line->at = line->next;
	found = find_end_of_line(log, end, LINE_USUAL, line);
	if (found == NULL)
		found = find_end_of_line(log, end, LOG_LINE_MAX, line);
	if (line->length == 0)
		return false;
	if (found != NULL)
		line->length = (size_t)(found - line->text);
	line->next = line->at + line->length + (found != NULL);
	if (found == NULL && line->next < end) {
		line->next = end_of_long_line(log, line->next, end);
		line->text = log_file_get(log, line->at, line->length, &held);
		if (held < line->length)
			line->length = held;
	}
	line->number++;
	while (line->length > 0 && line->text[line->length - 1] == '\r')
		line->length--;
	return true;
}
