/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * candump text: every line through the join, as if the frames came now.
 */
#include <string.h>

#include "common/link/candump.h"
#include "host/record/join.h"
#include "host/record/source.h"

struct reading {
	struct join *join;
	struct record kept; /* the last complete capture */
	bool has_kept;
	uint64_t frames, malformed;
	uint64_t first_malformed; /* its line */
	unsigned first_column;
};

/* Takes a capture as soon as it is complete, as a live host does. The last one of the log is the one to
 * read, unless it comes without a single block. */
static void keep(struct reading *reading)
{
	struct record record;

	if (!join_complete(reading->join) || join_take(reading->join, &record))
		return;
	if (reading->has_kept)
		record_free(&reading->kept);
	reading->kept = record;
	reading->has_kept = true;
}

static void read_lines(struct reading *reading, const struct source *source)
{
	struct source_line line = {0};

	while (source_next_line(source, &line)) {
		struct frame frame;
		unsigned column = 0;
		int result = candump_parse(line.text, line.length, &frame, &column);

		if (result < 0 && reading->malformed++ == 0) {
			reading->first_malformed = line.number;
			reading->first_column = column;
		}
		if (result <= 0)
			continue;
		reading->frames++;
		join_feed(reading->join, &frame);
		keep(reading);
	}
}

static int finish(struct reading *reading, struct record *record, const struct source *source, char *message)
{
	int error = DT_E_EMPTY;

	if (join_has_capture(reading->join) || !reading->has_kept)
		error = join_take(reading->join, record);
	if (error && reading->has_kept) {
		*record = reading->kept;
		reading->has_kept = false;
		error = 0;
	}
	if (error == DT_E_EMPTY && reading->frames == 0 && reading->malformed)
		return source_refuse(message, DT_E_FORMAT, source->file, reading->first_malformed,
		                     "no frame from column %u on, expected \"(seconds) interface id#data\"",
		                     reading->first_column);
	if (error == DT_E_EMPTY)
		return source_refuse(message, error, source->file, 0,
		                     "no block of a drop tower in %llu frames",
		                     (unsigned long long)reading->frames);
	if (error)
		return source_refuse(message, error, source->file, 0, "%s", error_text(error));
	strcpy(record->format, "candump");
	record->counters.corrupt += reading->malformed;
	return 0;
}

int read_candump(struct record *record, const struct source *source, char message[READ_MESSAGE_MAX])
{
	struct reading reading = {.join = join_create()};
	int error;

	if (!reading.join)
		return source_refuse(message, DT_E_MEMORY, source->file, 0, "%s", error_text(DT_E_MEMORY));
	read_lines(&reading, source);
	error = finish(&reading, record, source, message);
	if (reading.has_kept)
		record_free(&reading.kept);
	join_destroy(reading.join);
	return error;
}
