/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * At the start: drops that a console before us had collected and could not note any more. The tower has
 * forgotten such a drop, since it was told that it is kept; its log has it.
 */
#include <stdio.h>
#include <string.h>

#include "common/link/link.h"
#include "host/command/archived.h"
#include "host/console/work_private.h"
#include "host/record/read.h"

enum { RECOVER_MAX = 64 }; /* at one start */

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
	char url[ARCHIVE_PATH_MAX + 8], message[READ_MESSAGE_MAX];
	struct link *link;
	struct frame frame;
	bool accepted = false;

	snprintf(url, sizeof(url), "log:%s", log);
	link = link_open(url, LINK_READ, message, sizeof(message));
	if (link == NULL)
		return false;
	while (link_receive(link, &frame, 0) == 1)
		accepted |=
		        frame.id == WIRE_ID_COMMAND && frame.length > 0 && frame.data[0] == WIRE_OP_ACCEPT;
	(void)link_close(link);
	return accepted;
}

static bool work_recover_is_whole(const char *log)
{
	char message[READ_MESSAGE_MAX];
	struct record record;
	bool whole;

	if (read_record(&record, log, NULL, message) != 0)
		return false;
	whole = record.lost_samples == 0 && record.crc_agrees;
	record_free(&record);
	return whole;
}

static void recover(struct work *work, const char *drop)
{
	char message[ARCHIVE_MESSAGE_MAX], fault[ARCHIVE_MESSAGE_MAX];
	struct archive_recording r;

	if (archive_resume(work->archive, drop, &r) != 0)
		return;
	if (!was_accepted(r.log) || !work_recover_is_whole(r.log)) {
		archive_abandon(&r);
		return;
	}
	if (archive_finish(work->archive, &r, 0,
	                   "the console ended before it was noted; the log is complete") != 0)
		work_trouble(work, archive_message(work->archive));
	else if (archived_result(work->archive, r.series, r.number, fault, message) != 0)
		work_trouble(work, message);
	work_changed(work);
}

void work_recover(struct work *work)
{
	struct archive_filter filter = archive_filter_none();
	static struct interrupted found; /* the work thread's */

	found.count = 0;
	if (archive_each_drop(work->archive, &filter, note_interrupted, &found) != 0)
		return;
	for (size_t i = 0; i < found.count; i++)
		recover(work, found.drop[i]);
}
