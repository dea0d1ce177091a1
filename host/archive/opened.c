/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/archive/proof.h"

#include <errno.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

static int proof_open_log(struct archive *archive, const struct archive_place *place, struct archive_log *log)
{
	struct proof proof;
	int result = proof_open(archive, &proof);

	if (result != 0)
		return result;
	proof.copy = log->copy;
	result = proof_of_drop(&proof, place->drop);
	if (result == 0 && proof.log_or_sidecar)
		result = archive_refuse(archive, DT_E_CORRUPT, "%s: %.500s", proof.name, proof.fault);
	if (result == 0 && lseek(log->copy, 0, SEEK_SET) != 0)
		result = archive_refuse(archive, DT_E_SYSTEM, "%s: %s", proof.name, strerror(errno));
	snprintf(log->fault, sizeof(log->fault), "%s", proof.fault);
	proof_close(&proof);
	return result;
}

static int find_origin(struct archive *archive, int64_t drop, struct archive_log *log)
{
	sqlite3_stmt *statement;
	int result = sql_query(archive, &statement,
	                       "SELECT CAST(strftime('%s', time) AS INTEGER), operator, simulated FROM drops"
	                       " WHERE id = ?",
	                       "i", drop);

	if (result != 0)
		return result;
	result = sql_step(archive, statement);
	if (result == 1) {
		log->time_s = sqlite3_column_int64(statement, 0);
		snprintf(log->operator_name, sizeof(log->operator_name), "%s", sql_text(statement, 1));
		log->simulated = sqlite3_column_int64(statement, 2) != 0;
	}
	sqlite3_finalize(statement);
	return result < 0 ? result : 0;
}

int archive_open_log(struct archive *archive, const char *drop, struct archive_log *log)
{
	struct archive_log opened = {.copy = -1};
	struct archive_place place;
	int result = archive_locate(archive, drop, &place);

	if (result == 0 && !place.recorded)
		result = archive_refuse(archive, DT_E_STATE, "%s was never completely recorded", drop);
	if (result != 0)
		return result;
	opened.copy = memfd_create("log", MFD_CLOEXEC);
	if (opened.copy < 0)
		return archive_refuse(archive, DT_E_SYSTEM, "%s: %s", drop, strerror(errno));
	strcpy(opened.series, place.name);
	strcpy(opened.raw, place.raw);
	opened.number = place.number;
	snprintf(opened.file, sizeof(opened.file), "/proc/self/fd/%d", opened.copy);
	result = find_origin(archive, place.drop, &opened);
	if (result == 0)
		result = proof_open_log(archive, &place, &opened);
	if (result == 0)
		*log = opened;
	else
		close(opened.copy);
	return result;
}

void archive_close_log(struct archive_log *log)
{
	close(log->copy);
	log->copy = -1;
}
