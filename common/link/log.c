/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * log:FILE, candump text. Lines are parsed where they lie in one buffer; a line that does not fit it is
 * skipped up to its end and counted.
 */
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/link/candump.h"
#include "common/link/transport.h"

#define BUFFER_BYTES 65536u
#define INTERFACE "can0"

struct log {
	struct link link;
	FILE *output;   /* NULL when reading */
	int descriptor; /* -1 when writing */
	bool ended, skipping;
	size_t start, stop; /* the unread part of buffer */
	char buffer[BUFFER_BYTES];
};

static const char *open_input(struct log *log, const char *path)
{
	struct stat status;

	log->descriptor =
	        strcmp(path, "-") == 0 ? dup(STDIN_FILENO) : open(path, O_RDONLY | O_NOCTTY | O_CLOEXEC);
	if (log->descriptor < 0)
		return strerror(errno);
	if (fstat(log->descriptor, &status) == 0 && S_ISDIR(status.st_mode))
		return strerror(EISDIR);
	return NULL;
}

static const char *open_output(struct log *log, const char *path)
{
	log->output = strcmp(path, "-") == 0 ? stdout : fopen(path, "ae");
	if (log->output == NULL)
		return strerror(errno);
	if (log->output != stdout)
		(void)setvbuf(log->output, log->buffer, _IOFBF, sizeof(log->buffer));
	return NULL;
}

static int log_flush(struct link *link)
{
	struct log *log = (struct log *)link;

	return log->output == NULL || fflush(log->output) == 0 ? 0 : DT_E_SYSTEM;
}

static int log_close(struct link *link)
{
	struct log *log = (struct log *)link;
	bool failed = false;

	if (log->descriptor >= 0)
		(void)close(log->descriptor);
	if (log->output != NULL) {
		failed = fflush(log->output) != 0 || ferror(log->output) != 0;
		if (log->output != stdout && fclose(log->output) != 0)
			failed = true;
	}
	free(log);
	return failed ? DT_E_SYSTEM : 0;
}

static struct link *log_open(const char *path, enum link_mode mode, struct link_message *message)
{
	struct log *log;
	const char *reason;

	if (mode == LINK_READ_WRITE) {
		link_complain(message, "a log is read or written, not both, expected a bus link here");
		return NULL;
	}
	log = calloc(1, sizeof(*log));
	if (log == NULL) {
		link_complain(message, "out of memory");
		return NULL;
	}
	log->descriptor = -1;
	reason = mode == LINK_READ ? open_input(log, path) : open_output(log, path);
	if (reason != NULL) {
		link_complain(message, "%s, expected a candump log to %s", reason,
		              mode == LINK_READ ? "read" : "write");
		(void)log_close(&log->link);
		return NULL;
	}
	return &log->link;
}

static int log_send(struct link *link, const struct frame *frame)
{
	struct log *log = (struct log *)link;
	struct frame stamped;
	char line[CANDUMP_LINE_MAX];
	size_t length;

	if (frame->time_us < 0)
		return DT_E_ARGUMENT;
	if (frame->time_us == 0) {
		stamped = *frame;
		stamped.time_us = link_clock_us();
		frame = &stamped;
	}
	length = candump_format(line, frame, INTERFACE);
	if (fwrite(line, 1, length, log->output) == length)
		return 0;
	link->counters.send_lost++;
	return errno == EPIPE ? DT_E_CLOSED : DT_E_SYSTEM;
}

/* Makes room and reads more: 1, 0 at the deadline, DT_E_CLOSED at the end. */
static int log_fill(struct log *log, int64_t deadline_us)
{
	ssize_t n;
	int ready;

	memmove(log->buffer, log->buffer + log->start, log->stop - log->start);
	log->stop -= log->start;
	log->start = 0;
	if (log->stop == BUFFER_BYTES) {
		log->skipping = true;
		log->stop = 0;
	}
	ready = link_poll(log->descriptor, POLLIN, deadline_us);
	if (ready <= 0)
		return ready;
	do
		n = read(log->descriptor, log->buffer + log->stop, BUFFER_BYTES - log->stop);
	while (n < 0 && errno == EINTR);
	if (n < 0)
		return errno == EAGAIN ? 0 : DT_E_SYSTEM;
	if (n == 0)
		return DT_E_CLOSED;
	log->stop += (size_t)n;
	return 1;
}

/* Blank lines and '#' comments are nothing lost. */
static bool is_remark(const char *line, size_t length)
{
	size_t i = 0;

	while (i < length && (line[i] == ' ' || line[i] == '\t' || line[i] == '\r' || line[i] == '\n'))
		i++;
	return i == length || line[i] == '#';
}

/* Takes one line of length bytes from the buffer: whether it is a frame. */
static bool log_take_line(struct log *log, size_t length, struct frame *frame)
{
	const char *line = log->buffer + log->start;
	bool whole = !log->skipping;
	unsigned column;

	log->start += length;
	log->skipping = false;
	if (whole && is_remark(line, length))
		return false;
	if (!whole || candump_parse(line, length, frame, &column) != 1) {
		log->link.counters.malformed++;
		return false;
	}
	if (frame->time_us == 0) /* which would mean unknown */
		frame->time_us = 1;
	return true;
}

static int log_receive(struct link *link, struct frame *frame, int64_t deadline_us)
{
	struct log *log = (struct log *)link;

	for (;;) {
		size_t left = log->stop - log->start;
		const char *line = log->buffer + log->start;
		const char *newline = memchr(line, '\n', left);
		int result;

		if (newline != NULL || (log->ended && (left > 0 || log->skipping))) {
			if (log_take_line(log, newline != NULL ? (size_t)(newline - line) + 1u : left, frame))
				return 1;
			continue;
		}
		if (log->ended)
			return DT_E_CLOSED;
		result = log_fill(log, deadline_us);
		if (result == DT_E_CLOSED)
			log->ended = true;
		else if (result <= 0)
			return result;
	}
}

const struct link_ops link_log = {"log", log_open, log_send, log_receive, log_close, log_flush};
