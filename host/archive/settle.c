/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A writer that died, or whose disk was full, between the chain and its commit has left an entry that was
 * never acknowledged. The next writer first enters what the index has of that sidecar, so that chain, file
 * and index say one thing again.
 */
#include <string.h>
#include <unistd.h>

#include "host/archive/sidecar.h"

/* Of a drop that never came into the index the empty log is there, too: both stay, and the index knows. */
static int settle_begun(struct archive *archive)
{
	struct chain_place place;
	int result = chain_next(archive, &place);

	return result != 0 ? result : chain_note(archive, place.number - 1, place.head);
}

/* Nothing in the index is of it. */
static int settle_removed(struct archive *archive, const char *file)
{
	char path[ARCHIVE_PATH_MAX];
	struct chain_place place;
	int result = chain_next(archive, &place);

	if (result == 0)
		result = chain_enter(archive, &place, file, 0, CHAIN_REMOVED);
	snprintf(path, sizeof(path), "%s/%.200s", archive->folder, file);
	if (result == 0)
		unlink(path);
	return result;
}

static int settle_series(struct archive *archive, const char *file, int64_t *row)
{
	int result = sql_number(archive, row,
	                        "SELECT id FROM series WHERE"
	                        " 'raw/' || substr(created, 1, 4) || '/' || name || '/series.ini' = ?",
	                        "s", file);

	return result == 0 ? sidecar_write_series(archive, *row) : result;
}

static int settle_file(struct archive *archive, const char *file)
{
	int64_t row;
	int result;

	if (sidecar_is_of_drop(file)) {
		result = sidecar_drop(archive, file, &row);
		if (result == 0)
			return sidecar_write_drop(archive, row);
		return result == DT_E_EMPTY ? settle_begun(archive) : result;
	}
	result = settle_series(archive, file, &row);
	return result == DT_E_EMPTY ? settle_removed(archive, file) : result;
}

int archive_change(struct archive *archive)
{
	char file[ARCHIVE_PATH_MAX];
	int result = archive_start(archive), left;

	if (result != 0)
		return result;
	left = chain_left(archive, file);
	if (left <= 0)
		return left < 0 ? archive_end(archive, left) : 0;
	result = archive_end(archive, settle_file(archive, file));
	return result != 0 ? result : archive_start(archive);
}
