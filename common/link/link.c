/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "common/link/link.h"

#include <errno.h>
#include <limits.h>
#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "common/link/transport.h"

static const struct link_ops *const transports[] = {&link_unix, &link_can, &link_slcan, &link_log};

#define TRANSPORTS (sizeof(transports) / sizeof(transports[0]))

void link_complain(struct link_message *message, const char *format, ...)
{
	char text[512];
	va_list arguments;

	va_start(arguments, format);
	(void)vsnprintf(text, sizeof(text), format, arguments);
	va_end(arguments);
	if (message->text != NULL && message->size > 0)
		(void)snprintf(message->text, message->size, "%s: %s", message->url, text);
}

static bool fd_length_valid(unsigned length)
{
	return length <= 8 || length == 12 || length == 16 || length == 20 || length == 24 || length == 32 ||
	       length == 48 || length == 64;
}

static const uint8_t length_of_code[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};

unsigned link_length_of_code(unsigned code)
{
	return length_of_code[code];
}

unsigned link_code_of_length(unsigned length)
{
	unsigned code = 0;

	while (code < 15 && length_of_code[code] < length)
		code++;
	return code;
}

bool link_frame_valid(const struct frame *frame)
{
	unsigned flags = frame->flags;
	uint32_t id_max = (flags & (FRAME_EXTENDED | FRAME_ERROR)) != 0 ? 0x1FFFFFFFu : 0x7FFu;

	if (flags >= FRAME_ERROR << 1 || frame->id > id_max)
		return false;
	if ((flags & FRAME_FD) != 0)
		return (flags & (FRAME_REMOTE | FRAME_ERROR)) == 0 && fd_length_valid(frame->length);
	if ((flags & FRAME_ERROR) != 0 && (flags & (FRAME_EXTENDED | FRAME_REMOTE)) != 0)
		return false;
	return (flags & (FRAME_BRS | FRAME_ESI)) == 0 && frame->length <= 8;
}

static int64_t clock_us(clockid_t clock)
{
	struct timespec now;

	(void)clock_gettime(clock, &now);
	return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

int64_t link_now_us(void)
{
	return clock_us(CLOCK_MONOTONIC);
}

int64_t link_clock_us(void)
{
	return clock_us(CLOCK_REALTIME);
}

int link_poll_ms(int64_t deadline_us)
{
	int64_t left_us;

	if (deadline_us == LINK_FOREVER)
		return -1;
	left_us = deadline_us - link_now_us();
	if (left_us <= 0)
		return 0;
	return left_us / 1000 >= INT_MAX ? INT_MAX : (int)((left_us + 999) / 1000);
}

int link_poll(int descriptor, short events, int64_t deadline_us)
{
	struct pollfd entry = {.fd = descriptor, .events = events};
	int n;

	do
		n = poll(&entry, 1, link_poll_ms(deadline_us));
	while (n < 0 && errno == EINTR);
	if (n < 0)
		return DT_E_SYSTEM;
	return n == 0 ? 0 : entry.revents;
}

static const struct link_ops *transport_of(const char *url, const char **rest)
{
	const char *colon = strchr(url, ':');

	for (unsigned i = 0; colon != NULL && i < TRANSPORTS; i++) {
		size_t length = strlen(transports[i]->scheme);

		if ((size_t)(colon - url) == length && memcmp(url, transports[i]->scheme, length) == 0) {
			*rest = colon + 1;
			return transports[i];
		}
	}
	return NULL;
}

struct link *link_open(const char *url, enum link_mode mode, char *message, unsigned size)
{
	struct link_message complaint = {url, message, size};
	const char *rest = "";
	const struct link_ops *ops = transport_of(url, &rest);
	struct link *link;

	if (ops == NULL || *rest == '\0') {
		link_complain(
		        &complaint,
		        "not a link, expected unix:PATH, can:INTERFACE, slcan:DEVICE[@BAUD] or log:FILE");
		return NULL;
	}
	link = ops->open(rest, mode, &complaint);
	if (link == NULL)
		return NULL;
	link->ops = ops;
	link->mode = mode;
	link->url = strdup(url);
	if (link->url == NULL) {
		(void)ops->close(link);
		link_complain(&complaint, "out of memory");
		return NULL;
	}
	return link;
}

struct link *link_open_log(const char *path, enum link_mode mode, char *message, unsigned size)
{
	char url[PATH_MAX + 512];

	(void)snprintf(url, sizeof(url), "log:%s", path);
	return link_open(url, mode, message, size);
}

int link_send(struct link *link, const struct frame *frame)
{
	int error;

	if (link->mode == LINK_READ)
		return DT_E_STATE;
	if (!link_frame_valid(frame))
		return DT_E_ARGUMENT;
	error = link->ops->send(link, frame);
	if (error == 0)
		link->counters.sent++;
	return error;
}

int link_receive(struct link *link, struct frame *frame, int timeout_ms)
{
	int64_t deadline_us = timeout_ms < 0 ? LINK_FOREVER : link_now_us() + (int64_t)timeout_ms * 1000;
	int result;

	if (link->mode == LINK_WRITE)
		return DT_E_STATE;
	result = link->ops->receive(link, frame, deadline_us);
	if (result == 1) {
		link->counters.received++;
		if ((frame->flags & FRAME_ERROR) != 0)
			link->counters.errors++;
	}
	return result;
}

const struct link_counters *link_counters(const struct link *link)
{
	return &link->counters;
}

const char *link_url(const struct link *link)
{
	return link->url;
}

int link_flush(struct link *link)
{
	return link->ops->flush != NULL ? link->ops->flush(link) : 0;
}

int link_close(struct link *link)
{
	char *url;
	int error;

	if (link == NULL)
		return 0;
	url = link->url;
	error = link->ops->close(link);
	free(url);
	return error;
}
