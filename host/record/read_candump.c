/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * candump text: every line through the walk, as if the frames came now.
 */
#include <string.h>

#include "common/link/candump.h"
#include "host/record/log_walk.h"
#include "host/record/source.h"

enum {
	BUS_CHANGE_US = 1000000, /* an adapter that was plugged in again takes longer */
	BUS_RETURNS = 8,         /* a line whose bus was damaged returns once, and rarely twice alike */
};

/* The first line that says something begins with '(', and the first such line that goes on with a digit
 * stands behind none of another kind: "(s);(g)" is a text's line of units. */
bool candump_is(struct log_file *log)
{
	enum { LOOK_BYTES = 1 << 16 };
	struct log_line line = {.next = log->begin};

	while (log_file_next_line(log, log->begin + LOOK_BYTES, &line))
		if (line.length > 0 && line.text[0] != '#' &&
		    (line.text[0] != '(' || (line.length > 1 && line.text[1] >= '0' && line.text[1] <= '9')))
			return line.text[0] == '(';
	return false;
}

static bool is_of_tower(const struct frame *frame)
{
	return (frame->id == WIRE_ID_BLOCK_S1 && frame->length == WIRE_LENGTH_block) ||
	       (frame->id == WIRE_ID_HEARTBEAT_TOWER && frame->length == WIRE_LENGTH_heartbeat);
}

static bool is_blank(char c)
{
	return c == ' ' || c == '\t';
}

/* Behind the time; the line has been parsed. */
static const char *bus_in(const struct log_line *line)
{
	const char *end = line->text + line->length, *at = memchr(line->text, ')', line->length);

	while (++at < end && is_blank(*at))
		continue;
	return at;
}

static void take_bus(const struct log_line *line, char name[LOG_BUS_MAX])
{
	const char *end = line->text + line->length;
	size_t length = 0;

	for (const char *at = bus_in(line); at < end && !is_blank(*at) && length < LOG_BUS_MAX - 1; at++)
		name[length++] = *at;
	name[length] = '\0';
}

static bool is_same_bus(const struct log_line *line, const char *name)
{
	const char *at = bus_in(line);
	const size_t length = strlen(name);

	return (size_t)(line->text + line->length - at) > length && memcmp(at, name, length) == 0 &&
	       is_blank(at[length]);
}

/* Two towers, each on a bus of its own, would be taken for one that sends everything twice. */
static void check_bus(struct log_walk *walk, const struct log_line *line)
{
	struct log_bus now = {.time_us = walk->time_us};

	if (is_same_bus(line, walk->bus.name)) {
		walk->bus.time_us = walk->time_us;
		return;
	}
	take_bus(line, now.name);
	if (strcmp(now.name, walk->bus.name) != 0) {
		bool returns = strcmp(now.name, walk->bus_before.name) == 0 &&
		               now.time_us - walk->bus_before.time_us < BUS_CHANGE_US;

		walk->bus_returns = returns ? walk->bus_returns + 1 : 0;
		if (walk->bus_returns == BUS_RETURNS)
			walk->result = source_refuse(walk->message, DT_E_FORMAT, walk->file, line->number,
			                             "a tower on %s beside that on %s, expected the frames "
			                             "of one bus",
			                             now.name, walk->bus.name);
		walk->bus_before = walk->bus;
	}
	walk->bus = now;
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
		if (is_of_tower(&frame))
			check_bus(walk, &line);
		log_walk_frame(walk, &frame);
	}
}
