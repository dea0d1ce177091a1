/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A drop's way into the archive. What was collected is not lost: where the archive does not take it, its
 * frames go into a file of their own, and the view tells which.
 */
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "common/link/link.h"
#include "host/base/room.h"
#include "host/command/archived.h"
#include "host/console/work_private.h"
#include "host/record/write.h"

enum { RECOVER_MAX = 64 }; /* at one start */

/* ---- before ---- */

void work_keep_begin(struct job *job)
{
	struct work *work = job->console->work;
	struct handover_drop *drop = job->payload;
	int result = 0;

	if (work->view.disk_free_bytes < ROOM_RESERVE_BYTES) {
		job_refuse(job, 507, "%.0f MB left on the disk, expected %.0f MB for a drop",
		           work->view.disk_free_bytes / 1e6, ROOM_RESERVE_BYTES / 1e6);
	} else {
		result = archive_begin(work->archive, drop->series, work->options.operator_name, ".log",
		                       drop->simulated, &drop->recording);
		if (result != 0)
			job_refuse(job, work_status(result), "%s", archive_message(work->archive));
	}
	job->message = JOB_RUN;
	if (drop->recording.lock >= 0 && job_put(&job->console->tower_queue, job) == 0) {
		work_changed(work);
		return;
	}
	if (drop->recording.lock >= 0) {
		archive_discard(work->archive, &drop->recording);
		job_refuse(job, 503, "the tower's thread takes nothing more");
	}
	record_free(&drop->record);
	free(drop);
	job_done(job);
}

/* ---- after ---- */

static int work_keep_send_frame(void *context, const struct frame *frame)
{
	return link_send(context, frame);
}

/* Writes the record's frames into the log, instead of what is there. */
static int write_log(struct handover_drop *drop, char message[ARCHIVE_MESSAGE_MAX])
{
	struct link *log;
	int result;

	if (truncate(drop->recording.log, 0) != 0) {
		snprintf(message, ARCHIVE_MESSAGE_MAX, "%.500s: %s", drop->recording.log, strerror(errno));
		return DT_E_SYSTEM;
	}
	log = link_open_log(drop->recording.log, LINK_WRITE, message, ARCHIVE_MESSAGE_MAX);
	if (log == NULL)
		return DT_E_SYSTEM;
	result = write_frames(&drop->record, work_keep_send_frame, log);
	if (link_close(log) != 0 && result == 0)
		result = DT_E_SYSTEM;
	if (result != 0)
		snprintf(message, ARCHIVE_MESSAGE_MAX, "%.500s: could not be written", drop->recording.log);
	return result;
}

/* A disk that was full for a moment leaves a log with holes, and no error afterwards. expected: what came;
 * NULL: every sample. */
static bool work_keep_is_whole(const char *log, const struct record *expected)
{
	char message[READ_MESSAGE_MAX];
	struct record read;
	bool whole;

	if (read_record(&read, log, NULL, message) != 0)
		return false;
	whole = expected == NULL
	                ? read.lost_samples == 0 && read.crc_agrees
	                : read.drop_id == expected->drop_id && read.lost_samples <= expected->lost_samples &&
	                          read.crc_agrees >= expected->crc_agrees;
	record_free(&read);
	return whole;
}

static int record_drop(struct work *work, struct handover_drop *drop, char message[ARCHIVE_MESSAGE_MAX])
{
	int result = 0;

	if (drop->recording.lock < 0)
		result = archive_begin(work->archive, drop->series, work->options.operator_name, ".log",
		                       drop->simulated, &drop->recording);
	if (result == 0 && !work_keep_is_whole(drop->recording.log, &drop->record) &&
	    write_log(drop, message) != 0) {
		archive_abandon(&drop->recording);
		return DT_E_SYSTEM;
	}
	if (result == 0)
		result = archive_finish(work->archive, &drop->recording, 0, drop->note);
	if (result != 0)
		snprintf(message, ARCHIVE_MESSAGE_MAX, "%s", archive_message(work->archive));
	return result;
}

/* The frames to where there is room; message is what the archive said, and then also where they are. */
static bool rescue(const struct work *work, const struct handover_drop *drop,
                   char message[ARCHIVE_MESSAGE_MAX])
{
	/* a service's own /tmp goes with it; what stays is its folder in memory */
	const char *folder[] = {archive_folder(work->archive), getenv("RUNTIME_DIRECTORY"), "/var/tmp",
	                        "/tmp"};
	char path[ARCHIVE_PATH_MAX], why[READ_MESSAGE_MAX];
	size_t length;

	for (size_t i = 0; i < sizeof(folder) / sizeof(folder[0]); i++) {
		if (folder[i] == NULL)
			continue;
		snprintf(path, sizeof(path), "%s/rescued-%" PRId64 "-drop-%u.log", folder[i],
		         (int64_t)time(NULL), drop->record.drop_id);
		if (write_record(&drop->record, path, why) != 0)
			continue;
		length = strnlen(message, ARCHIVE_MESSAGE_MAX / 2);
		snprintf(message + length, ARCHIVE_MESSAGE_MAX - length,
		         "; the drop is in %s, 'droptower series add' takes it in", path);
		return true;
	}
	length = strnlen(message, ARCHIVE_MESSAGE_MAX / 2);
	snprintf(message + length, ARCHIVE_MESSAGE_MAX - length,
	         "; no place was found for the drop's frames, %s has what came",
	         drop->recording.log[0] != '\0' ? drop->recording.log : "nothing");
	return false;
}

