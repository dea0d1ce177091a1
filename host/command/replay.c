/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <errno.h>
#include <getopt.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "common/base/number.h"
#include "common/link/candump.h"
#include "common/link/link.h"
#include "common/wire.h"
#include "common/wire_table.h"
#include "host/base/progress.h"
#include "host/command/command.h"
#include "host/session/publish.h"
#include "host/session/session.h"
#include "host/record/lcm_log.h"
#include "host/record/log_walk.h"
#include "host/record/read.h"

static const double CENTURY_S = 3.15e9;
static const double TOLD_AFTER_S = 2.0;

/* The plan: log time `origin_us` is now; speed 0 is as fast as possible. */
struct pace {
	double speed;
	bool begun;
	int64_t origin_us;
	struct timespec start;
};

enum {
	LISTEN_MS = 3000, /* a tower says ten times a second that it is there, and so does a bridge; a busy
	                     one later */
	ROOM_MS = 2000,   /* a link that takes nothing for so long is stuck */
};

struct replay {
	const char *file, *to;
	struct pace pace;
	bool as_host;
	unsigned drop;        /* 0: all that is there */
	uint64_t from, until; /* of the log; 0 and its size */
	uint64_t sent, skipped;
	uint64_t withheld;                  /* what only a host may send */
	uint64_t states_sent, states_heard; /* over LCM we hear ourselves */
};

/* Waits until the moment that belongs to a log time. A time before the one before it is sent at once. */
static void keep_pace(struct pace *pace, int64_t time_us)
{
	struct timespec due;
	double after_s, whole_s;

	if (pace->speed <= 0.0)
		return;
	if (!pace->begun) {
		pace->begun = true;
		pace->origin_us = time_us;
		clock_gettime(CLOCK_MONOTONIC, &pace->start);
	}
	/* a damaged log may name any time: as doubles no difference overflows, and a century is for ever */
	after_s = ((double)time_us - (double)pace->origin_us) / 1e6 / pace->speed;
	if (!(after_s > 0.0))
		return;
	after_s = fmin(after_s, CENTURY_S) + (double)pace->start.tv_nsec / 1e9;
	whole_s = floor(after_s);
	due.tv_sec = pace->start.tv_sec + (time_t)whole_s;
	due.tv_nsec = (long)((after_s - whole_s) * 1e9);
	while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL) == EINTR && !interrupt_came())
		continue;
}

/* ---- what only a host may send ---- */

static bool is_hosts(const struct frame *frame)
{
	const struct wire_message *message;

	if ((frame->flags & (FRAME_EXTENDED | FRAME_ERROR)) != 0)
		return false;
	message = wire_message_of(frame->id);
	return message != NULL && strcmp(message->sender, "host") == 0;
}

static bool is_towers(const struct frame *frame)
{
	return (frame->flags & (FRAME_EXTENDED | FRAME_ERROR)) == 0 &&
	       (frame->id == WIRE_ID_HEARTBEAT_TOWER || frame->id == WIRE_ID_STATUS);
}

static int replay_refuse(const struct replay *replay)
{
	command_error("%s: a tower is heard there; --as-host is for a bus without one", replay->to);
	return COMMAND_REFUSED;
}

/* Whether a tower is heard within so long; what else comes is let go. */
static int listen_on_link(const struct replay *replay, struct link *to, int64_t listen_ms)
{
	int64_t until_ms = session_now_ms() + listen_ms;

	do {
		struct frame frame;
		int left_ms = (int)(until_ms - session_now_ms());
		int result = link_receive(to, &frame, left_ms > 0 ? left_ms : 0);

		if (result < 0)
			return command_link_failed(replay->to, result);
		if (result > 0 && is_towers(&frame))
			return replay_refuse(replay);
		if (result == 0 && left_ms <= 0)
			return COMMAND_DONE;
	} while (!interrupt_came());
	return COMMAND_DONE;
}

