/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/console/route.h"

#include <string.h>

#include "host/console/tower.h"
#include "host/console/work.h"

static const struct route routes[] = {
        {.method = "GET", .path = "stream", .kind = ROUTE_STREAM},
        {.method = "GET", .path = "metrics", .kind = ROUTE_METRICS},
        {.method = "POST", .path = "hold", .kind = ROUTE_HOLD},
        {.method = "POST", .path = "abort", .kind = ROUTE_TOWER, .run = tower_abort, .always = true},
        {.method = "POST", .path = "arm", .kind = ROUTE_TOWER, .run = tower_arm, .needs_hold = true},
        {.method = "POST", .path = "release", .kind = ROUTE_TOWER, .run = tower_release, .needs_hold = true},
        {.method = "POST", .path = "clear", .kind = ROUTE_TOWER, .run = tower_clear, .needs_hold = true},
        {.method = "POST", .path = "select", .kind = ROUTE_TOWER, .run = tower_select, .needs_hold = true},
        {.method = "POST", .path = "simulate", .kind = ROUTE_TOWER, .run = tower_simulate},
        {.method = "POST", .path = "series", .kind = ROUTE_WORK, .run = work_new_series, .needs_hold = true},
        {.method = "POST", .path = "decide", .kind = ROUTE_WORK, .run = work_decide, .needs_hold = true},
        {.method = "POST", .path = "note", .kind = ROUTE_WORK, .run = work_note, .needs_hold = true},
        {.method = "POST",
         .path = "photo",
         .kind = ROUTE_WORK,
         .run = work_photo,
         .tail = ROUTE_DROP,
         .photo = true},
        {.method = "POST",
         .path = "photo",
         .kind = ROUTE_WORK,
         .run = work_photo,
         .tail = ROUTE_SERIES,
         .photo = true},
        {.method = "POST", .path = "photos/discard", .kind = ROUTE_WORK, .run = work_photos_discard},
        {.method = "GET", .path = "setup", .kind = ROUTE_WORK, .run = work_setup},
        {.method = "GET", .path = "series", .kind = ROUTE_WORK, .run = work_series},
        {.method = "GET", .path = "drops", .kind = ROUTE_WORK, .run = work_drops},
        {.method = "GET", .path = "tables", .kind = ROUTE_WORK, .run = work_tables},
        {.method = "GET", .path = "csv", .kind = ROUTE_WORK, .run = work_csv},
        {.method = "GET", .path = "report", .kind = ROUTE_WORK, .run = work_report, .tail = ROUTE_SERIES},
        {.method = "GET", .path = "drop", .kind = ROUTE_WORK, .run = work_result, .tail = ROUTE_DROP},
        {.method = "GET", .path = "photos", .kind = ROUTE_WORK, .run = work_photos, .tail = ROUTE_DROP},
        {.method = "GET", .path = "photos", .kind = ROUTE_WORK, .run = work_photos, .tail = ROUTE_SERIES},
        {.method = "GET", .path = "photo", .kind = ROUTE_WORK, .run = work_photo_bytes, .tail = ROUTE_DROP},
        {.method = "GET", .path = "photo", .kind = ROUTE_WORK, .run = work_photo_bytes, .tail = ROUTE_SERIES},
        {.method = "GET", .path = "trace", .kind = ROUTE_WORK, .run = work_trace, .tail = ROUTE_DROP},
        {.method = "GET", .path = "model", .kind = ROUTE_WORK, .run = work_model, .tail = ROUTE_DROP},
        {.method = "GET", .path = "spectrum", .kind = ROUTE_WORK, .run = work_spectrum, .tail = ROUTE_DROP},
};
enum { ROUTES = sizeof(routes) / sizeof(routes[0]) };

/* A series' name by the archive's rule, so that nothing else goes any further. */
static bool route_series_valid(const char *name, unsigned long length)
{
	static const char plain[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789";

	for (unsigned long i = 0; i < length; i++)
		if (memchr(plain, name[i], sizeof(plain) - 1) == NULL &&
		    (i == 0 || memchr("._-+", name[i], 4) == NULL))
			return false;
	return length >= 1 && length <= ARCHIVE_NAME_MAX;
}

/* What follows a route, without the slash before it. */
static bool tail_valid(enum route_tail tail, const char *rest)
{
	const char *slash = strchr(rest, '/');
	size_t digits = slash != NULL ? strspn(slash + 1, "0123456789") : 0;

	if (tail == ROUTE_SERIES)
		return route_series_valid(rest, strlen(rest));
	return slash != NULL && route_series_valid(rest, (unsigned long)(slash - rest)) && digits >= 1 &&
	       digits <= 9 && slash[1 + digits] == '\0';
}

static bool matches(const struct route *route, const char *path, const char **rest)
{
	size_t length = strlen(route->path);

	if (strncmp(path, route->path, length) != 0)
		return false;
	if (route->tail == ROUTE_ALONE) {
		*rest = path + length;
		return path[length] == '\0';
	}
	*rest = path + length + 1;
	return path[length] == '/' && tail_valid(route->tail, *rest);
}

const struct route *route_find(const char *method, const char *path, const char **rest, bool *other_method)
{
	*other_method = false;
	for (unsigned i = 0; i < ROUTES; i++) {
		if (!matches(&routes[i], path, rest))
			continue;
		if (strcmp(routes[i].method, method) == 0)
			return &routes[i];
		*other_method = true;
	}
	return NULL;
}
