/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * How what the drops of a series measured of their tower has moved: a straight line through each, over the
 * drops in their order.
 */
#include <math.h>

#include "host/archive/private.h"

/* Sums of a least-squares line of y over x. */
struct line {
	double n, x, y, xx, xy;
};

static void trend_add(struct line *line, double x, double y)
{
	line->n++;
	line->x += x;
	line->y += y;
	line->xx += x * x;
	line->xy += x * y;
}

static double trend_at(const struct line *line, double x)
{
	double spread = line->n * line->xx - line->x * line->x;
	double slope = spread > 0.0 ? (line->n * line->xy - line->x * line->y) / spread : 0.0;

	return (line->y + slope * (line->n * x - line->x)) / line->n;
}

int archive_trend(struct archive *archive, const char *series, const struct quantity *quantity,
                  struct archive_trend *trend)
{
	struct line line = {0};
	double first = 0.0, last = 0.0;
	char query[400];
	sqlite3_stmt *s;
	int result;

	snprintf(query, sizeof(query),
	         "SELECT d.number, t.\"%s\" AS value FROM drops d JOIN series g ON g.id = d.series_id"
	         " JOIN of_tower t ON t.result_id = (SELECT max(id) FROM results WHERE drop_id = d.id)"
	         " WHERE g.name = ? AND value IS NOT NULL ORDER BY d.number",
	         quantity->key);
	result = sql_query(archive, &s, query, "s", series);
	if (result != 0)
		return result;
	while ((result = sql_step(archive, s)) > 0) {
		last = sqlite3_column_double(s, 0);
		if (line.n < 1.0)
			first = last;
		trend_add(&line, last, sqlite3_column_double(s, 1));
	}
	sqlite3_finalize(s);
	if (result != 0)
		return result;
	*trend = (struct archive_trend){.drops = (unsigned)line.n, .from = NAN, .to = NAN};
	if (trend->drops > 0) {
		trend->from = trend_at(&line, first);
		trend->to = trend_at(&line, last);
	}
	return 0;
}