void work_keep_drop(struct job *way)
{
	struct handover_drop *drop = way->maker;
	struct work *work = way->console->work;
	const struct archive_recording *r = &drop->recording;
	char name[ARCHIVE_NAME_MAX + 16] = "", message[ARCHIVE_MESSAGE_MAX] = "", fault[ARCHIVE_MESSAGE_MAX];
	bool analysed = false;

	drop->on_disk = true;
	if (record_drop(work, drop, message) != 0) {
		drop->on_disk = rescue(work, drop, message);
	} else {
		snprintf(name, sizeof(name), "%s/%u", r->series, r->number);
		analysed = archived_result(work->archive, r->series, r->number, NULL, fault, message) == 0;
	}
	work_changed(work);
	pthread_mutex_lock(&work->lock);
	if (analysed)
		strcpy(work->view.result, name);
	snprintf(work->view.trouble, sizeof(work->view.trouble), "%s", analysed ? "" : message);
	pthread_mutex_unlock(&work->lock);
	record_free(&drop->record);
	snprintf(drop->trouble, sizeof(drop->trouble), "%s", name[0] != '\0' ? "" : message);
	way->message = JOB_SAVED;
	if (job_put_first(&work->console->tower_queue, way) != 0)
		free(drop);
}

/* What there is of it stays, partial, with a word why. */
static void leave(struct work *work, struct handover_drop *drop)
{
	char name[ARCHIVE_NAME_MAX + 16];

	archive_abandon(&drop->recording);
	snprintf(name, sizeof(name), "%s/%u", drop->recording.series, drop->recording.number);
	if (drop->note[0] != '\0' &&
	    archive_note(work->archive, name, work->options.operator_name, drop->note) != 0)
		work_trouble(work, archive_message(work->archive));
}

void work_keep_discard(struct job *way)
{
	struct handover_drop *drop = way->maker;
	struct work *work = way->console->work;

	if (drop->recording.lock >= 0 && drop->released)
		leave(work, drop);
	else if (drop->recording.lock >= 0)
		archive_discard(work->archive, &drop->recording);
	work_changed(work);
	record_free(&drop->record);
	free(drop);
}

/* ---- at the start ---- */

/* Drops that a console before us had collected and could not note any more. The tower has forgotten such a
 * drop, since it was told that it is kept; its log has it. */
struct interrupted {
	char drop[RECOVER_MAX][ARCHIVE_NAME_MAX + 16];
	size_t count;
};

static int note_interrupted(void *context, const struct archive_drop *drop)
{
	struct interrupted *found = context;

	if (strcmp(drop->state, "interrupted") != 0 || found->count == RECOVER_MAX)
		return 0;
	snprintf(found->drop[found->count++], sizeof(found->drop[0]), "%s/%u", drop->series.name,
	         drop->number);
	return 0;
}

/* Whether we told the tower that we have the drop. One without that is still in the tower, which hands it
 * over. */
static bool was_accepted(const char *log)
{
	char message[READ_MESSAGE_MAX];
	struct link *link;
	struct frame frame;
	bool accepted = false;

	link = link_open_log(log, LINK_READ, message, sizeof(message));
	if (link == NULL)
		return false;
	while (link_receive(link, &frame, 0) == 1)
		accepted |=
		        frame.id == WIRE_ID_COMMAND && frame.length > 0 && frame.data[0] == WIRE_OP_ACCEPT;
	(void)link_close(link);
	return accepted;
}

static void recover(struct work *work, const char *drop)
{
	char message[ARCHIVE_MESSAGE_MAX], fault[ARCHIVE_MESSAGE_MAX];
	struct archive_recording r;

	if (archive_resume(work->archive, drop, &r) != 0)
		return;
	if (!was_accepted(r.log) || !work_keep_is_whole(r.log, NULL)) {
		archive_abandon(&r);
		return;
	}
	if (archive_finish(work->archive, &r, 0,
	                   "the console ended before it was noted; the log is complete") != 0)
		work_trouble(work, archive_message(work->archive));
	else if (archived_result(work->archive, r.series, r.number, NULL, fault, message) != 0)
		work_trouble(work, message);
	work_changed(work);
}

void work_keep_recover(struct work *work)
{
	struct archive_filter filter = archive_filter_none();
	static struct interrupted found; /* the work thread's */

	found.count = 0;
	if (archive_each_drop(work->archive, &filter, note_interrupted, &found) != 0)
		return;
	for (size_t i = 0; i < found.count; i++)
		recover(work, found.drop[i]);
}
