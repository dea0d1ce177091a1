/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/command/archived.h"

#include <droptower_version.h>
#include <errno.h>
#include <limits.h>
#include <pwd.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#include "host/command/command.h"
#include "host/command/evaluate.h"
#include "host/record/metadata.h"
#include "host/record/read.h"

const char *archived_folder(const char *given)
{
	const char *named = getenv("DROPTOWER_ARCHIVE");

	if (given != NULL)
		return given;
	return named != NULL && named[0] != '\0' ? named : "archive";
}

const char *archived_operator(const char *given)
{
	const char *user = getenv("USER");
	const struct passwd *login;

	if (given != NULL)
		return given;
	if (user != NULL && user[0] != '\0')
		return user;
	login = getpwuid(geteuid());
	return login != NULL ? login->pw_name : "";
}

int archived_failed(const struct archive *archive)
{
	command_error("%s", archive_message(archive));
	return COMMAND_INPUT;
}

static int write_scene(void *context, const struct archive_series *series)
{
	const int *fd = context;
	size_t length = strlen(series->scene);

	return write(*fd, series->scene, length) == (ssize_t)length ? 0 : DT_E_SYSTEM;
}

int archived_scene_file(struct archive *archive, const char *series, char file[ARCHIVED_SCENE_MAX])
{
	struct archive_filter filter = archive_filter_none();
	int fd = memfd_create("scene", MFD_CLOEXEC);

	filter.series = series;
	if (fd < 0 || archive_each_series(archive, &filter, write_scene, &fd) != 0) {
		command_error("the scene of %s: %s", series, strerror(errno));
		if (fd >= 0)
			close(fd);
		return COMMAND_INPUT;
	}
	snprintf(file, ARCHIVED_SCENE_MAX, "/proc/%ld/fd/%d", (long)getpid(), fd);
	return COMMAND_DONE;
}

/* A reader that refuses names the copy it was given: the log is meant. */
static void name_log(const struct archive_log *log, const char *said, char message[ARCHIVE_MESSAGE_MAX])
{
	size_t length = strlen(log->file);

	if (strncmp(said, log->file, length) == 0)
		snprintf(message, ARCHIVE_MESSAGE_MAX, "%s%.500s", log->raw, said + length);
	else
		snprintf(message, ARCHIVE_MESSAGE_MAX, "%.600s", said);
}

int archived_read(struct archive *archive, const char *drop, struct record *record,
                  char fault[ARCHIVE_MESSAGE_MAX], char message[ARCHIVE_MESSAGE_MAX])
{
	char said[READ_MESSAGE_MAX];
	struct archive_log log;
	int result = archive_open_log(archive, drop, &log);

	if (result != 0) {
		snprintf(message, ARCHIVE_MESSAGE_MAX, "%s", archive_message(archive));
		return result;
	}
	if (fault != NULL) {
		memcpy(fault, log.fault, sizeof(log.fault));
	} else if (log.fault[0] != '\0') {
		snprintf(message, ARCHIVE_MESSAGE_MAX, "%.100s: %.500s", drop, log.fault);
		archive_close_log(&log);
		return DT_E_CORRUPT;
	}
	result = read_record(record, log.file, NULL, said);
	if (result == 0) {
		record->time_s = log.time_s;
		metadata_take_words(record->operator_name, log.operator_name);
		record->simulated = log.simulated;
		snprintf(record->file, sizeof(record->file), "%s", log.raw);
	} else {
		name_log(&log, said, message);
	}
	archive_close_log(&log);
	return result;
}

/* ---- a log that stands in an archive ---- */

struct origin {
	struct record *record;
	char serials[METADATA_TEXT_MAX];
};

static int take_origin(void *context, const struct archive_drop *drop)
{
	struct record *record = ((struct origin *)context)->record;
	struct tm utc = {0};

	if (strptime(drop->time, "%Y-%m-%dT%H:%M:%SZ", &utc) != NULL)
		record->time_s = timegm(&utc);
	metadata_take_words(record->operator_name, drop->operator_name);
	metadata_take_words(record->scene, drop->series.scene_name);
	record->simulated = drop->simulated;
	return 0;
}

static int take_serial(void *context, const struct sensor_used *used)
{
	struct origin *origin = context;
	size_t at = strlen(origin->serials);

	snprintf(origin->serials + at, sizeof(origin->serials) - at, "%s%s %s", at > 0 ? ";" : "", used->name,
	         used->serial);
	return 0;
}