static bool is_live(const struct replay *replay)
{
	return replay->as_host && strncmp(replay->to, "log:", 4) != 0;
}

/* ---- frames ---- */

static int send_to_link(struct replay *replay, struct link *to, struct frame *frame)
{
	const struct timespec turn = {.tv_nsec = 1000000};
	int result;

	if (replay->pace.speed > 0.0)
		frame->time_us = 0; /* now */
	for (int turns = 0; (result = link_send(to, frame)) == DT_E_FULL && turns < ROOM_MS; turns++)
		nanosleep(&turn, NULL); /* the peers have to take what is on its way */
	return result;
}

/* To link or publisher. A COMMAND_* code. */
static int replay_send_frame(struct replay *replay, struct frame *frame, struct link *to,
                             struct publisher *publisher)
{
	int code = COMMAND_DONE, result;

	keep_pace(&replay->pace, frame->time_us);
	if (to != NULL && is_live(replay))
		code = listen_on_link(replay, to, 0);
	if (code != COMMAND_DONE)
		return code;
	result = to != NULL ? send_to_link(replay, to, frame) : publisher_frame(publisher, frame);
	if (result != 0)
		return command_link_failed(replay->to, result);
	replay->sent++;
	return COMMAND_DONE;
}

/* at: place in the log. */
static void tell_progress(const struct replay *replay, const struct log_file *log, uint64_t at,
                          struct progress *progress)
{
	uint64_t from = replay->from > log->begin ? replay->from : log->begin,
	         until = replay->until < log->size ? replay->until : log->size;

	progress_tell(progress, until > from ? (double)(at - from) / (double)(until - from) : (double)NAN,
	              "%" PRIu64 " sent", (uint64_t)replay->sent);
}

static int replay_frames(struct replay *replay, struct log_file *log, struct link *to,
                         struct publisher *publisher)
{
	bool copies = strncmp(replay->to, "log:", 4) == 0;
	int code = to != NULL && is_live(replay) ? listen_on_link(replay, to, LISTEN_MS) : COMMAND_DONE;
	struct log_line line = {.next = replay->from > log->begin ? replay->from : log->begin};
	struct progress progress;

	progress_begin(&progress, TOLD_AFTER_S);
	while (code == COMMAND_DONE && !interrupt_came() && log_file_next_line(log, replay->until, &line)) {
		struct frame frame;
		unsigned column;
		int result = candump_parse(line.text, line.length, &frame, &column);

		tell_progress(replay, log, line.at, &progress);
		if (result == 0)
			continue;
		if (result < 0 || (frame.flags & FRAME_ERROR) != 0)
			replay->skipped++; /* no frame, or a report of the bus and not a frame anybody sent */
		else if (is_hosts(&frame) && !copies && !replay->as_host)
			replay->withheld++;
		else
			code = replay_send_frame(replay, &frame, to, publisher);
	}
	progress_end(&progress);
	return code;
}

static int replay_candump(struct replay *replay, struct log_file *log)
{
	char message[512];
	bool to_lcm = publisher_wants(replay->to);
	struct publisher *publisher = NULL;
	struct link *to = NULL;
	int code;

	if (to_lcm)
		publisher = publisher_open(replay->to, message);
	else
		to = link_open(replay->to, strncmp(replay->to, "log:", 4) == 0 ? LINK_WRITE : LINK_READ_WRITE,
		               message, sizeof(message));
	if (to == NULL && publisher == NULL) {
		command_error("%s", message);
		code = COMMAND_LINK;
	} else {
		code = replay_frames(replay, log, to, publisher);
	}
	publisher_close(publisher);
	if (link_close(to) != 0 && code == COMMAND_DONE)
		code = command_link_failed(replay->to, DT_E_SYSTEM);
	return code;
}

/* ---- LCM events ---- */

static void replay_on_state(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
	struct replay *replay = user;

	(void)buffer;
	(void)channel;
	replay->states_heard++;
}

