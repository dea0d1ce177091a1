/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * droptower-bench: reads the command line, see usage below and hil/README.md.
 */
#include <inttypes.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/base/number.h"
#include "common/base/option.h"
#include "common/base/text.h"
#include "common/wire_table.h"
#include "hil/bench.h"
#include "hil/scenario.h"
#include "hil/verdict.h"

enum { NO_FD = 1 << 20 };

#ifndef __has_feature
#define __has_feature(x) 0
#endif

/* What is read besides the bench's own options. */
struct line {
	struct bench_options bench;
	const char *scene_file, *scenario_file, *timeline_file;
	double angle_deg;  /* NAN: the scene's */
	unsigned ready_fd; /* or NO_FD */
	bool operate, inside;
};

/* "LEFT@SECONDS" or "LEFT@+SECONDS": copies LEFT and finds the seconds. */
static bool split_at(const char *text, char *left, size_t size, double *time_s)
{
	const char *at = strchr(text, '@');

	if (at == NULL || (size_t)(at - text) >= size || !number_read(at + 1, 0.0, 1e6, time_s))
		return false;
	memcpy(left, text, (size_t)(at - text));
	left[at - text] = '\0';
	return true;
}

static int take_fault(const struct option_table *table, const char *name, const char *text, void *into)
{
	struct bench_options *bench = into;
	struct event event = {.action = EVENT_FAULT, .state = EVENT_AT_TIME};
	char fault[32];

	if (!split_at(text, fault, sizeof(fault), &event.time_s))
		return option_wrong(table, "--%s is '%s', expected NAME@SECONDS, from 0 to 1e+06 s", name,
		                    text);
	if (bench->event_count == EVENTS_MAX)
		return option_wrong(table, "--%s %s: only %d faults in a run", name, text, EVENTS_MAX);
	for (; event.number < TOWER_FAULTS; event.number++)
		if (strcmp(fault, tower_fault_name((enum tower_fault)event.number)) == 0) {
			bench->events[bench->event_count++] = event;
			return OPTIONS_READ;
		}
	return option_wrong(table, "--%s %s: the tower has no such fault", name, text);
}

static int take_burst(const struct option_table *table, const char *name, const char *text, void *into)
{
	struct bench_options *bench = into;
	char count[16];
	uint64_t burst;

	if (!split_at(text, count, sizeof(count), &bench->burst_after_s) ||
	    !number_whole(count, 1, 1000000, &burst))
		return option_wrong(table, "--%s is '%s', expected N@+SECONDS, N from 1 to 1000000", name,
		                    text);
	bench->burst = (unsigned)burst;
	return OPTIONS_READ;
}

static const struct option_row rows[] = {
        OPTION_TEXT("scenario", "FILE", struct line, scenario_file,
                    "makes a scenario instead of a scene; only --firmware, --inside, --timeline, --log and "
                    "--truth go with it"),
        OPTION_TEXT("scene", "FILE", struct line, scene_file, "what is dropped (common/scenes/*.ini)"),
        OPTION_NUMBER("angle", "DEG", struct line, angle_deg, -360, 360,
                      "contact angle instead of the scene's"), /* which knows the true limits */
        OPTION_TEXT("link", "URL", struct line, bench.link,
                    "the host's CAN: unix:PATH, can:IF, ...; by the clock, until SIGINT or "
                    "SIGTERM"),
        OPTION_FLAG("operate", struct line, operate,
                    "no host: a scripted operator in virtual time, as fast as it goes"),
        OPTION_UNSIGNED("drops", "N", struct line, bench.script.drops, 1, 1000000,
                        "as many drops of the operator (1)"),
        OPTION_UNSIGNED("lift-after", "MS", struct line, bench.lift_after_ms, 1, 60000,
                        "how long the technician takes to lift the frame (2000); the product lies on the mat "
                        "meanwhile"),
        OPTION_TEXT("firmware", "COMMAND", struct line, bench.firmware,
                    "instead of droptower-firmware beside this program"),
        OPTION_FLAG("inside", struct line, inside,
                    "the firmware runs in this program, not in a process of its own: the same frames in less "
                    "time; not with --link and --firmware"),
        OPTION_UINT64("seed", "N", struct line, bench.seed, 0, 0x1p64,
                      "of the tower's scatter and noise and of the bus (1)"),
        OPTION_FLAG("ideal", struct line, bench.ideal, "no noise, no scatter, no high-pass"),
        OPTION_NUMBER("loss", "P", struct line, bench.bus.loss, 0, 1, "frames lost, probability, both ways"),
        OPTION_TAKEN("burst", "N@+SECONDS", struct line, bench, take_burst,
                     "N live blocks in a row lost, so long after each impact"),
        OPTION_NUMBER("duplicate", "P", struct line, bench.bus.duplicate, 0, 1, "frames that come twice"),
        OPTION_NUMBER("reorder", "P", struct line, bench.bus.reorder, 0, 1,
                      "frames held back behind the next 1 to 3"),
        OPTION_FLAG("cut-resend", struct line, bench.bus.cut_resend, "no resent block passes"),
        OPTION_TAKEN("fault", "NAME@SECONDS", struct line, bench, take_fault,
                     "of the tower, at a virtual time; may be repeated; the names are below"),
        OPTION_TEXT("control", "PATH", struct line, bench.control,
                    "unix datagram socket that takes events as they come, a line each: fault estop, repair "
                    "estop, bus burst 20, ... as in a scenario's [at], and faults, which is answered "
                    "(hil/README.md)"),
        OPTION_TEXT("timeline", "FILE", struct line, timeline_file,
                    "picture of a scenario's run, SVG by gnuplot"),
        OPTION_TEXT("log", "FILE", struct line, bench.log,
                    "frames on the host's side, candump text in virtual time"),
        OPTION_TEXT("truth", "FILE", struct line, bench.truth,
                    "converter codes: tick sensor x0..x6 y0..y9 z0..z9"),
        OPTION_UNSIGNED("ready-fd", "N", struct line, ready_fd, 0, 1023,
                        "gets one byte when the firmware runs"),
        OPTION_FLAG("quiet", struct line, bench.quiet, "says only what is wrong"),
};

