/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The tables, as the steps from one version to the next: an index says in user_version how many of them it
 * has had. A step that was released is never changed; a change is one more step.
 */
#include "host/archive/quantities.h"

/* "DrTw": the file is one of ours */
#define APPLICATION 0x44725477

static const char first[] =
        "CREATE TABLE campaigns (id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE, created TEXT NOT NULL);"
        "CREATE TABLE series (id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE,"
        " campaign_id INTEGER NOT NULL REFERENCES campaigns(id), scene_name TEXT NOT NULL,"
        " scene TEXT NOT NULL, angle_deg REAL NOT NULL, height_m REAL NOT NULL, plate_mass_kg REAL NOT NULL,"
        " planned INTEGER NOT NULL, created TEXT NOT NULL);"
        "CREATE INDEX series_by_campaign ON series(campaign_id);"
        "CREATE INDEX series_by_scene ON series(scene_name, angle_deg);"
        "CREATE TABLE drops (id INTEGER PRIMARY KEY, series_id INTEGER NOT NULL REFERENCES series(id),"
        " number INTEGER NOT NULL CHECK (number > 0),"
        " state TEXT NOT NULL CHECK (state IN ('recording', 'recorded', 'missing')),"
        " decision TEXT NOT NULL DEFAULT 'open' CHECK (decision IN ('open', 'accepted', 'rejected')),"
        " reason TEXT NOT NULL DEFAULT '' CHECK (decision <> 'rejected' OR reason <> ''),"
        " operator TEXT NOT NULL DEFAULT '', note TEXT NOT NULL DEFAULT '', raw TEXT NOT NULL UNIQUE,"
        " bytes INTEGER, sha256 TEXT CHECK (state <> 'recorded' OR length(sha256) = 64),"
        " time TEXT NOT NULL, UNIQUE (series_id, number));"
        "CREATE INDEX drops_by_time ON drops(time);"
        "CREATE INDEX drops_by_hash ON drops(sha256);"
        "CREATE INDEX drops_by_state ON drops(series_id, state, decision, time);"
        "CREATE TABLE versions (id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE, first_used TEXT NOT NULL);"
        "CREATE TABLE results (id INTEGER PRIMARY KEY, drop_id INTEGER NOT NULL REFERENCES drops(id)"
        " ON DELETE CASCADE, version_id INTEGER NOT NULL REFERENCES versions(id), time TEXT NOT NULL,"
        " not_ok INTEGER NOT NULL, flags TEXT NOT NULL);"
        "CREATE UNIQUE INDEX results_by_drop ON results(drop_id, version_id);"
        /* by itself: tables of numbers are read without it */
        "CREATE TABLE texts (result_id INTEGER PRIMARY KEY REFERENCES results(id) ON DELETE CASCADE,"
        " json TEXT NOT NULL);"
        "CREATE TABLE flags (result_id INTEGER NOT NULL REFERENCES results(id) ON DELETE CASCADE,"
        " channel TEXT NOT NULL, flag TEXT NOT NULL, PRIMARY KEY (result_id, channel, flag)) WITHOUT ROWID;";

/* Who decided what when, and the sensors' calibrations. */
static const char second[] =
        "CREATE TABLE events (id INTEGER PRIMARY KEY, drop_id INTEGER NOT NULL REFERENCES drops(id)"
        " ON DELETE CASCADE, time TEXT NOT NULL, what TEXT NOT NULL, operator TEXT NOT NULL,"
        " text TEXT NOT NULL);"
        "CREATE INDEX events_by_drop ON events(drop_id);"
        "CREATE TABLE calibrations (id INTEGER PRIMARY KEY, sensor TEXT NOT NULL, gain REAL NOT NULL,"
        " date TEXT NOT NULL, note TEXT NOT NULL, UNIQUE (sensor, date));";

/* Whether nothing fell; 0 where nobody said so. */
static const char third[] = "ALTER TABLE drops ADD COLUMN simulated INTEGER NOT NULL DEFAULT 0"
                            " CHECK (simulated IN (0, 1));";

/* Captures by what tells them apart: found again from the logs, so that no sidecar has them. */
static const char fourth[] =
        "CREATE TABLE captures (drop_id INTEGER PRIMARY KEY REFERENCES drops(id) ON DELETE CASCADE,"
        " key TEXT NOT NULL);"
        "CREATE INDEX captures_by_key ON captures(key);";

