/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CONSOLE_ROUTE_H
#define DT_HOST_CONSOLE_ROUTE_H
/*
 * Which job a path below /api/ is: the table of README.md. A new request is a line here.
 */
#include <stdbool.h>

#include "host/console/job.h"

enum route_kind {
	ROUTE_TOWER,   /* run at once on http: it goes its own way */
	ROUTE_WORK,    /* put into work's queue */
	ROUTE_HOLD,    /* http's own: the lease of the arm */
	ROUTE_STREAM,  /* http's own: server-sent events */
	ROUTE_METRICS, /* http's own: the state for Prometheus */
};

enum route_tail {
	ROUTE_ALONE,  /* the path is the route */
	ROUTE_SERIES, /* and a series' name behind it */
	ROUTE_DROP,   /* SERIES/NUMBER */
};

struct route {
	const char *method, *path; /* without "/api/" */
	enum route_kind kind;
	enum route_tail tail;
	bool needs_hold; /* of the arm */
	bool photo;      /* its body is a photo, and not JSON */
	bool always;     /* never refused for what it says or how often it comes */
	void (*run)(struct job *job);
};

/* path: what follows "/api/". NULL: 404, or, with *other_method set, 405. *rest: what follows the route, a
 * name that is allowed; lives as long as path. */
const struct route *route_find(const char *method, const char *path, const char **rest, bool *other_method);

#endif
