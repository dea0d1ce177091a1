/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * droptower-bench: reads the command line, see usage below and hil/README.md.
 */
#include <errno.h>
#include <getopt.h>
#include <inttypes.h>
#include <math.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/wire_table.h"
#include "hil/bench.h"
#include "hil/scenario.h"
#include "hil/verdict.h"

static const char usage[] =
        "droptower-bench --scene FILE (--link URL | --operate) [OPTION]...\n"
        "droptower-bench --scenario FILE [--firmware COMMAND] [--timeline FILE] [--log FILE] [--truth FILE]\n"
        "Runs a firmware against the simulated tower. The second form makes one scenario\n"
        "(hil/scenarios/README.md) and says what was measured and expected.\n"
        "\n"
        "  --scene FILE         what is dropped (common/scenes/*.ini)\n"
        "  --angle DEG          contact angle instead of the scene's\n"
        "  --link URL           the host's CAN: unix:PATH, can:IF, ...; until SIGINT or SIGTERM\n"
        "  --operate            no host: a scripted operator in virtual time\n"
        "  --drops N            as many drops of the operator (1)\n"
        "  --firmware COMMAND   instead of droptower-firmware beside this program\n"
        "  --pace max|1         as fast as it goes (with --operate), by the clock (with --link)\n"
        "  --seed N             of the tower's scatter and noise and of the bus (1)\n"
        "  --ideal              no noise, no scatter, no high-pass\n"
        "  --loss P             frames lost, probability, both ways\n"
        "  --burst N@+SECONDS   N live blocks in a row lost, so long after each impact\n"
        "  --duplicate P        frames that come twice\n"
        "  --reorder P          frames held back behind the next 1 to 3\n"
        "  --cut-resend         no resent block passes\n"
        "  --fault NAME@SECONDS of the tower, at a virtual time; may be repeated:\n"
        "                      ";

enum {
	OPTION_SCENARIO = 1,
	OPTION_TIMELINE,
	OPTION_SCENE,
	OPTION_ANGLE,
	OPTION_LINK,
	OPTION_OPERATE,
	OPTION_DROPS,
	OPTION_FIRMWARE,
	OPTION_PACE,
	OPTION_SEED,
	OPTION_IDEAL,
	OPTION_LOSS,
	OPTION_BURST,
	OPTION_DUPLICATE,
	OPTION_REORDER,
	OPTION_CUT_RESEND,
	OPTION_FAULT,
	OPTION_CONTROL,
	OPTION_LOG,
	OPTION_TRUTH,
	OPTION_READY_FD,
	OPTION_QUIET,
	OPTION_HELP,
};

static const struct option options_long[] = {
        {"scenario", required_argument, NULL, OPTION_SCENARIO},
        {"timeline", required_argument, NULL, OPTION_TIMELINE},
        {"scene", required_argument, NULL, OPTION_SCENE},
        {"angle", required_argument, NULL, OPTION_ANGLE},
        {"link", required_argument, NULL, OPTION_LINK},
        {"operate", no_argument, NULL, OPTION_OPERATE},
        {"drops", required_argument, NULL, OPTION_DROPS},
        {"firmware", required_argument, NULL, OPTION_FIRMWARE},
        {"pace", required_argument, NULL, OPTION_PACE},
        {"seed", required_argument, NULL, OPTION_SEED},
        {"ideal", no_argument, NULL, OPTION_IDEAL},
        {"loss", required_argument, NULL, OPTION_LOSS},
        {"burst", required_argument, NULL, OPTION_BURST},
        {"duplicate", required_argument, NULL, OPTION_DUPLICATE},
        {"reorder", required_argument, NULL, OPTION_REORDER},
        {"cut-resend", no_argument, NULL, OPTION_CUT_RESEND},
        {"fault", required_argument, NULL, OPTION_FAULT},
        {"control", required_argument, NULL, OPTION_CONTROL},
        {"log", required_argument, NULL, OPTION_LOG},
        {"truth", required_argument, NULL, OPTION_TRUTH},
        {"ready-fd", required_argument, NULL, OPTION_READY_FD},
        {"quiet", no_argument, NULL, OPTION_QUIET},
        {"help", no_argument, NULL, OPTION_HELP},
        {0},
};

/* What is read besides the bench's own options. */
struct line {
	struct bench_options bench;
	const char *scene_file, *scenario_file, *timeline_file;
	double angle_deg;                      /* NAN: the scene's */
	bool operate, drops_given, run_option; /* the last: one that a scenario has its own key for */
	const char *pace;
};

__attribute__((format(printf, 1, 2), noreturn)) static void refuse(const char *format, ...)
{
	char text[400];
	va_list arguments;

	va_start(arguments, format);
	vsnprintf(text, sizeof(text), format, arguments);
	va_end(arguments);
	bench_say("%s (--help lists the options)", text);
	exit(BENCH_USAGE);
}