/* Whether its files are what was recorded; the entry of its sidecar in the chain, 0: none. */
static const char fifth[] =
        "ALTER TABLE drops ADD COLUMN entry INTEGER NOT NULL DEFAULT 0;"
        "ALTER TABLE drops ADD COLUMN proof TEXT NOT NULL DEFAULT ''"
        " CHECK (proof IN ('', 'altered', 'missing'));"
        "ALTER TABLE drops ADD COLUMN fault TEXT NOT NULL DEFAULT '';"
        "UPDATE drops SET proof = 'missing', fault = raw || ': missing', state = 'recorded'"
        " WHERE state = 'missing' AND length(sha256) = 64;"
        "CREATE TABLE chain (id INTEGER PRIMARY KEY CHECK (id = 1), entries INTEGER NOT NULL,"
        " head TEXT NOT NULL);";

/* By which table of quantities a result was made, and which one the index has its columns from. */
static const char sixth[] =
        "ALTER TABLE results ADD COLUMN quantities TEXT NOT NULL DEFAULT '';"
        "CREATE TABLE shape (id INTEGER PRIMARY KEY CHECK (id = 1), quantities TEXT NOT NULL);"
        "INSERT INTO shape VALUES (1, '');";
enum { WITH_QUANTITIES = 6 };

/* Calibrations stand in the sensors' files. */
static const char seventh[] = "DROP TABLE calibrations;";

static const char *const steps[] = {first, second, third, fourth, fifth, sixth, seventh};
enum { STEPS = sizeof(steps) / sizeof(steps[0]) };

static int version_of(struct archive *archive, int64_t *version)
{
	int64_t application = 0;
	int result = sql_number(archive, version, "PRAGMA user_version", "");

	if (result == 0)
		result = sql_number(archive, &application, "PRAGMA application_id", "");
	if (result != 0)
		return result;
	if (application != (*version == 0 ? 0 : APPLICATION))
		return archive_refuse(archive, DT_E_FORMAT, "%.400s/index.sqlite: not an index of droptower",
		                      archive->folder);
	if (*version > STEPS)
		return archive_refuse(
		        archive, DT_E_FORMAT,
		        "%.400s/index.sqlite: schema version %d, expected %d at most: made by a "
		        "newer droptower",
		        archive->folder, (int)*version, STEPS);
	return 0;
}

static int take_steps(struct archive *archive, int64_t version)
{
	char done[80];
	int result = 0;

	for (int64_t step = version; step < STEPS && result == 0; step++)
		result = sql_script(archive, steps[step]);
	snprintf(done, sizeof(done), "PRAGMA application_id = %d; PRAGMA user_version = %d", APPLICATION,
	         STEPS);
	return result != 0 ? result : sql_script(archive, done);
}

static int is_shaped(struct archive *archive, int64_t version, int64_t *shaped)
{
	*shaped = 0;
	return version < WITH_QUANTITIES
	               ? 0
	               : sql_number(archive, shaped, "SELECT COUNT(*) FROM shape WHERE quantities = ?", "s",
	                            quantity_version());
}

/* The columns of the results, which grow with quantity.def; results of before are taken from their texts. */
static int schema_shape(struct archive *archive, int64_t version)
{
	int result = quantities_shape(archive);

	if (result == 0 && version < WITH_QUANTITIES)
		result = quantities_fill(archive, 0);
	if (result == 0)
		result = sql_run(archive, "UPDATE shape SET quantities = ?", "s", quantity_version());
	return result;
}

int schema_upgrade(struct archive *archive)
{
	int64_t version = 0, shaped = 0;
	int result = sql_script(archive, "BEGIN"); /* for both numbers from one moment */

	if (result == 0)
		result = version_of(archive, &version);
	if (result == 0)
		result = is_shaped(archive, version, &shaped);
	result = archive_end(archive, result);
	if (result != 0 || (version == STEPS && shaped))
		return result;
	result = archive_start(archive);
	if (result != 0)
		return result;
	result = version_of(archive, &version); /* somebody else may have been quicker */
	if (result == 0 && version < STEPS)
		result = take_steps(archive, version);
	if (result == 0)
		result = schema_shape(archive, version);
	return archive_end(archive, result);
}
