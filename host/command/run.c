/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * `droptower run`: its options, and the order of things.
 */
#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "host/base/installed.h"
#include "host/command/command.h"
#include "host/command/evaluate.h"
#include "host/command/release.h"
#include "host/command/run_private.h"
#include "host/session/simulated.h"

static const struct option_row rows[] = {
        OPTION_TEXT("link", "URL", struct run, link,
                    "unix:PATH, can:IF, slcan:DEV, or udpm://... for a running 'droptower bridge'; it needs "
                    "--scene or --series; without it a simulated tower is started"),
        OPTION_FLAG("unattended", struct run, unattended,
                    "with --link: drops without asking; on a terminal a typed word confirms it. It is noted "
                    "with the drop"),
        OPTION_TEXT("key", "FILE", struct run, key,
                    "with udpm://...: the key that the bridge takes commands with"),
        OPTION_TEXT("scene", "FILE", struct run, scene_file,
                    "what is dropped: a file, or one of those that come along by its name (for a simulated "
                    "tower geometry-2A without it)"),
        OPTION_TEXT("chain", "FILE,...", struct run, chain,
                    "the sensors' files, in place of the scene's; a series knows its own"),
        OPTION_TAKEN("angle", "DEG", struct run, angle_deg, command_angle,
                     "contact angle, instead of the scene's"),
        EVALUATE_LIMITS_ROW(struct run, limits),
        OPTION_TEXT("channel", "NAME", struct run, channel,
                    "the channel of --limits; without it, the one with the largest peak"),
        OPTION_TEXT("out", "DIR", struct run, out, "where the files go (default .)"),
        OPTION_TEXT("series", "NAME", struct run, series,
                    "into an archive, as the series' next drop; 'droptower series new' makes a series, which "
                    "knows scene and angle"),
        OPTION_TEXT("archive", "DIR", struct run, archive_folder,
                    "where that series is; without it $DROPTOWER_ARCHIVE or ./archive"),
        OPTION_TEXT("operator", "NAME", struct run, operator_name, "who drops ($USER)"),
        OPTION_FLAG("json", struct run, json, "one JSON object on standard output instead of the table"),
        OPTION_FLAG("strict", struct run, strict, "a flagged record or channel is a failure (exit 3)"),
        OPTION_WORDS("bench", "WORD", struct run, bench, RUN_BENCH_WORDS_MAX,
                     "simulated tower only: a word for droptower-bench, e.g. --bench=--loss --bench=0.05; "
                     "may be repeated"),
};

static const struct option_table known_options = {
        .program = "droptower",
        .command = "run",
        .head = "usage: droptower run [OPTIONS]\n"
                "\n"
                "One drop: says what will fall, waits until every check is green, asks for a key to arm and, "
                "when\n"
                "horn and lamp have warned, for another to release; follows the fall, fetches every sample, "
                "analyses\n"
                "and reports. Writes drop-NNNN.log (candump text), .csv, .json and .html into --out.\n"
                "Any other key and Ctrl-C abort: at rest nothing is released, in motion the frame is braked "
                "and the\n"
                "record kept. A simulated tower of our own asks nothing.\n"
                "\n",
        OPTION_ROWS(rows),
};

/* A series says what is dropped, and where the files go. */
static int check_archive(struct run *run)
{
	if (run->series == NULL && run->archive_folder != NULL)
		return command_usage("run", "--archive goes with --series NAME");
	if (run->series != NULL && (run->out != NULL || run->scene_file != NULL || run->chain != NULL ||
	                            run->limits != NULL || !isnan(run->angle_deg)))
		return command_usage("run",
		                     "--series excludes --out, --scene, --chain, --limits and --angle");
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
	name = installed_scene_file(name, run->scene_path);
	if (run->scene_file == NULL && access(name, F_OK) != 0) {
		command_error("no scene given and none installed; use --scene FILE");
		return COMMAND_INPUT;
	}
	run->scene_file = name;
	return COMMAND_DONE;
}

/* What does not go together. */
static int run_check(struct run *run)
{
	int code;

	if (run->link != NULL && run->bench.count > 0)
		return command_usage("run", "--bench is for the simulated tower, --link for another one");
	if (run->link == NULL && (run->unattended || run->key != NULL))
		return command_usage("run", "--unattended and --key go with --link");
	if (evaluate_is_list(run->limits))
		return command_usage("run", EVALUATE_NO_LIST);
	if (run->channel != NULL && run->limits == NULL)
		return command_usage("run", "--channel needs --limits");
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
	struct option_words *words = &run->bench;

	/* with one seed for all the drops of a series would be the same drop */
	if (run->series != NULL) {
		snprintf(seed, 32, "%u", run->recording.number);
		memmove(words->word + 2, words->word, (size_t)words->count * sizeof(*words->word));
		words->word[0] = "--seed";
		words->word[1] = seed;
		words->count += 2;
	}
	snprintf(angle, 32, "%.17g", run->scene.drop_angle_deg);
	words->word[words->count++] = "--scene";
	words->word[words->count++] = run->scene_file;
	words->word[words->count++] = "--angle";
	words->word[words->count++] = angle;
	words->word[words->count] = NULL;
}

static int run_drop(struct run *run)
{
	struct simulated tower = {0};
	struct record record;
	char seed[32], angle[32], message[256];
	int code;

	if (run->link == NULL) {
		say_to_bench(run, seed, angle);
		if (simulated_start(&tower, run->bench.word, message, sizeof(message)) != 0) {
			if (interrupt_came())
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
	int code = option_read(&known_options, &run, argc, argv);

	if (code != OPTIONS_READ)
		return code;
	code = run_check(&run);
	if (code != COMMAND_DONE)
		return code;
	interrupt_catch();
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