static const struct option_table known_options = {
        .program = "droptower-bench",
        .head = "droptower-bench --scene FILE (--link URL | --operate) [OPTION]...\n"
                "droptower-bench --scenario FILE [--firmware COMMAND] [--timeline FILE] [--log FILE] "
                "[--truth FILE]\n"
                "Runs a firmware against the simulated tower. The second form makes one scenario\n"
                "(hil/scenarios/README.md) and says what was measured and expected.\n"
                "\n",
        OPTION_ROWS(rows),
};

/* Behind the options: every fault there is. */
static const char *tail(void)
{
	static char text[1000] = "\nFaults:";
	size_t length = strlen(text);

	for (unsigned i = 0; i < TOWER_FAULTS; i++)
		length += (size_t)snprintf(text + length, sizeof(text) - length, " %s%s",
		                           tower_fault_name((enum tower_fault)i), i % 7 == 6 ? "\n  " : "");
	snprintf(text + length, sizeof(text) - length,
	         "\n\nExit: 0 done, 1 a drop of the operator did not end complete and SAFE, or the scenario\n"
	         "not as expected, 2 usage, 3 scene or scenario unusable, 4 link or firmware\n");
	return text;
}

static const struct line nothing_given = {
        .angle_deg = NAN,
        .ready_fd = NO_FD,
        .bench = {.seed = 1, .script = {.drops = 1, .release_ms = SCRIPT_RELEASE_MS}, .ready_fd = -1},
};

/* Whether an option says of the run what a scenario has its own key for. */
static bool says_run(const struct line *line)
{
	struct line rest;

	memcpy(&rest, line, sizeof(rest)); /* with what lies between the fields */
	rest.scenario_file = rest.timeline_file = NULL;
	rest.bench.firmware = rest.bench.log = rest.bench.truth = NULL;
	rest.inside = false;
	return memcmp(&rest, &nothing_given, sizeof(rest)) != 0;
}

/* What does not go together. */
static int main_check(const struct line *line)
{
	const struct option_table *table = &known_options;

	if (line->inside && (line->bench.link != NULL || line->bench.firmware != NULL))
		return option_wrong(table, "--inside goes without --link and --firmware");
	if (line->scenario_file != NULL && says_run(line))
		return option_wrong(table, "--scenario says all about the run; only --firmware, --inside, "
		                           "--timeline, --log and --truth go "
		                           "with it");
	if (line->scenario_file != NULL)
		return OPTIONS_READ;
	if (line->timeline_file != NULL)
		return option_wrong(table, "--timeline shows a --scenario");
	if (line->scene_file == NULL)
		return option_wrong(table, "--scene FILE is missing");
	if (line->operate == (line->bench.link != NULL))
		return option_wrong(table, "expected either --link URL or --operate");
	if (line->bench.script.drops > 1 && !line->operate)
		return option_wrong(table,
		                    "--drops counts the drops of --operate; with --link the host decides");
	return OPTIONS_READ;
}

static int main_run_scene(struct line *line)
{
	struct scene *scene = &line->bench.scene;
	char message[SCENE_MESSAGE_MAX];
	int result = scene_read(scene, line->scene_file, message);

	if (result == 0 && !isnan(line->angle_deg)) {
		scene->drop_angle_deg = line->angle_deg;
		result = scene_check(scene, "--angle", message);
	}
	if (result == 0)
		result = scene_check_tower(scene, line->scene_file, message);
	if (result == 0)
		return bench_run(&line->bench);
	bench_say("%s", message);
	return BENCH_INPUT;
}

/* ---- a scenario ---- */

