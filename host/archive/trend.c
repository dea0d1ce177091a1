/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * How what the drops of a series measured of their tower has moved: a straight line through each, over the
 * drops in their order.
 */
#include <math.h>

#include "host/archive/private.h"

/* A value of the newest result of each drop. */
#define QUERY(key)                                                                             \
	"SELECT d.number, t." key " FROM drops d JOIN series g ON g.id = d.series_id"          \
	" JOIN of_tower t ON t.result_id = (SELECT max(id) FROM results WHERE drop_id = d.id)" \
	" WHERE g.name = ? AND t." key " IS NOT NULL ORDER BY d.number"

/* Sums of a least-squares line of y over x. */
struct line {
	double n, x, y, xx, xy;
};

static void add(struct line *line, double x, double y)
{
	line->n++;
	line->x += x;
	line->y += y;
	line->xx += x * x;
	line->xy += x * y;
}

static double at(const struct line *line, double x)
{
	double spread = line->n * line->xx - line->x * line->x;
	double slope = spread > 0.0 ? (line->n * line->xy - line->x * line->y) / spread : 0.0;

	return (line->y + slope * (line->n * x - line->x)) / line->n;
}

static int one(struct archive *archive, const char *series, const char *query, struct archive_trend *trend)
{
	struct line line = {0};
	double first = 0.0, last = 0.0;
	sqlite3_stmt *s;
	int result = sql_query(archive, &s, query, "s", series);

	if (result != 0)
		return result;
	while ((result = sql_step(archive, s)) > 0) {
		last = sqlite3_column_double(s, 0);
		if (line.n < 1.0)
			first = last;
		add(&line, last, sqlite3_column_double(s, 1));
	}
	sqlite3_finalize(s);
	if (result != 0)
		return result;
	*trend = (struct archive_trend){.drops = (unsigned)line.n, .from = NAN, .to = NAN};
	if (trend->drops > 0) {
		trend->from = at(&line, first);
		trend->to = at(&line, last);
	}
	return 0;
}

int archive_trends(struct archive *archive, const char *series, struct archive_trend trend[ARCHIVE_TRENDS])
{
	static const char *const queries[ARCHIVE_TRENDS] = {
	        [ARCHIVE_TREND_DROPOUT] = QUERY("dropout_s"),
	        [ARCHIVE_TREND_SEPARATION] = QUERY("separation_m"),
	        [ARCHIVE_TREND_ACCELERATION] = QUERY("acceleration_m_s2"),
	};
	int result = 0;

	for (int i = 0; i < ARCHIVE_TRENDS && result == 0; i++)
		result = one(archive, series, queries[i], &trend[i]);
	return result;
}
