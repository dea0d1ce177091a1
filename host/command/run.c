/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * `droptower run`: its options, and the order of things.
 */
#include <getopt.h>
#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "host/command/beside.h"
#include "host/command/command.h"
#include "host/command/release.h"
#include "host/command/run_private.h"
#include "host/command/simulated.h"

static const char help[] =
        "usage: droptower run [OPTIONS]\n"
        "\n"
        "One drop: says what will fall, waits until every check is green, asks for a key to arm and, when\n"
        "horn and lamp have warned, for another to release; follows the fall, fetches every sample, "
        "analyses\n"
        "and reports. Writes drop-NNNN.log (candump text), .csv, .json and .html into --out.\n"
        "Any other key and Ctrl-C abort: at rest nothing is released, in motion the frame is braked and the\n"
        "record kept. A simulated tower of our own asks nothing.\n"
        "\n"
        "  --link URL     unix:PATH, can:IF, slcan:DEV, or udpm://... for a running 'droptower bridge';\n"
        "                 it needs --scene or --series; without it a simulated tower is started\n"
        "  --unattended   with --link: drops without asking; on a terminal a typed word confirms it. It is\n"
        "                 noted with the drop\n"
        "  --key FILE     with udpm://...: the key that the bridge takes commands with\n"
        "  --scene FILE   what is dropped: a file, or one of those that come along by its name (for a\n"
        "                 simulated tower geometry-2A without it)\n"
        "  --angle DEG    contact angle, instead of the scene's\n"
        "  --out DIR      where the files go (default .)\n"
        "  --series NAME  into an archive, as the series' next drop; 'droptower series new' makes a series,\n"
        "                 which knows scene and angle\n"
        "  --archive DIR  where that series is; without it $DROPTOWER_ARCHIVE or ./archive\n"
        "  --operator NAME who drops into a series ($USER)\n"
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
	OPTION_UNATTENDED,
	OPTION_KEY,
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
        {"unattended", no_argument, NULL, OPTION_UNATTENDED},
        {"key", required_argument, NULL, OPTION_KEY},
        {"help", no_argument, NULL, 'h'},
        {0},
};

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
	return COMMAND_DONE;
}

/* A real tower is set up for a scene, and its product falls: that one nobody assumes. */
static int choose_scene(struct run *run)
{
	const char *name = run->scene_file != NULL ? run->scene_file : "geometry-2A.ini";

	if (run->series != NULL)
		return COMMAND_DONE;
	if (run->scene_file == NULL && run->link != NULL)
		return command_usage(
		        "run",
		        "--link sets a tower up for what is dropped, expected --scene FILE or --series NAME");
	name = beside_scene_file(name, run->scene_path);
	if (run->scene_file == NULL && access(name, F_OK) != 0) {
		command_error("no scenes came along; --scene FILE names one");
		return COMMAND_INPUT;
	}
	run->scene_file = name;
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
			code = command_angle("run", optarg, &run->angle_deg);
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
			if (run->bench_word_count == RUN_BENCH_WORDS_MAX)
				return command_usage("run", "more than %d --bench words",
				                     RUN_BENCH_WORDS_MAX);
			run->bench_words[run->bench_word_count++] = optarg;
			break;
		case OPTION_UNATTENDED:
			run->unattended = true;
			break;
		case OPTION_KEY:
			run->key = optarg;
			break;
		case 'h':
			run->help = true;
			return COMMAND_DONE;
		default:
			return command_option("run", argv[optind - 1]);
		}
	}
	if (code == COMMAND_DONE && optind != argc)
		code = command_usage("run", "'%s' is too much", argv[optind]);
	if (code == COMMAND_DONE && run->link != NULL && run->bench_word_count > 0)
		code = command_usage("run", "--bench is for the simulated tower, --link for another one");
	if (code == COMMAND_DONE && run->link == NULL && (run->unattended || run->key != NULL))
		code = command_usage("run", "--unattended and --key go with --link");
	if (code == COMMAND_DONE)
		code = check_archive(run);
	return code == COMMAND_DONE ? choose_scene(run) : code;
}

void run_progress(const struct run *run, const char *format, ...)
{
	va_list arguments;

	fprintf(stderr, "%7.3f s  ", (double)(session_now_ms() - run->start_ms) / 1000.0);
	va_start(arguments, format);
	vfprintf(stderr, format, arguments);
	va_end(arguments);
	fputc('\n', stderr);
}

/* Behind the user's words, so that these hold; the seed before them, so that theirs does. */
static void say_to_bench(struct run *run, char seed[32], char angle[32])
{
	const char **words = run->bench_words;

	/* with one seed for all the drops of a series would be the same drop */
	if (run->series != NULL) {
		snprintf(seed, 32, "%u", run->recording.number);
		memmove(words + 2, words, (size_t)run->bench_word_count * sizeof(*words));
		words[0] = "--seed";
		words[1] = seed;
		run->bench_word_count += 2;
	}
	snprintf(angle, 32, "%.17g", run->scene.drop_angle_deg);
	words[run->bench_word_count++] = "--scene";
	words[run->bench_word_count++] = run->scene_file;
	words[run->bench_word_count++] = "--angle";
	words[run->bench_word_count++] = angle;
}

static int run_drop(struct run *run)
{
	struct simulated tower = {0};
	struct record record;
	char seed[32], angle[32], message[256];
	int code;

	if (run->link == NULL) {
		say_to_bench(run, seed, angle);
		if (simulated_start(&tower, run->bench_words, message, sizeof(message)) != 0) {
			if (command_interrupted())
				return command_stopped();
			command_error("%s", message);
			return COMMAND_LINK;
		}
	}
	record_init(&record);
	code = run_follow(run, run->link != NULL ? run->link : tower.url, &record);
	if (run->link == NULL)
		simulated_stop(&tower);
	if (code == COMMAND_DONE)
		code = run_keep_report(run, &record);
	record_free(&record);
	return code;
}

int command_run(int argc, char **argv)
{
	struct run run = {.angle_deg = NAN, .recording.lock = -1};
	int code = parse(&run, argc, argv);

	if (code != COMMAND_DONE)
		return code;
	if (run.help) {
		fputs(help, stdout);
		return COMMAND_DONE;
	}
	command_catch_signals();
	if (run.link != NULL)
		code = release_consent("run", run.unattended);
	run.start_ms = session_now_ms();
	if (code == COMMAND_DONE)
		code = run_keep_begin(&run);
	if (code == COMMAND_DONE)
		code = run_drop(&run);
	run_keep_end(&run);
	return code;
}
