/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/unit/archive_stock.h"

#include <sqlite3.h>
#include <stdio.h>

static const char series[] =
        "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < %u)"
        " INSERT INTO series (name, campaign_id, scene_name, scene, angle_deg, height_m, plate_mass_kg,"
        " planned, created) SELECT 'bulk-' || i, campaign_id, scene_name, scene, 15 + 5 * ((i - 1) %% 5),"
        " height_m, plate_mass_kg, 5, created FROM n, series WHERE series.name = 'first'";
static const char drops[] =
        "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < 5)"
        " INSERT INTO drops (series_id, number, state, decision, reason, raw, bytes, sha256, time)"
        " SELECT id, i, 'recorded', CASE i WHEN 5 THEN 'rejected' ELSE 'accepted' END,"
        " CASE i WHEN 5 THEN 'cable' ELSE '' END, 'raw/' || name || '/' || i || '.log', 1,"
        " printf('%%064d', 5 * id + i), printf('2026-%%02d-%%02dT08:00:00Z', 1 + id %% 12, 1 + i)"
        " FROM series, n WHERE name LIKE 'bulk-%%'";
static const char results[] = "INSERT OR IGNORE INTO versions (name, first_used) VALUES ('bulk', '2026');"
                              "INSERT INTO results (drop_id, version_id, time, not_ok, flags"
#define QUANTITY_COLUMN(NAME, name, unit, ...) "," name "_" unit "," name "_sigma_" unit
#include "host/result/quantity.def"
                              ") SELECT d.id, v.id, d.time, 0, ''"
#define QUANTITY_COLUMN(NAME, name, unit, ...) \
	",CASE '" name                         \
	"' WHEN 's1_x' THEN 290 + 10 * number WHEN 's2_x' THEN 580 + 20 * number ELSE 1 END, 0.5"
#include "host/result/quantity.def"
                              " FROM drops d, versions v WHERE v.name = 'bulk' AND raw LIKE 'raw/bulk-%%';"
                              "INSERT INTO texts SELECT id, printf('%%.*c', %u, 'x') FROM results";

static bool run(sqlite3 *index, const char *format, unsigned number)
{
	char *text = sqlite3_mprintf(format, number);
	bool done = text != NULL && sqlite3_exec(index, text, NULL, NULL, NULL) == SQLITE_OK;

	if (!done)
		fprintf(stderr, "archive_stock: %s\n", sqlite3_errmsg(index));
	sqlite3_free(text);
	return done;
}

bool archive_stock_fill(const char *folder, unsigned count, unsigned json_bytes)
{
	char path[4200];
	sqlite3 *index = NULL;
	bool done;

	snprintf(path, sizeof(path), "%s/index.sqlite", folder);
	done = sqlite3_open_v2(path, &index, SQLITE_OPEN_READWRITE, NULL) == SQLITE_OK &&
	       run(index, "BEGIN", 0) && run(index, series, count / 5) && run(index, drops, 0) &&
	       run(index, results, json_bytes) && run(index, "COMMIT", 0);
	sqlite3_close(index);
	return done;
}
