/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CONSOLE_HTTP_H
#define DT_HOST_CONSOLE_HTTP_H
/*
 * The console's web server: a thread that takes connections, looks who asks (auth), finds the job (route),
 * puts the connection to sleep until the job is done, and sends the answer. It waits for nothing and touches
 * no file.
 *
 * Connections that have not shown the token are few and short-lived: when there are too many, or one takes
 * too long to ask, the oldest are closed. So neither half-open nor slow ones keep anybody out, and those with
 * the token stay.
 */
#include "host/console/job.h"
#include "host/console/page_parts.h"

enum { HTTP_MESSAGE_MAX = 256, HTTP_CONNECTIONS = 256 };

struct http_options {
	const char *address; /* one of http_is_address */
	unsigned port;       /* 0: any */
	const char *token;
	const struct page_part *parts;
	size_t part_count;
};

struct http;

/* In numbers, of either family: a name may stand for more than one. */
bool http_is_address(const char *text);

/* NULL and one line in message. Tower and work must be there. */
struct http *http_start(struct console *console, const struct http_options *options,
                        char message[HTTP_MESSAGE_MAX]);
unsigned http_port(const struct http *http);

/* Wakes the streams and closes what took too long; 25 times a second, from one thread. */
void http_tick(struct http *http);

/* Takes no new connection and no new job, waits for those under way (so tower and work must still run), ends
 * the streams and the thread. */
void http_stop(struct http *http);

#endif