/* The folder of the archive that a file would be a log of; false: of none. */
static bool folder_of_log(const char *file, char folder[PATH_MAX])
{
	char path[PATH_MAX], index[PATH_MAX + 16], *slash;

	if (realpath(file, path) == NULL)
		return false;
	for (int up = 0; up < 4; up++) { /* raw/YEAR/SERIES/LOG */
		slash = strrchr(path, '/');
		if (slash == NULL || (up == 3 && strcmp(slash, "/raw") != 0))
			return false;
		*slash = '\0';
	}
	snprintf(folder, PATH_MAX, "%s", path);
	snprintf(index, sizeof(index), "%s/index.sqlite", folder);
	return access(index, R_OK) == 0;
}

void archived_origin(const char *file, struct record *record)
{
	char message[ARCHIVE_MESSAGE_MAX], folder[PATH_MAX], drop[ARCHIVE_NAME_MAX + 16];
	struct archive_filter filter = archive_filter_none();
	struct origin origin = {.record = record};
	struct archive *archive;

	if (record->operator_name[0] != '\0' || !folder_of_log(file, folder) ||
	    (archive = archive_open(folder, ARCHIVE_READ, message)) == NULL)
		return;
	if (archive_find(archive, file, drop) == 1) {
		char *slash = strchr(drop, '/');
		bool known = archive_each_sensor(archive, drop, NULL, take_serial, &origin) == 0;

		filter.number = (unsigned)strtoul(slash + 1, NULL, 10);
		*slash = '\0';
		filter.series = drop;
		if (archive_each_drop(archive, &filter, take_origin, &origin) == 0 && known)
			metadata_take_words(record->sensors, origin.serials);
	}
	archive_close(archive);
}

/* The result does not depend on where the archive stands. */
static int command_archived_analyse(struct archive *archive, const char *drop, const struct scene *scene,
                                    const char *chain, struct record *record,
                                    char message[ARCHIVE_MESSAGE_MAX])
{
	struct evaluated e;
	struct result said;
	char *json = evaluate_json(&e, record, scene, chain);
	int result;

	if (json == NULL) {
		snprintf(message, ARCHIVE_MESSAGE_MAX, "%.500s: cannot be analysed; kept without a result",
		         record->file);
		return DT_E_FORMAT;
	}
	said = evaluate_said(&e);
	result = archive_result(archive, drop, DT_VERSION, &said, json);
	if (result != 0)
		snprintf(message, ARCHIVE_MESSAGE_MAX, "%s", archive_message(archive));
	evaluate_close(&e);
	free(json);
	return result;
}

static int count_sensor(void *context, const struct sensor_used *used)
{
	(void)used;
	(*(size_t *)context)++;
	return 0;
}

/* A result that a laboratory has signed does not lose its uncertainties by a word left out. */
static int lacks_sensors(struct archive *archive, const char *drop, const struct scene *scene,
                         const char *chain, char message[ARCHIVE_MESSAGE_MAX])
{
	size_t count = 0;
	int result = archive_each_sensor(archive, drop, NULL, count_sensor, &count);

	if (result == DT_E_EMPTY || (result == 0 && (count == 0 || chain != NULL || scene->chain[0] != '\0')))
		return 0;
	if (result != 0) {
		snprintf(message, ARCHIVE_MESSAGE_MAX, "%.100s: %s", drop, error_text(result));
		return result;
	}
	snprintf(message, ARCHIVE_MESSAGE_MAX,
	         "%.100s: its result rests on the files of %zu sensors: expected --chain", drop, count);
	return DT_E_STATE;
}

int archived_result(struct archive *archive, const char *series, unsigned number, const char *chain,
                    char fault[ARCHIVE_MESSAGE_MAX], char message[ARCHIVE_MESSAGE_MAX])
{
	char drop[ARCHIVE_NAME_MAX + 16];
	struct scene scene;
	struct record record;
	int result = archive_scene(archive, series, &scene);

	fault[0] = '\0';
	snprintf(message, ARCHIVE_MESSAGE_MAX, "%s", archive_message(archive));
	if (result != 0)
		return result;
	snprintf(drop, sizeof(drop), "%.60s/%u", series, number);
	result = lacks_sensors(archive, drop, &scene, chain, message);
	if (result == 0)
		result = archived_read(archive, drop, &record, fault, message);
	if (result != 0)
		return result;
	result = command_archived_analyse(archive, drop, &scene, chain, &record, message);
	record_free(&record);
	return result;
}

int archived_analyse(struct archive *archive, const char *series, unsigned number, const char *chain)
{
	char message[ARCHIVE_MESSAGE_MAX], fault[ARCHIVE_MESSAGE_MAX];
	int result = archived_result(archive, series, number, chain, fault, message);

	if (fault[0] != '\0')
		command_error("%s; analysed again from the log, which is what was recorded", fault);
	if (result == 0)
		return COMMAND_DONE;
	command_error("%s", message);
	return COMMAND_INPUT;
}
