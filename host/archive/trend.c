/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What the drops of a series measured of their tower, in their order.
 */
#include <stdio.h>

#include "host/archive/private.h"

int archive_trend(struct archive *archive, const char *series, const struct quantity *quantity,
                  struct repeats_row *row)
{
	char query[400];
	sqlite3_stmt *s;
	int result;

	*row = (struct repeats_row){.quantity = quantity};
	snprintf(query, sizeof(query),
	         "SELECT d.number, t.\"%s\" AS value FROM drops d JOIN series g ON g.id = d.series_id"
	         " JOIN of_tower t ON t.result_id = (SELECT max(id) FROM results WHERE drop_id = d.id)"
	         " WHERE g.name = ? AND value IS NOT NULL ORDER BY d.number",
	         quantity->key);
	result = sql_query(archive, &s, query, "s", series);
	if (result != 0)
		return result;
	while ((result = sql_step(archive, s)) > 0) {
		result = repeats_value(row, (size_t)sqlite3_column_int64(s, 0), sqlite3_column_double(s, 1));
		if (result != 0)
			break;
	}
	sqlite3_finalize(s);
	if (result == 0)
		repeats_row_close(row);
	else
		repeats_row_free(row);
	return result == DT_E_MEMORY ? archive_refuse(archive, result, "%s", error_text(result)) : result;
}