/* More states than our own come from a bridge, and it has a tower. */
static int listen_on_lcm(struct replay *replay, struct publisher *publisher, int64_t listen_ms)
{
	int64_t until_ms = session_now_ms() + listen_ms;

	do {
		int64_t left_ms = until_ms - session_now_ms();

		if (lcm_handle_timeout(publisher->lcm, left_ms > 0 ? (int)left_ms : 0) < 0)
			return command_link_failed(replay->to, DT_E_LINK);
		if (replay->states_heard > replay->states_sent)
			return replay_refuse(replay);
	} while (session_now_ms() < until_ms && !interrupt_came());
	return COMMAND_DONE;
}

static int send_event(struct replay *replay, const struct lcm_log_event *event, struct publisher *publisher)
{
	int code = COMMAND_DONE, result;

	keep_pace(&replay->pace, event->time_us);
	if (replay->as_host)
		code = listen_on_lcm(replay, publisher, 0);
	if (code != COMMAND_DONE)
		return code;
	result = publisher_raw(publisher, event->channel, event->data, event->size);
	if (result != 0)
		return command_link_failed(replay->to, result);
	replay->states_sent += strcmp(event->channel, PUBLISH_STATE) == 0;
	replay->sent++;
	return COMMAND_DONE;
}

static int replay_events(struct replay *replay, struct log_file *log, struct publisher *publisher)
{
	struct lcm_log_walk walk = {.at = replay->from, .end = replay->until};
	struct lcm_log_event event;
	struct progress progress;
	int code = COMMAND_DONE;

	if (replay->as_host) {
		code = publisher_listen(publisher, PUBLISH_STATE, replay_on_state, replay) == 0
		               ? listen_on_lcm(replay, publisher, LISTEN_MS)
		               : command_link_failed(replay->to, DT_E_LINK);
	}
	progress_begin(&progress, TOLD_AFTER_S);
	while (code == COMMAND_DONE && !interrupt_came() && lcm_log_next(log, &walk, &event)) {
		tell_progress(replay, log, walk.at, &progress);
		if (event.cut)
			continue;       /* counted as skipped */
		if (event.data == NULL) /* beyond what LCM sends */
			replay->skipped++;
		else if (strcmp(event.channel, PUBLISH_COMMAND) == 0 && !replay->as_host)
			replay->withheld++;
		else
			code = send_event(replay, &event, publisher);
	}
	progress_end(&progress);
	replay->skipped += walk.skipped;
	return code;
}

static int replay_lcm(struct replay *replay, struct log_file *log)
{
	char message[PUBLISH_MESSAGE_MAX];
	struct publisher *publisher;
	int code;

	if (!publisher_wants(replay->to))
		return command_usage("replay", "%s is an LCM event log, expected --to udpm://...",
		                     replay->file);
	publisher = publisher_open(replay->to, message);
	if (publisher == NULL) {
		command_error("%s", message);
		return COMMAND_LINK;
	}
	code = replay_events(replay, log, publisher);
	publisher_close(publisher);
	return code;
}

/* ---- one drop of many ---- */

static int replay_find(void *context, const struct log_capture *capture, struct record *record)
{
	struct replay *replay = context;

	(void)record; /* none is asked for */
	if (capture->number == replay->drop) {
		replay->from = capture->from;
		replay->until = capture->to;
	}
	return 0;
}

static int find_drop(struct replay *replay)
{
	struct log_visitor visitor = {.context = replay, .capture = replay_find};
	char message[READ_MESSAGE_MAX];

	if (replay->drop == 0)
		return COMMAND_DONE;
	replay->until = 0;
	if (read_list(replay->file, &visitor, message) != 0)
		command_error("%s", message);
	else if (replay->until == 0)
		command_error("%s: no drop %u: 'droptower analyze --list' shows them", replay->file,
		              replay->drop);
	else
		return COMMAND_DONE;
	return COMMAND_INPUT;
}

