/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/command/list.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "common/wire_table.h"
#include "host/command/command.h"
#include "host/record/log_walk.h"
#include "host/base/put.h"

struct list {
	const char *file;
	bool begun;
	unsigned drops, whole;
};

enum { TIME_CHARS = 40, MARKS_CHARS = 160 };

/* Logs of candump and LCM have the time of day, what we write has the tower's clock. */
static const char *time_text(int64_t time_us, char text[TIME_CHARS])
{
	static const int64_t some_year_s = 100000000;
	time_t seconds = (time_t)(time_us / 1000000);
	struct tm day;
	size_t used;

	if (time_us == 0) {
		strcpy(text, "-");
		return text;
	}
	if (seconds < some_year_s || gmtime_r(&seconds, &day) == NULL) {
		snprintf(text, TIME_CHARS, "%.3f s", (double)time_us / 1e6);
		return text;
	}
	used = strftime(text, TIME_CHARS, "%Y-%m-%d %H:%M:%S", &day);
	snprintf(text + used, TIME_CHARS - used, ".%03dZ", (int)(time_us % 1000000 / 1000));
	return text;
}

static const char *crc_text(const struct log_capture *c)
{
	return !c->ended ? "unknown" : c->crc_agrees ? "agrees" : "differs";
}

static const char *seal_text(const struct log_capture *c)
{
	return !c->seal_known ? "unknown" : c->seal_agrees ? "agrees" : "differs";
}

static bool list_is_whole(const struct log_capture *c)
{
	return c->ended && c->crc_agrees && (c->seal_agrees || !c->seal_known);
}

static void blocks_text(const struct log_capture *c, char *text, size_t size)
{
	if (c->counters.blocks == 0)
		snprintf(text, size, "no block");
	else if (log_capture_missing(c) == 0)
		snprintf(text, size, "%" PRIu32 ", complete", log_capture_blocks(c));
	else
		snprintf(text, size, "%" PRIu64 ", %" PRIu32 " missing", c->counters.blocks,
		         log_capture_missing(c));
}

static void marks_text(const struct log_capture *c, char text[MARKS_CHARS])
{
	size_t used = 0;

	text[0] = '\0';
	if (!c->ended)
		used = (size_t)snprintf(text, MARKS_CHARS, "never ended ");
	for (unsigned bit = 0; bit < 16; bit++)
		if ((c->marks >> bit & 1u) != 0 && used < MARKS_CHARS)
			used += (size_t)snprintf(text + used, MARKS_CHARS - used, "%s ", wire_mark_name(bit));
	if (c->seal_known && !c->seal_agrees && used < MARKS_CHARS)
		used += (size_t)snprintf(text + used, MARKS_CHARS - used, "ALTERED ");
	if (c->counters.corrupt > 0 && used < MARKS_CHARS)
		snprintf(text + used, MARKS_CHARS - used, "(%" PRIu64 " corrupt) ", c->counters.corrupt);
	text[strlen(text) > 0 ? strlen(text) - 1 : 0] = '\0';
}

static void list_head(struct list *list)
{
	if (!list->begun)
		printf("%s\n%5s %5s  %-25s %-21s  %-18s %-8s %s\n", list->file, "N", "drop", "ended", "ticks",
		       "blocks", "CRC-32", "marks");
	list->begun = true;
}

static int list_row(void *context, const struct log_capture *c, struct record *record)
{
	struct list *list = context;
	char time[TIME_CHARS], ticks[32] = "", blocks[32], marks[MARKS_CHARS];

	(void)record; /* none is asked for */
	list_head(list);
	if (c->last_tick_ms - c->first_tick_ms + 1 > 0)
		snprintf(ticks, sizeof(ticks), "%" PRIu32 "..%" PRIu32, c->first_tick_ms, c->last_tick_ms);
	blocks_text(c, blocks, sizeof(blocks));
	marks_text(c, marks);
	printf("%5u %5u  %-25s %-21s  %-18s %*s%s%s\n", c->number, c->drop_id, time_text(c->time_us, time),
	       ticks, blocks, marks[0] != '\0' ? -8 : 0, crc_text(c), marks[0] != '\0' ? " " : "", marks);
	list->drops++;
	list->whole += list_is_whole(c);
	return 0;
}