static void help(void)
{
	fputs(usage, stdout);
	for (int i = 0; i < TOWER_FAULTS; i++)
		printf(" %s%s", tower_fault_name((enum tower_fault)i),
		       i == TOWER_FAULTS / 2 ? "\n                      " : "");
	fputs("\n"
	      "  --control PATH       unix datagram socket that takes events as they come, a line each:\n"
	      "                       fault estop, repair estop, bus burst 20, ... as in a scenario's [at],\n"
	      "                       and faults, which is answered (hil/README.md)\n"
	      "  --timeline FILE      picture of a scenario's run, SVG by gnuplot\n"
	      "  --log FILE           frames on the host's side, candump text in virtual time\n"
	      "  --truth FILE         converter codes: tick sensor x0..x6 y0..y9 z0..z9\n"
	      "  --ready-fd N         gets one byte when the firmware runs\n"
	      "  --quiet              says only what is wrong\n"
	      "\n"
	      "Exit: 0 done, 1 a drop of the operator did not end complete and SAFE, or the scenario\n"
	      "not as expected, 2 usage, 3 scene or scenario unusable, 4 link or firmware\n",
	      stdout);
	exit(BENCH_DONE);
}

static double number(const char *name, const char *text, double min, double max)
{
	char *end;
	double value = strtod(text, &end);

	if (end == text || *end != '\0' || !(value >= min && value <= max))
		refuse("--%s %s: expected a number from %g to %g", name, text, min, max);
	return value;
}

static unsigned long long whole(const char *name, const char *text, unsigned long long min,
                                unsigned long long max)
{
	char *end;
	unsigned long long value;

	errno = 0;
	value = strtoull(text, &end, 10);
	if (*text < '0' || *text > '9' || *end != '\0' || errno != 0 || value < min || value > max)
		refuse("--%s %s: expected a whole number from %llu to %llu", name, text, min, max);
	return value;
}

/* "LEFT@SECONDS" or "LEFT@+SECONDS": copies LEFT and returns the seconds. */
static double split_at(const char *name, const char *text, char *left, size_t size)
{
	const char *at = strchr(text, '@');

	if (at == NULL || (size_t)(at - text) >= size)
		refuse("--%s %s: expected %sSECONDS", name, text,
		       strcmp(name, "burst") == 0 ? "N@+" : "NAME@");
	memcpy(left, text, (size_t)(at - text));
	left[at - text] = '\0';
	return number(name, at + 1, 0.0, 1e6);
}

static void add_fault(struct bench_options *bench, const char *text)
{
	char name[32];
	double time_s = split_at("fault", text, name, sizeof(name));

	if (bench->event_count == EVENTS_MAX)
		refuse("--fault %s: only %d faults in a run", text, EVENTS_MAX);
	for (int i = 0; i < TOWER_FAULTS; i++) {
		if (strcmp(name, tower_fault_name((enum tower_fault)i)) == 0) {
			bench->events[bench->event_count++] = (struct event){.action = EVENT_FAULT,
			                                                     .number = (unsigned)i,
			                                                     .state = EVENT_AT_TIME,
			                                                     .time_s = time_s};
			return;
		}
	}
	refuse("--fault %s: the tower has no such fault", text);
}

static void set_burst(struct bench_options *bench, const char *text)
{
	char count[16];

	bench->burst_after_s = split_at("burst", text, count, sizeof(count));
	bench->burst = (unsigned)whole("burst", count, 1, 1000000);
}

/* The options of the bus; false for another one. */
static bool take_bus_option(struct bench_options *bench, int option, const char *text)
{
	switch (option) {
	case OPTION_LOSS:
		bench->bus.loss = number("loss", text, 0.0, 1.0);
		return true;
	case OPTION_BURST:
		set_burst(bench, text);
		return true;
	case OPTION_DUPLICATE:
		bench->bus.duplicate = number("duplicate", text, 0.0, 1.0);
		return true;
	case OPTION_REORDER:
		bench->bus.reorder = number("reorder", text, 0.0, 1.0);
		return true;
	case OPTION_CUT_RESEND:
		bench->bus.cut_resend = true;
		return true;
	default:
		return false;
	}
}

/* Those that go with a scenario too; false for another one. */
static bool take_file_option(struct line *line, int option, const char *text)
{
	struct bench_options *bench = &line->bench;

	switch (option) {
	case OPTION_SCENARIO:
		line->scenario_file = text;
		return true;
	case OPTION_TIMELINE:
		line->timeline_file = text;
		return true;
	case OPTION_FIRMWARE:
		bench->firmware = text;
		return true;
	case OPTION_LOG:
		bench->log = text;
		return true;
	case OPTION_TRUTH:
		bench->truth = text;
		return true;
	default:
		return false;
	}
}

static bool take_link_option(struct line *line, int option, const char *text)
{
	struct bench_options *bench = &line->bench;

	switch (option) {
	case OPTION_SCENE:
		line->scene_file = text;
		return true;
	case OPTION_LINK:
		bench->link = text;
		return true;
	case OPTION_CONTROL:
		bench->control = text;
		return true;
	case OPTION_QUIET:
		bench->quiet = true;
		return true;
	case OPTION_READY_FD:
		bench->ready_fd = (int)whole("ready-fd", text, 0, 1023);
		return true;
	default:
		return false;
	}
}

