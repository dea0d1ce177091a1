/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Photos of drops: taken in, listed, shown. Of a path that is a series alone: those of its next drop.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/base/room.h"
#include "host/console/work_private.h"

void work_photo(struct job *job)
{
	struct work *work = job->console->work;
	const char *when = job->query(job, "when");
	bool after = when != NULL && strcmp(when, "after") == 0;
	int result;

	if (!after && (when == NULL || strcmp(when, "before") != 0)) {
		job_refuse(job, 400, "\"when\": expected before or after");
	} else if (work->view.disk_free_bytes < ROOM_RESERVE_BYTES + (double)job->photo_size) {
		job_refuse(job, 507, "%.0f MB left on the disk, which drops need",
		           work->view.disk_free_bytes / 1e6);
	} else {
		result = archive_photo(work->archive, job->path, after, work->options.operator_name,
		                       job->photo, job->photo_size);
		if (result != 0) {
			work_refuse(job, result);
			return;
		}
		work_changed(work);
		job_answer_json(job, cJSON_CreateObject());
	}
	job_done(job);
}

static int list_photo(void *context, const struct archive_photo *photo)
{
	cJSON *array = context, *one = cJSON_CreateObject();

	cJSON_AddStringToObject(one, "when", photo->after ? "after" : "before");
	cJSON_AddStringToObject(one, "file", photo->file);
	cJSON_AddNumberToObject(one, "bytes", (double)photo->bytes);
	cJSON_AddStringToObject(one, "sha256", photo->sha256);
	cJSON_AddBoolToObject(one, "waits", photo->waits);
	cJSON_AddItemToArray(array, one);
	return 0;
}

void work_photos(struct job *job)
{
	cJSON *tree = cJSON_CreateObject(), *array = cJSON_AddArrayToObject(tree, "photos");
	int result = archive_each_photo(job->console->work->archive, job->path, list_photo, array);

	if (result != 0) {
		cJSON_Delete(tree);
		work_refuse(job, result);
		return;
	}
	job_answer_json(job, tree);
	job_done(job);
}

/* The one that was asked for by its SHA-256. */
struct wanted {
	struct job *job;
	const char *sha256;
	bool found;
};

static int answer_photo(void *context, const struct archive_photo *photo)
{
	struct wanted *wanted = context;
	char *bytes;
	size_t size;
	int result;

	if (wanted->found || strcmp(photo->sha256, wanted->sha256) != 0)
		return 0;
	result = archive_photo_bytes(wanted->job->console->work->archive, photo, &bytes, &size);
	if (result != 0)
		return result;
	wanted->found = true;
	job_answer_bytes(wanted->job, photo->type, bytes, size);
	return 0;
}

void work_photo_bytes(struct job *job)
{
	const char *sha256 = job->query(job, "sha256");
	struct wanted wanted = {.job = job, .sha256 = sha256 != NULL ? sha256 : ""};
	int result = archive_each_photo(job->console->work->archive, job->path, answer_photo, &wanted);

	if (result != 0) {
		work_refuse(job, result);
		return;
	}
	if (!wanted.found)
		job_refuse(job, 404, "no such photo");
	job_done(job);
}

void work_photos_discard(struct job *job)
{
	struct work *work = job->console->work;
	const char *series = job_text(job, "series", NULL);
	int result = series != NULL ? archive_discard_photos(work->archive, series) : 0;

	if (result != 0) {
		work_refuse(job, result);
		return;
	}
	if (series != NULL) {
		work_changed(work);
		job_answer_json(job, cJSON_CreateObject());
	}
	job_done(job);
}
