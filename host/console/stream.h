/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CONSOLE_STREAM_H
#define DT_HOST_CONSOLE_STREAM_H
/*
 * Server-sent events: what happens, to every page that watches. A stream is asked for what is new whenever
 * its socket takes more, and sleeps (suspended) while there is nothing; a tick wakes all. So what a slow page
 * has not taken is never kept for it: it gets the state as it is then, and the newest envelopes.
 *
 * All on http's thread but stream_tick and streams_end.
 */
#include <microhttpd.h>

#include "host/console/job.h"
#include "host/console/hold.h"

enum { STREAM_MAX = 16 };

struct streams;

/* NULL without memory. hold outlives it. */
struct streams *streams_create(struct console *console, struct hold *hold);
void streams_destroy(struct streams *streams); /* when no connection is left */

/* The answer to a request for a stream, NULL when there are STREAM_MAX. named: the page's console, "" for
 * none. */
struct MHD_Response *stream_open(struct streams *streams, struct MHD_Connection *connection,
                                 const char *named);

/* Wakes every stream: 25 times a second, from one other thread. */
void streams_tick(struct streams *streams);

/* No stream goes on; each ends when it is next woken. */
void streams_end(struct streams *streams);

#endif
