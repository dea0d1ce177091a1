/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Which captures are in an archive, whatever the files they came in.
 */
#include <string.h>

#include "host/archive/private.h"

int archive_find_capture(struct archive *archive, const char *key, char drop[ARCHIVE_NAME_MAX + 16])
{
	return archive_first_drop(
	        archive,
	        "SELECT s.name || '/' || d.number FROM captures c JOIN drops d ON d.id = c.drop_id"
	        " JOIN series s ON s.id = d.series_id WHERE c.key = ? LIMIT 1",
	        key, drop);
}

int archive_know_capture(struct archive *archive, int64_t drop, const char *key)
{
	return sql_run(archive, "INSERT OR REPLACE INTO captures (drop_id, key) VALUES (?, ?)", "is", drop,
	               key);
}

/* The next recorded drop behind *drop whose key is not known. 1, 0 after the last, or DT_E_*. */
static int next_unknown(struct archive *archive, int64_t *drop, char log[ARCHIVE_PATH_MAX])
{
	sqlite3_stmt *s;
	int result = sql_query(archive, &s,
	                       "SELECT id, raw FROM drops WHERE id > ? AND state = 'recorded'"
	                       " AND id NOT IN (SELECT drop_id FROM captures) ORDER BY id LIMIT 1",
	                       "i", *drop);

	if (result != 0)
		return result;
	result = sql_step(archive, s);
	if (result > 0) {
		*drop = sqlite3_column_int64(s, 0);
		snprintf(log, ARCHIVE_PATH_MAX, "%.4000s/%.200s", archive->folder, sql_text(s, 1));
	}
	sqlite3_finalize(s);
	return result;
}

int archive_ask_captures(struct archive *archive, int (*key_of)(const char *log, char key[ARCHIVE_KEY_MAX]))
{
	char log[ARCHIVE_PATH_MAX], key[ARCHIVE_KEY_MAX];
	int64_t drop = 0;
	int result;

	while ((result = next_unknown(archive, &drop, log)) > 0) {
		if (key_of(log, key) == 0)
			result = archive_know_capture(archive, drop, key);
		if (result < 0)
			break;
	}
	return result;
}