static int row_of_event(void *context, const struct log_event *e)
{
	char time[TIME_CHARS], first[TIME_CHARS];

	list_head(context);
	switch (e->kind) {
	case LOG_START:
		printf("              %-25s the tower started\n", time_text(e->time_us, time));
		break;
	case LOG_FAULT:
		printf("              %-25s fault %s (0x%04X), tick %" PRIu32 "\n",
		       time_text(e->time_us, time), wire_fault_name(e->fault), e->emcy, e->tick_ms);
		break;
	case LOG_HEARTBEATS:
		printf("              %-25s to %s: %" PRIu64 " heartbeats, longest silence %.3f s\n",
		       time_text(e->first_us, first), time_text(e->time_us, time), e->count,
		       (double)e->longest_us / 1e6);
		break;
	}
	return 0;
}

/* ---- JSON ---- */

static cJSON *list_start(struct builder *b, const struct list *list, const char *what, int64_t time_us)
{
	cJSON *root = cJSON_CreateObject();

	b->failed = root == NULL;
	put_text(b, root, "file", list->file);
	put_text(b, root, "what", what);
	put_number(b, root, "time_s", (double)time_us / 1e6);
	return root;
}

static void put_marks(struct builder *b, cJSON *root, const struct log_capture *c)
{
	cJSON *marks = put_array(b, root, "marks");

	for (unsigned bit = 0; bit < 16; bit++) {
		cJSON *name = (c->marks >> bit & 1u) != 0 ? cJSON_CreateString(wire_mark_name(bit)) : NULL;

		if (name != NULL)
			cJSON_AddItemToArray(marks, name);
	}
}

static void put_parameters(struct builder *b, cJSON *root, const struct log_capture_parameters *p)
{
	cJSON *parameters = put_object(b, root, "parameters");

	for (unsigned i = 0; i < WIRE_PARAMETERS; i++)
		if (p->known[i])
			put_number(b, parameters, wire_parameters[i].name, p->value[i]);
}

static int object(void *context, const struct log_capture *c, struct record *record)
{
	struct list *list = context;
	struct builder b;
	cJSON *root = list_start(&b, list, "drop", c->time_us);

	(void)record;
	put_number(&b, root, "number", c->number);
	put_number(&b, root, "drop_id", c->drop_id);
	put_bool(&b, root, "ended", c->ended);
	put_number(&b, root, "first_tick_ms", c->first_tick_ms);
	put_number(&b, root, "last_tick_ms", c->last_tick_ms);
	put_number(&b, root, "blocks", (double)c->counters.blocks);
	put_number(&b, root, "missing", log_capture_missing(c));
	put_number(&b, root, "corrupt", (double)c->counters.corrupt);
	put_text(&b, root, "crc", crc_text(c));
	put_text(&b, root, "seal", seal_text(c));
	put_marks(&b, root, c);
	put_parameters(&b, root, &c->parameters);
	list->drops++;
	return put_out(&b, root, stdout);
}

static int object_of_event(void *context, const struct log_event *e)
{
	static const char *const what[] = {
	        [LOG_START] = "start", [LOG_FAULT] = "fault", [LOG_HEARTBEATS] = "heartbeats"};
	struct builder b;
	cJSON *root = list_start(&b, context, what[e->kind], e->time_us);

	if (e->kind == LOG_FAULT) {
		put_text(&b, root, "fault", wire_fault_name(e->fault));
		put_number(&b, root, "emcy", e->emcy);
		put_number(&b, root, "tick_ms", e->tick_ms);
	}
	if (e->kind == LOG_HEARTBEATS) {
		put_number(&b, root, "first_s", (double)e->first_us / 1e6);
		put_number(&b, root, "count", (double)e->count);
		put_number(&b, root, "longest_silence_s", (double)e->longest_us / 1e6);
	}
	return put_out(&b, root, stdout);
}

int list_drops(const char *file, bool json)
{
	struct list list = {.file = file};
	struct log_visitor visitor = {.context = &list,
	                              .capture = json ? object : list_row,
	                              .event = json ? object_of_event : row_of_event};
	char message[READ_MESSAGE_MAX] = "";
	int result = read_list(file, &visitor, message);

	if (result != 0) {
		if (message[0] == '\0')
			return command_output_failed(strerror(errno));
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	if (!json)
		printf("%u %s, %u complete\n", list.drops, list.drops == 1 ? "drop" : "drops", list.whole);
	return COMMAND_DONE;
}
