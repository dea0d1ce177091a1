/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <errno.h>
#include <fcntl.h>
#include <getopt.h>
#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/wire_table.h"
#include "host/command/archived.h"
#include "host/command/beside.h"
#include "host/command/command.h"
#include "host/command/evaluate.h"
#include "host/command/session.h"
#include "host/command/simulated.h"
#include "host/command/tower_setup.h"
#include "host/record/write.h"

static const char help[] =
        "usage: droptower run [OPTIONS]\n"
        "\n"
        "One drop: waits until every check is green, arms, releases, follows the fall, fetches every "
        "sample,\n"
        "analyses and reports. Writes drop-NNNN.log (candump text), .csv, .json and .html into --out.\n"
        "Ctrl-C aborts: at rest nothing is released, in motion the frame is braked and the record kept.\n"
        "\n"
        "  --link URL     unix:PATH, can:IF, slcan:DEV, or udpm://... for a running 'droptower bridge';\n"
        "                 without it a simulated tower is started\n"
        "  --scene FILE   what is dropped (default geometry-2A.ini, which comes along)\n"
        "  --angle DEG    contact angle, instead of the scene's\n"
        "  --out DIR      where the files go (default .)\n"
        "  --archive DIR  with --series NAME: the drop goes into an archive ('droptower series new' makes a\n"
        "                 series), which knows scene and angle; without it $DROPTOWER_ARCHIVE or ./archive\n"
        "  --operator NAME who drops ($USER)\n"
        "  --json         one JSON object on standard output instead of the table\n"
        "  --strict       a flagged record or channel is a failure (exit 3)\n"
        "  --bench WORD   simulated tower only: a word for droptower-bench, e.g. --bench=--loss\n"
        "                 --bench=0.05; may be repeated\n";

enum {
	OPTION_LINK = 256,
	OPTION_SCENE,
	OPTION_ANGLE,
	OPTION_OUT,
	OPTION_ARCHIVE,
	OPTION_SERIES,
	OPTION_OPERATOR,
	OPTION_JSON,
	OPTION_STRICT,
	OPTION_BENCH,
	BENCH_WORDS_MAX = 24,
	READY_MS = 60000, /* a person may have to close a door */
	DROP_MS = 20000,  /* fall, capture and upload take about one second */
};

static const struct option long_options[] = {
        {"link", required_argument, NULL, OPTION_LINK},
        {"scene", required_argument, NULL, OPTION_SCENE},
        {"angle", required_argument, NULL, OPTION_ANGLE},
        {"out", required_argument, NULL, OPTION_OUT},
        {"archive", required_argument, NULL, OPTION_ARCHIVE},
        {"series", required_argument, NULL, OPTION_SERIES},
        {"operator", required_argument, NULL, OPTION_OPERATOR},
        {"json", no_argument, NULL, OPTION_JSON},
        {"strict", no_argument, NULL, OPTION_STRICT},
        {"bench", required_argument, NULL, OPTION_BENCH},
        {"help", no_argument, NULL, 'h'},
        {0},
};

struct run {
	const char *link, *scene_file, *out;
	const char *archive_folder, *series, *operator_name;
	double angle_deg;
	bool json, strict, help;
	const char *bench_words[BENCH_WORDS_MAX + 8];
	int bench_word_count;
	/* while it runs */
	struct scene scene;
	struct session *session;
	int64_t start_ms;
	bool aborted;    /* by the operator, after the release */
	bool earlier;    /* the drop is one that the tower still held */
	bool released;   /* what comes now is a drop, whatever becomes of it */
	char stem[4096]; /* OUT/drop-NNNN */
	char log[ARCHIVE_PATH_MAX];
	struct archive *archive; /* NULL: files in OUT */
	struct archive_recording recording;
};

/* In the sources' folder that one, elsewhere the one that was installed with this program. */
static const char *default_scene(void)
{
	static const char in_sources[] = "common/scenes/geometry-2A.ini";
	static char installed[PATH_MAX];

	if (access(in_sources, R_OK) == 0 ||
	    beside("../share/droptower/scenes/geometry-2A.ini", installed) != 0)
		return in_sources;
	return installed;
}