static void take_option(struct line *line, int option, const char *text)
{
	struct bench_options *bench = &line->bench;

	switch (option) {
	case OPTION_ANGLE:
		line->angle_deg = number("angle", text, -360.0, 360.0); /* the scene knows the true limits */
		break;
	case OPTION_OPERATE:
		line->operate = true;
		break;
	case OPTION_DROPS:
		bench->script.drops = (unsigned)whole("drops", text, 1, 1000000);
		line->drops_given = true;
		break;
	case OPTION_PACE:
		line->pace = text;
		break;
	case OPTION_SEED:
		bench->seed = whole("seed", text, 0, UINT64_MAX);
		break;
	case OPTION_IDEAL:
		bench->ideal = true;
		break;
	case OPTION_FAULT:
		add_fault(bench, text);
		break;
	default:
		help();
	}
}

static void check(struct line *line)
{
	struct bench_options *bench = &line->bench;

	if (line->scenario_file != NULL && line->run_option)
		refuse("--scenario says all about the run; only --firmware, --timeline, --log and --truth go "
		       "with it");
	if (line->scenario_file != NULL)
		return;
	if (line->timeline_file != NULL)
		refuse("--timeline shows a --scenario");
	if (line->scene_file == NULL)
		refuse("--scene FILE is missing");
	if (line->operate == (bench->link != NULL))
		refuse("expected either --link URL or --operate");
	if (line->drops_given && !line->operate)
		refuse("--drops counts the drops of --operate; with --link the host decides");
	if (line->pace != NULL && strcmp(line->pace, "max") != 0 && strcmp(line->pace, "1") != 0)
		refuse("--pace %s: expected max or 1", line->pace);
	bench->realtime = line->pace ? strcmp(line->pace, "1") == 0 : !line->operate;
}

static int run_scene(struct line *line)
{
	struct scene *scene = &line->bench.scene;
	char message[SCENE_MESSAGE_MAX];
	int result = scene_read(scene, line->scene_file, message);

	if (result == 0 && !isnan(line->angle_deg)) {
		scene->drop_angle_deg = line->angle_deg;
		result = scene_check(scene, "--angle", message);
	}
	if (result == 0)
		return bench_run(&line->bench);
	bench_say("%s", message);
	return BENCH_INPUT;
}

/* ---- a scenario ---- */

static void set_options(struct bench_options *bench, const struct scenario *scenario)
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
static void name_of(const char *file, char *name, size_t size)
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
static int judge(const struct scenario *scenario, const struct line *line, const struct bench_watch *watch)
{
	char name[64], failed[300], title[600], *report = NULL;
	size_t size = 0;
	FILE *out = open_memstream(&report, &size);
	unsigned failures;

	if (out == NULL) {
		bench_say("out of memory");
		return BENCH_LINK;
	}
	failures = verdict_print(scenario, &watch->observe, watch->results, out, failed, sizeof(failed));
	fclose(out);
	name_of(line->scenario_file, name, sizeof(name));
	printf("%s %s %s %.3f %.2f %016" PRIx64 " %s\n%s", failures ? "FAIL" : "PASS", name,
	       wire_state_name(watch->observe.state), watch->virtual_s, watch->wall_s, watch->observe.hash,
	       failures ? failed : "-", report);
	if (watch->observe.hazard.first != NULL)
		printf("  unsafe at %.3f s: %s\n", watch->observe.hazard.first_s,
		       watch->observe.hazard.first);
	free(report);
	snprintf(title, sizeof(title), "%s: %s (%s%s)", name, scenario->title, failures ? "FAIL " : "PASS",
	         failures ? failed : "");
	if (line->timeline_file != NULL &&
	    timeline_draw(watch->timeline, &watch->observe, title, line->timeline_file) != 0) {
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
	set_options(&line->bench, &scenario);
	watch.end_s = scenario.run_end_s;
	if (line->timeline_file != NULL)
		watch.timeline = timeline_create();
	line->bench.watch = &watch;
	status = bench_run(&line->bench);
	if (status == BENCH_DONE)
		status = judge(&scenario, line, &watch);
	timeline_destroy(watch.timeline);
	return status;
}

int main(int argc, char **argv)
{
	struct line line = {.angle_deg = NAN,
	                    .bench = {.seed = 1,
	                              .script = {.drops = 1, .release_ms = SCRIPT_RELEASE_MS},
	                              .ready_fd = -1}};
	int option;

	signal(SIGPIPE, SIG_IGN); /* a broken pipe is an error code, not an end */
	opterr = 0;
	while ((option = getopt_long(argc, argv, ":", options_long, NULL)) != -1) {
		if (option == ':')
			refuse("%s: an argument is missing", argv[optind - 1]);
		if (option == '?')
			refuse("%s: no such option", argv[optind - 1]);
		if (take_file_option(&line, option, optarg))
			continue;
		line.run_option = true;
		if (!take_bus_option(&line.bench, option, optarg) && !take_link_option(&line, option, optarg))
			take_option(&line, option, optarg);
	}
	if (optind < argc)
		refuse("%s: expected an option", argv[optind]);
	check(&line);
	return line.scenario_file != NULL ? run_scenario(&line) : run_scene(&line);
}
