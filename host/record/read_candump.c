/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * candump text: every line through the walk, as if the frames came now.
 */
#include "common/link/candump.h"
#include "host/record/log_walk.h"

/* The first line that says something begins with '('. */
bool candump_is(struct log_file *log)
{
	enum { LOOK_BYTES = 1 << 16 };
	struct log_line line = {.next = log->begin};

	while (log_file_next_line(log, log->begin + LOOK_BYTES, &line))
		if (line.length > 0 && line.text[0] != '#')
			return line.text[0] == '(';
	return false;
}

void read_candump(struct log_walk *walk, struct log_file *log, uint64_t from, uint64_t to)
{
	struct log_contents *contents = walk->contents;
	struct log_line line = {.next = from > log->begin ? from : log->begin};

	while (walk->result == 0 && log_file_next_line(log, to, &line)) {
		struct frame frame;
		unsigned column = 0;
		int result = candump_parse(line.text, line.length, &frame, &column);

		walk->at = line.at;
		walk->next = line.next;
		if (result < 0 && contents->refused++ == 0) {
			contents->first_refused = line.number;
			contents->column = column;
		}
		walk->corrupt += result < 0;
		if (result <= 0)
			continue;
		contents->frames++;
		walk->time_us = frame.time_us;
		log_walk_frame(walk, &frame);
	}
}