/* A series says what is dropped, and where the files go. */
static int check_archive(struct run *run)
{
	if (run->series == NULL && (run->archive_folder != NULL || run->operator_name != NULL))
		return command_usage("run", "--archive and --operator go with --series NAME");
	if (run->series != NULL && (run->out != NULL || run->scene_file != NULL || !isnan(run->angle_deg)))
		return command_usage("run", "--series excludes --out, --scene and --angle");
	run->archive_folder = archived_folder(run->archive_folder);
	run->operator_name = archived_operator(run->operator_name);
	if (run->out == NULL)
		run->out = ".";
	if (run->scene_file == NULL)
		run->scene_file = default_scene();
	return COMMAND_DONE;
}

static int parse(struct run *run, int argc, char **argv)
{
	int option, code = COMMAND_DONE;

	opterr = 0;
	while (code == COMMAND_DONE && (option = getopt_long(argc, argv, "h", long_options, NULL)) != -1) {
		switch (option) {
		case OPTION_LINK:
			run->link = optarg;
			break;
		case OPTION_SCENE:
			run->scene_file = optarg;
			break;
		case OPTION_ANGLE:
			code = command_number("run", "angle", optarg, 10, 80, &run->angle_deg);
			break;
		case OPTION_OUT:
			run->out = optarg;
			break;
		case OPTION_ARCHIVE:
			run->archive_folder = optarg;
			break;
		case OPTION_SERIES:
			run->series = optarg;
			break;
		case OPTION_OPERATOR:
			run->operator_name = optarg;
			break;
		case OPTION_JSON:
			run->json = true;
			break;
		case OPTION_STRICT:
			run->strict = true;
			break;
		case OPTION_BENCH:
			if (run->bench_word_count == BENCH_WORDS_MAX)
				return command_usage("run", "more than %d --bench words", BENCH_WORDS_MAX);
			run->bench_words[run->bench_word_count++] = optarg;
			break;
		case 'h':
			run->help = true;
			return COMMAND_DONE;
		default:
			return command_usage("run", "option '%s' is not known or lacks its value",
			                     argv[optind - 1]);
		}
	}
	if (code == COMMAND_DONE && optind != argc)
		code = command_usage("run", "'%s' is too much", argv[optind]);
	if (code == COMMAND_DONE && run->link != NULL && run->bench_word_count > 0)
		code = command_usage("run", "--bench is for the simulated tower, --link for another one");
	return code == COMMAND_DONE && !run->help ? check_archive(run) : code;
}

static void __attribute__((format(printf, 2, 3))) progress(const struct run *run, const char *format, ...)
{
	va_list arguments;

	fprintf(stderr, "%7.3f s  ", (double)(session_now_ms() - run->start_ms) / 1000.0);
	va_start(arguments, format);
	vfprintf(stderr, format, arguments);
	va_end(arguments);
	fputc('\n', stderr);
}