static void main_set_options(struct bench_options *bench, const struct scenario *scenario)
{
	bench->seed = (uint64_t)scenario->run_seed;
	bench->ideal = scenario->run_ideal != 0;
	bench->clock_ppm = scenario->run_clock_ppm;
	bench->bus = (struct busfault_options){.loss = scenario->bus_loss,
	                                       .duplicate = scenario->bus_duplicate,
	                                       .reorder = scenario->bus_reorder,
	                                       .cut_resend = scenario->bus_cut_resend != 0};
	bench->burst = (unsigned)scenario->bus_burst;
	bench->burst_after_s = scenario->bus_burst_after_s;
	bench->script =
	        (struct script_options){.drops = (unsigned)scenario->operator_drops,
	                                .release_ms = (uint32_t)(1000 * scenario->operator_release_after_s),
	                                .passive = scenario->operator_acknowledge == 0,
	                                .patient = true,
	                                .wrong_hash = scenario->operator_wrong_hash != 0,
	                                .parameters = scenario->parameter,
	                                .parameter_count = scenario->parameter_count};
	bench->event_count = scenario->event_count;
	memcpy(bench->events, scenario->event, sizeof(bench->events));
}

/* The file's name without folders and ".ini". */
static void main_name_of(const char *file, char *name, size_t size)
{
	const char *slash = strrchr(file, '/');
	size_t length;

	snprintf(name, size, "%s", slash != NULL ? slash + 1 : file);
	length = strlen(name);
	if (length > 4 && strcmp(name + length - 4, ".ini") == 0)
		name[length - 4] = '\0';
}

/* First line, for whoever makes a table: verdict, name, end state, virtual and wall seconds, hash of the
 * firmware's frames, what failed. Then an expectation a line. */
static int main_judge(const struct scenario *scenario, const struct line *line,
                      const struct bench_watch *watch)
{
	char name[64], failed[300], title[600];
	struct text report;
	unsigned failures = 0;
	int result = text_open(&report);

	if (result == 0) {
		failures = verdict_print(scenario, &watch->monitor, watch->results, report.out, failed,
		                         sizeof(failed));
		result = text_close(&report, 0);
	}
	if (result != 0) {
		bench_say("%s", error_text(result));
		return BENCH_LINK;
	}
	main_name_of(line->scenario_file, name, sizeof(name));
	printf("%s %s %s %.3f %.2f %016" PRIx64 " %s\n%s", failures ? "FAIL" : "PASS", name,
	       wire_state_name(watch->monitor.state), watch->virtual_s, watch->wall_s, watch->monitor.hash,
	       failures ? failed : "-", report.bytes);
	if (watch->monitor.hazard.first != NULL)
		printf("  unsafe at %.3f s: %s\n", watch->monitor.hazard.first_s,
		       watch->monitor.hazard.first);
	if (!isnan(watch->results[SCENARIO_reaction_ms]))
		printf("  answered after %.3f ms\n", watch->results[SCENARIO_reaction_ms]);
	free(report.bytes);
	snprintf(title, sizeof(title), "%s: %s (%s%s)", name, scenario->title, failures ? "FAIL " : "PASS",
	         failures ? failed : "");
	if (line->timeline_file != NULL &&
	    timeline_draw(watch->timeline, &watch->monitor, title, line->timeline_file) != 0) {
		bench_say("%s: gnuplot could not draw it", line->timeline_file);
		return BENCH_LINK;
	}
	return failures ? BENCH_NOT_SAFE : BENCH_DONE;
}

static int run_scenario(struct line *line)
{
	static struct scenario scenario;
	static struct bench_watch watch;
	char message[SCENARIO_MESSAGE_MAX];
	int status;

	if (scenario_read(&scenario, line->scenario_file, message) != 0 ||
	    scenario_scene(&scenario, &line->bench.scene, message) != 0) {
		bench_say("%s", message);
		return BENCH_INPUT;
	}
	main_set_options(&line->bench, &scenario);
	watch.end_s = scenario.run_end_s;
	watch.soon = scenario.run_safety != 0;
	if (line->timeline_file != NULL)
		watch.timeline = timeline_create();
	line->bench.watch = &watch;
	status = bench_run(&line->bench);
	if (status == BENCH_DONE)
		status = main_judge(&scenario, line, &watch);
	timeline_destroy(watch.timeline);
	return status;
}

int main(int argc, char **argv)
{
	struct option_table told = known_options;
	static struct line line;
	int code;

	signal(SIGPIPE, SIG_IGN); /* a broken pipe is an error code, not an end */
	memcpy(&line, &nothing_given, sizeof(line));
	told.tail = tail();
	code = option_read(&told, &line, argc, argv);
	if (code == OPTIONS_READ)
		code = main_check(&line);
	if (code != OPTIONS_READ)
		return code;
	if (line.ready_fd != NO_FD)
		line.bench.ready_fd = (int)line.ready_fd;
	if (line.inside &&
	    !__has_feature(address_sanitizer)) /* which knows one stack: a process does the same */
		line.bench.inside = &sensorbus_inside;
	return line.scenario_file != NULL ? run_scenario(&line) : main_run_scene(&line);
}
