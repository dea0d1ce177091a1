/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <errno.h>
#include <getopt.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "common/link/link.h"
#include "host/command/command.h"
#include "host/command/publish.h"
#include "host/record/lcm_log.h"

static const char help[] =
        "usage: droptower replay FILE [--speed X|max] [--to URL]\n"
        "\n"
        "Sends a logged drop again, in its own time. candump text goes to a CAN link (unix:PATH, can:IF,\n"
        "slcan:DEV, log:FILE) or, as the bridge would, to LCM (udpm://...); an LCM event log goes to LCM.\n"
        "\n"
        "  --speed X    X times as fast (default 1), or max: as fast as FILE can be read\n"
        "  --to URL     where to (default log:-, candump text on standard output)\n"
        "\n"
        "Into a log: at a given speed the frames carry the time they were sent, at max their own.\n";

static const double CENTURY_S = 3.15e9;

/* The plan: log time `origin_us` is now; speed 0 is as fast as possible. */
struct pace {
	double speed;
	bool begun;
	int64_t origin_us;
	struct timespec start;
};

struct replay {
	const char *file, *to;
	struct pace pace;
	uint64_t sent, skipped;
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
	while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL) == EINTR && !command_interrupted())
		continue;
}

static int send_to_link(struct replay *replay, struct link *to, struct frame *frame)
{
	if (replay->pace.speed > 0.0)
		frame->time_us = 0; /* now */
	return link_send(to, frame);
}

static int replay_frames(struct replay *replay, struct link *from, struct link *to,
                         struct publisher *publisher)
{
	struct frame frame;
	int result;

	while ((result = link_receive(from, &frame, 0)) == 1 && !command_interrupted()) {
		if ((frame.flags & FRAME_ERROR) != 0) {
			replay->skipped++; /* a report of the bus, not a frame anybody sent */
			continue;
		}
		keep_pace(&replay->pace, frame.time_us);
		result = to != NULL ? send_to_link(replay, to, &frame) : publisher_frame(publisher, &frame);
		if (result != 0)
			return command_link_failed(replay->to, result);
		replay->sent++;
	}
	replay->skipped += link_counters(from)->malformed;
	if (result != DT_E_CLOSED && result != 1)
		return command_link_failed(replay->file, result);
	return COMMAND_DONE;
}

static int replay_candump(struct replay *replay)
{
	char url[4200], message[512];
	bool to_lcm = publisher_wants(replay->to);
	struct publisher *publisher = NULL;
	struct link *from, *to = NULL;
	int code;

	snprintf(url, sizeof(url), "log:%.4000s", replay->file);
	from = link_open(url, LINK_READ, message, sizeof(message));
	if (from == NULL) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	if (to_lcm)
		publisher = publisher_open(replay->to, message);
	else
		to = link_open(replay->to, strncmp(replay->to, "log:", 4) == 0 ? LINK_WRITE : LINK_READ_WRITE,
		               message, sizeof(message));
	if (to == NULL && publisher == NULL) {
		command_error("%s", message);
		code = COMMAND_LINK;
	} else {
		code = replay_frames(replay, from, to, publisher);
	}
	publisher_close(publisher);
	if (link_close(to) != 0 && code == COMMAND_DONE)
		code = command_link_failed(replay->to, DT_E_SYSTEM);
	(void)link_close(from);
	return code;
}

static int replay_events(struct replay *replay, const struct source *source, struct publisher *publisher)
{
	struct lcm_log_walk walk = {0};
	struct lcm_log_event event;

	while (!command_interrupted() && lcm_log_next(source, &walk, &event)) {
		int result;

		keep_pace(&replay->pace, event.time_us);
		result = publisher_raw(publisher, event.channel, event.data, event.size);
		if (result != 0)
			return command_link_failed(replay->to, result);
		replay->sent++;
	}
	replay->skipped += walk.skipped;
	return COMMAND_DONE;
}

static int replay_lcm(struct replay *replay, const struct source *source)
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
	code = replay_events(replay, source, publisher);
	publisher_close(publisher);
	return code;
}

static int replay_file(struct replay *replay)
{
	char message[READ_MESSAGE_MAX];
	struct source source;
	int code;

	if (source_load(&source, replay->file, "a recording", message) != 0) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	code = lcm_log_is(&source) ? replay_lcm(replay, &source) : replay_candump(replay);
	source_free(&source);
	if (code == COMMAND_DONE && replay->sent == 0 && !command_interrupted()) {
		command_error("%s: no frame, expected candump text or an LCM event log", replay->file);
		code = COMMAND_INPUT;
	}
	return code;
}

static int parse_speed(const char *text, double *speed)
{
	if (strcmp(text, "max") != 0)
		return command_is_number(text, 1e-3, 1e6, speed)
		               ? COMMAND_DONE
		               : command_usage(
		                         "replay",
		                         "--speed is '%s', expected max or a number from 0.001 to 1e+06",
		                         text);
	*speed = 0.0;
	return COMMAND_DONE;
}

int command_replay(int argc, char **argv)
{
	static const struct option options[] = {{"speed", required_argument, NULL, 's'},
	                                        {"to", required_argument, NULL, 't'},
	                                        {"help", no_argument, NULL, 'h'},
	                                        {0}};
	struct replay replay = {.to = "log:-", .pace = {.speed = 1.0}};
	int option, code = COMMAND_DONE;

	opterr = 0;
	while (code == COMMAND_DONE && (option = getopt_long(argc, argv, "h", options, NULL)) != -1) {
		if (option == 's')
			code = parse_speed(optarg, &replay.pace.speed);
		else if (option == 't')
			replay.to = optarg;
		else if (option == 'h') {
			fputs(help, stdout);
			return COMMAND_DONE;
		} else
			code = command_option("replay", argv[optind - 1]);
	}
	if (code != COMMAND_DONE)
		return code;
	if (optind + 1 != argc)
		return command_usage("replay", "one FILE expected, %d given", argc - optind);
	replay.file = argv[optind];
	if (strncmp(replay.to, "log:", 4) == 0 && command_is_input("replay", replay.to + 4, replay.file))
		return COMMAND_USAGE;
	command_catch_signals();
	code = replay_file(&replay);
	if (code == COMMAND_DONE && replay.skipped > 0)
		command_error("%s: %" PRIu64 " sent, %" PRIu64 " skipped that are no frame to send",
		              replay.file, replay.sent, replay.skipped);
	return code;
}