static int replay_file(struct replay *replay)
{
	char message[READ_MESSAGE_MAX], damage[BLOCKS_MESSAGE_MAX];
	struct log_file log;
	int code = find_drop(replay);

	if (code != COMMAND_DONE)
		return code;
	if (log_file_open(&log, replay->file, "a recording", message) != 0) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	code = lcm_log_is(&log) ? replay_lcm(replay, &log) : replay_candump(replay, &log);
	if (code == COMMAND_DONE && log_file_damage(&log, replay->from, replay->until, damage) > 0) {
		command_error("%s: %s: what stood in it was not sent", replay->file, damage);
		code = COMMAND_INPUT;
	}
	if (code == COMMAND_DONE && log_file_error(&log, message) != 0) {
		command_error("%s", message);
		code = COMMAND_INPUT;
	}
	log_file_close(&log);
	if (code == COMMAND_DONE && replay->sent + replay->withheld == 0 && !interrupt_came()) {
		command_error("%s: no frame, expected candump text or an LCM event log", replay->file);
		code = COMMAND_INPUT;
	}
	return code;
}

static int take_speed(const struct option_table *table, const char *name, const char *text, void *speed)
{
	if (strcmp(text, "max") == 0) {
		*(double *)speed = 0.0;
		return OPTIONS_READ;
	}
	if (number_read(text, 1e-3, 1e6, speed))
		return OPTIONS_READ;
	return option_wrong(table, "--%s is '%s', expected max or a number from 0.001 to 1e+06", name, text);
}

static const struct option_row rows[] = {
        OPTION_UNSIGNED("drop", "N", struct replay, drop, 1, 1e9,
                        "the N-th drop of a log of several alone ('droptower analyze --list' shows them)"),
        OPTION_TAKEN("speed", "X", struct replay, pace.speed, take_speed,
                     "X times as fast (default 1), or max: as fast as FILE can be read"),
        OPTION_TEXT("to", "URL", struct replay, to,
                    "where to (default log:-, candump text on standard output)"),
        OPTION_FLAG("as-host", struct replay, as_host,
                    "also what only a host may send: commands, parameters, its heartbeat, DT_COMMAND. They "
                    "are left out otherwise, but into a log; where a tower is heard they are refused"),
};

static const struct option_table known_options = {
        .program = "droptower",
        .command = "replay",
        .head = "usage: droptower replay FILE [--drop N] [--speed X|max] [--to URL] [--as-host]\n"
                "\n"
                "Sends a logged drop again, in its own time. candump text goes to a CAN link (unix:PATH, "
                "can:IF,\n"
                "slcan:DEV, log:FILE) or, as the bridge would, to LCM (udpm://...); an LCM event log goes to "
                "LCM.\n"
                "\n",
        OPTION_ROWS(rows),
        .words = true,
        .tail = "\n"
                "Into a log: at a given speed the frames carry the time they were sent, at max their own.\n",
};

int command_replay(int argc, char **argv)
{
	struct replay replay = {.to = "log:-", .pace = {.speed = 1.0}, .until = UINT64_MAX};
	int code = option_read(&known_options, &replay, argc, argv);

	if (code != OPTIONS_READ)
		return code;
	if (optind + 1 != argc)
		return command_usage("replay", "one FILE expected, %d given", argc - optind);
	replay.file = argv[optind];
	if (strncmp(replay.to, "log:", 4) == 0 && command_is_input("replay", replay.to + 4, replay.file))
		return COMMAND_USAGE;
	interrupt_catch();
	code = replay_file(&replay);
	if (code == COMMAND_DONE && replay.skipped > 0)
		command_error("%s: %" PRIu64 " sent, %" PRIu64 " skipped that are no frame to send",
		              replay.file, replay.sent, replay.skipped);
	if (code == COMMAND_DONE && replay.withheld > 0)
		command_error("%s: %" PRIu64 " sent, %" PRIu64 " left out that only a host may send",
		              replay.file, replay.sent, replay.withheld);
	return code;
}
