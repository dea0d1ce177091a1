/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/command/archived.h"

#include <droptower_version.h>
#include <errno.h>
#include <pwd.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "host/command/command.h"
#include "host/command/evaluate.h"
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
	if (user != NULL)
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

/* The result does not depend on where the archive stands. */
static char *analyse(struct archive *archive, const struct scene *scene, const char *raw,
                     char message[ARCHIVE_MESSAGE_MAX])
{
	char path[ARCHIVE_PATH_MAX], *json;
	struct record record;

	snprintf(path, sizeof(path), "%s/%.100s", archive_folder(archive), raw);
	if (read_record(&record, path, NULL, message) != 0)
		return NULL;
	snprintf(record.file, sizeof(record.file), "%.200s", raw);
	json = evaluate_json(&record, scene);
	record_free(&record);
	if (json == NULL)
		snprintf(message, ARCHIVE_MESSAGE_MAX, "%.500s: cannot be analysed; kept without a result",
		         path);
	return json;
}

int archived_result(struct archive *archive, const char *series, unsigned number, const char *raw,
                    char message[ARCHIVE_MESSAGE_MAX])
{
	char drop[ARCHIVE_NAME_MAX + 16], *json;
	struct scene scene;
	int result = archive_scene(archive, series, &scene);

	if (result == 0) {
		json = analyse(archive, &scene, raw, message);
		if (json == NULL)
			return DT_E_FORMAT;
		snprintf(drop, sizeof(drop), "%s/%u", series, number);
		result = archive_result(archive, drop, DT_VERSION, json);
		free(json);
	}
	if (result != 0)
		snprintf(message, ARCHIVE_MESSAGE_MAX, "%s", archive_message(archive));
	return result;
}

int archived_analyse(struct archive *archive, const char *series, unsigned number, const char *raw)
{
	char message[ARCHIVE_MESSAGE_MAX];

	if (archived_result(archive, series, number, raw, message) == 0)
		return COMMAND_DONE;
	command_error("%s", message);
	return COMMAND_INPUT;
}