/* Makes OUT and takes the first number for which no log is there, by making it. */
static int choose_stem(struct run *run)
{
	if (mkdir(run->out, 0777) != 0 && errno != EEXIST) {
		command_error("%s: %s", run->out, strerror(errno));
		return COMMAND_INPUT;
	}
	for (int number = 1; number < 10000; number++) {
		int fd;

		snprintf(run->stem, sizeof(run->stem), "%.4000s/drop-%04d", run->out, number);
		snprintf(run->log, sizeof(run->log), "%s.log", run->stem);
		fd = open(run->log, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
		if (fd >= 0) {
			close(fd);
			return COMMAND_DONE;
		}
		if (errno != EEXIST) {
			command_error("%s: %s", run->log, strerror(errno));
			return COMMAND_INPUT;
		}
	}
	command_error("%s: 9999 drops are there already", run->out);
	return COMMAND_INPUT;
}

/* A run that never heard a tower leaves no file. */
static void forget_empty_log(const struct run *run)
{
	struct stat there;

	if (stat(run->log, &there) == 0 && there.st_size == 0)
		unlink(run->log);
}

static void tell_checks(const struct run *run, uint16_t checks)
{
	for (unsigned i = 0; i < WIRE_CHECKS; i++)
		if ((checks >> i & 1u) != 0)
			progress(run, "check     %-10s %s", wire_check_name(i), wire_check_text(i));
}

static int wait_until_ready(struct run *run)
{
	const struct session_view *view = session_view(run->session);
	int64_t start_ms = session_now_ms();
	uint16_t told = 0;

	while (view->state != WIRE_STATE_READY) {
		int result = session_poll(run->session, 50);

		if (result != 0)
			return command_link_failed("waiting for the checks", result);
		if (command_interrupted())
			return command_stopped();
		if (view->state == WIRE_STATE_FAULT_HELD) {
			command_error(
			        "the tower holds a fault: %s; 'droptower ctl clear' when its cause is gone",
			        wire_fault_text(view->fault));
			return COMMAND_REFUSED;
		}
		if (view->checks != told && session_now_ms() - start_ms > 1000) {
			told = view->checks;
			tell_checks(run, told);
		}
		if (session_now_ms() - start_ms > READY_MS) {
			command_error("checks not green within %d s", READY_MS / 1000);
			return COMMAND_REFUSED;
		}
	}
	progress(run, "ready     all checks green");
	return COMMAND_DONE;
}

static int arm_and_release(struct run *run)
{
	uint16_t token = session_token();
	int result;

	result = session_command(run->session, WIRE_OP_ARM, token);
	if (command_interrupted()) {
		result = session_command(run->session, WIRE_OP_ABORT, 0);
		return result == 0 ? command_stopped() : command_link_failed("abort", result);
	}
	if (result == 0) {
		progress(run, "armed");
		result = session_command(run->session, WIRE_OP_RELEASE, token);
	}
	/* an interrupted release may have worked: what follows aborts it and looks */
	if (result == 0 || command_interrupted()) {
		progress(run, "released");
		return COMMAND_DONE;
	}
	command_error("the tower refuses: %s", error_text(result));
	tell_checks(run, session_view(run->session)->checks);
	return result == DT_E_TIMEOUT || result == DT_E_CLOSED || result == DT_E_LINK ? COMMAND_LINK
	                                                                              : COMMAND_REFUSED;
}

static void tell_state(const struct run *run, unsigned state, uint32_t *told)
{
	uint32_t bit = 1u << (state & 31u);

	/* once each: the last blocks on their way may still carry the state before */
	if ((*told & bit) == 0)
		progress(run, "%-9s %s", wire_state_name(state), wire_state_text(state));
	*told |= bit;
}

/* No drop can come of this state. */
static bool at_rest(unsigned state)
{
	return !wire_state_moving(state) && state != WIRE_STATE_ARMED && state != WIRE_STATE_CAPTURED &&
	       state != WIRE_STATE_UPLOADED;
}

/* Follows the drop until it is collected. */
static int follow(struct run *run, struct record *record)
{
	const struct session_view *view = session_view(run->session);
	int64_t start_ms = session_now_ms();
	uint32_t told = 1u << WIRE_STATE_ARMED;

	for (;;) {
		int result = session_poll(run->session, 50);
		int taken = result == 0 ? session_take_drop(run->session, record) : result;

		if (taken == 1)
			return COMMAND_DONE;
		if (taken < 0)
			return command_link_failed("following the drop", taken);
		tell_state(run, view->state, &told);
		if (run->aborted && at_rest(view->state))
			return command_stopped();
		if (view->state == WIRE_STATE_FAULT_HELD && view->fault != WIRE_FAULT_NONE) {
			command_error("nothing to capture, the frame did not move: %s",
			              wire_fault_text(view->fault));
			return COMMAND_REFUSED;
		}
		if (command_interrupted() && !run->aborted) {
			run->aborted = true;
			progress(run, "abort");
			result = session_command(run->session, WIRE_OP_ABORT, 0);
			if (result != 0)
				return command_link_failed("abort", result);
		}
		if (session_now_ms() - start_ms > DROP_MS) {
			command_error("no capture within %d s of the release; state %s, fault %s",
			              DROP_MS / 1000, wire_state_name(view->state),
			              wire_fault_name(view->fault));
			return COMMAND_LINK;
		}
	}
}

/* What the link lost on its way; a tower's own losses are in its counters. */
static void tell_losses(const struct run *run)
{
	const struct link_counters *link = session_view(run->session)->link;

	if (link == NULL)
		return;
	if (link->receive_lost + link->send_lost + link->malformed + link->errors + link->restarts == 0)
		return;
	progress(run,
	         "link      %" PRIu64 " frames lost before us, %" PRIu64 " of ours lost, %" PRIu64
	         " malformed, %" PRIu64 " bus errors, %" PRIu64 " restarts",
	         link->receive_lost, link->send_lost, link->malformed, link->errors, link->restarts);
}

static int release_and_follow(struct run *run, struct record *record)
{
	int code = tower_setup_write(run->session, &run->scene);

	if (code == COMMAND_DONE)
		code = wait_until_ready(run);
	if (code == COMMAND_DONE)
		code = arm_and_release(run);
	run->released = code == COMMAND_DONE;
	return code == COMMAND_DONE ? follow(run, record) : code;
}

/* A host that died leaves its drop in the tower, which neither arms before it is fetched nor may have it
 * taken for the next one. */
static int drop(struct run *run, struct record *record)
{
	const struct session_view *view = session_view(run->session);
	int code = tower_setup_hear(run->session);
	int taken = code == COMMAND_DONE ? session_take_drop(run->session, record) : 0;

	run->earlier = code == COMMAND_DONE &&
	               (taken == 1 || wire_state_moving(view->state) || view->state == WIRE_STATE_CAPTURED);
	if (run->earlier)
		progress(run, "held      drop of an earlier run, to be fetched first");
	if (taken < 0)
		code = command_link_failed("an earlier drop", taken);
	else if (code == COMMAND_DONE && taken == 0)
		code = run->earlier ? follow(run, record) : release_and_follow(run, record);
	if (code == COMMAND_DONE)
		progress(run, "collected %" PRIu64 " blocks, %" PRIu64 " asked for again",
		         record->counters.blocks, session_view(run->session)->asked);
	tell_losses(run);
	return code;
}

/* A drop that is not what it seems ends with a word and a code of its own. */
static int tell_oddity(const struct run *run, const struct record *record, int code)
{
	if (run->aborted)
		command_error("aborted; what was recorded is kept");
	if (run->earlier)
		command_error("drop %u was still in the tower from an earlier run; nothing was released now",
		              record->drop_id);
	return code == COMMAND_DONE && (run->aborted || run->earlier) ? COMMAND_REFUSED : code;
}

/* The drop is recorded before it is looked at. */
static int report_archived(struct run *run, struct record *record)
{
	struct evaluate_options options = {
	        .scene = &run->scene, .iepe_time_constant_s = NAN, .json = run->json, .strict = run->strict};
	const struct archive_recording *r = &run->recording;
	const char *note = run->aborted   ? "aborted in motion"
	                   : run->earlier ? "was still in the tower from an earlier run"
	                                  : "";
	int code, shown;

	if (archive_finish(run->archive, &run->recording, 0, note) != 0)
		return archived_failed(run->archive);
	progress(run, "recorded  %s/%u", r->series, r->number);
	code = archived_analyse(run->archive, r->series, r->number, r->raw);
	snprintf(record->file, sizeof(record->file), "%s", r->raw);
	shown = evaluate(record, &options);
	if (shown == COMMAND_DONE)
		fprintf(run->json ? stderr : stdout, "\ndrop     %s/%u\nraw log  %s\n", r->series, r->number,
		        r->log);
	return tell_oddity(run, record, code != COMMAND_DONE ? code : shown);
}

static int report(struct run *run, struct record *record)
{
	char csv[4200], json[4200], html[4200], message[READ_MESSAGE_MAX];
	struct evaluate_options options = {.scene = &run->scene,
	                                   .iepe_time_constant_s = NAN,
	                                   .json = run->json,
	                                   .html = html,
	                                   .json_file = json,
	                                   .strict = run->strict};
	int code;

	snprintf(csv, sizeof(csv), "%s.csv", run->stem);
	snprintf(json, sizeof(json), "%s.json", run->stem);
	snprintf(html, sizeof(html), "%s.html", run->stem);
	snprintf(record->file, sizeof(record->file), "%.4000s.log", run->stem);
	if (write_record(record, csv, message) != 0) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	code = evaluate(record, &options);
	if (code == COMMAND_DONE)
		fprintf(run->json ? stderr : stdout,
		        "\nraw log  %s.log\ntable    %s\nJSON     %s\nreport   %s\n", run->stem, csv, json,
		        html);
	return tell_oddity(run, record, code);
}

/* Drops with the log open; the log is on disk before the analysis begins. */
static int drop_logged(struct run *run, const char *url, struct record *record)
{
	struct session_options options = {0};
	char log[ARCHIVE_PATH_MAX + 8], message[SESSION_MESSAGE_MAX];
	int code = COMMAND_LINK;

	snprintf(log, sizeof(log), "log:%s", run->log);
	options.log = link_open(log, LINK_WRITE, message, sizeof(message));
	if (options.log == NULL) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	run->session = session_open(url, &options, message);
	if (run->session != NULL)
		code = drop(run, record);
	else
		command_error("%s", message);
	session_close(run->session);
	if (link_close(options.log) != 0) {
		command_error("%s: could not be written", run->log);
		code = COMMAND_INPUT;
	}
	return code;
}

static int run_drop(struct run *run)
{
	struct simulated tower = {0};
	struct record record;
	char angle[32], message[256];
	int code;

	if (run->link == NULL) {
		const char *words[] = {"--scene", run->scene_file, "--angle", angle};

		snprintf(angle, sizeof(angle), "%.17g", run->scene.drop_angle_deg);
		for (size_t i = 0; i < sizeof(words) / sizeof(words[0]); i++)
			run->bench_words[run->bench_word_count++] = words[i];
		if (simulated_start(&tower, run->bench_words, message, sizeof(message)) != 0) {
			if (command_interrupted())
				return command_stopped();
			command_error("%s", message);
			return COMMAND_LINK;
		}
	}
	record_init(&record);
	code = drop_logged(run, run->link != NULL ? run->link : tower.url, &record);
	if (run->link == NULL)
		simulated_stop(&tower);
	if (code == COMMAND_DONE)
		code = run->archive != NULL ? report_archived(run, &record) : report(run, &record);
	record_free(&record);
	return code;
}

/* Nothing released: no drop. Else what there is of it stays, partial. */
static void leave_recording(struct run *run)
{
	if (run->recording.lock < 0)
		return;
	if (run->released || run->earlier)
		archive_abandon(&run->recording);
	else
		archive_discard(run->archive, &run->recording);
}

static int run_archived(struct run *run)
{
	char message[ARCHIVE_MESSAGE_MAX], file[ARCHIVED_SCENE_MAX];
	int code = COMMAND_INPUT;

	run->archive = archive_open(run->archive_folder, ARCHIVE_WRITE, message);
	if (run->archive == NULL) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	run->scene_file = file;
	if (archive_scene(run->archive, run->series, &run->scene) != 0 ||
	    archive_begin(run->archive, run->series, run->operator_name, ".log", &run->recording) != 0) {
		code = archived_failed(run->archive);
	} else {
		snprintf(run->log, sizeof(run->log), "%s", run->recording.log);
		code = archived_scene_file(run->archive, run->series, file);
		if (code == COMMAND_DONE)
			code = run_drop(run);
		leave_recording(run);
	}
	archive_close(run->archive);
	return code;
}

int command_run(int argc, char **argv)
{
	struct run run = {.angle_deg = NAN};
	int code = parse(&run, argc, argv);

	if (code != COMMAND_DONE)
		return code;
	if (run.help) {
		fputs(help, stdout);
		return COMMAND_DONE;
	}
	run.start_ms = session_now_ms();
	if (run.series != NULL) {
		command_catch_signals();
		return run_archived(&run);
	}
	code = evaluate_read_scene(&run.scene, run.scene_file, run.angle_deg);
	if (code == COMMAND_DONE)
		code = choose_stem(&run);
	if (code != COMMAND_DONE)
		return code;
	command_catch_signals();
	code = run_drop(&run);
	forget_empty_log(&run);
	return code;
}
