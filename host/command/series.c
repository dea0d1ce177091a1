/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * `droptower series`: its options, and which verb runs. The verbs stand in series_look.c, series_change.c and
 * series_add.c.
 */
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/command/archived.h"
#include "host/command/command.h"
#include "host/command/series_private.h"

/* ---- options ---- */

static int take_dates(const struct option_table *table, const char *name, const char *text, void *into)
{
	struct series_arguments *a = into;

	a->date = text;
	if (archive_parse_dates(text, &a->dates, &a->filter))
		return OPTIONS_READ;
	return option_wrong(
	        table,
	        "--%s is '%s', expected YYYY, YYYY-MM, YYYY-MM-DD or YYYY-MM-DDTHH:MM of the calendar, or "
	        "two of them with .. between",
	        name, text);
}

static const struct option_row rows[] = {
        OPTION_TEXT("archive", "DIR", struct series_arguments, archive,
                    "the archive's folder; without it $DROPTOWER_ARCHIVE, else ./archive"),
        OPTION_FLAG("rebuild", struct series_arguments, rebuild,
                    "make its index again from the raw files (no verb)"),
        OPTION_FLAG("fewer", struct series_arguments, fewer,
                    "for --rebuild: even if it then knows fewer drops than before"),
        OPTION_TEXT("campaign", "NAME", struct series_arguments, filter.campaign,
                    "those of a campaign; for new: which it belongs to (default)"),
        OPTION_TEXT("scene", "NAME", struct series_arguments, scene,
                    "those of a scene; for new: the scene's file, or one that comes along"),
        OPTION_TAKEN("angle", "DEG", struct series_arguments, filter.angle_deg, command_angle,
                     "those at an angle; for new: instead of the scene's; for add: of these logs"),
        OPTION_TAKEN("height", "M", struct series_arguments, height_m, command_height,
                     "for new: instead of the scene's"),
        OPTION_TAKEN_BY(
                "date", "DAY", take_dates,
                "drops of a minute, day, month or year (UTC), or FROM..TO: 2026-11, 2026-11-02..2026-11-05, "
                "2026-11-02T08:00..2026-11-02T12:30"),
        OPTION_TEXT("chain", "FILE,...", struct series_arguments, chain,
                    "for new, add and reanalyse: the files of the sensors, named by serial number; "
                    "without it the scene's"),
        OPTION_UNSIGNED("drops", "N", struct series_arguments, drops, 1, 100000,
                        "for new: how many are planned (5)"),
        OPTION_TEXT("version", "V", struct series_arguments, filter.version,
                    "look at the results of this version, not at the newest of each drop"),
        OPTION_FLAG("undecided", struct series_arguments, undecided,
                    "means count drops that are not decided, too"),
        OPTION_TEXT("reference", "NAME", struct series_arguments, reference,
                    "for tables: the scene to divide by; without it the one without a plate"),
        OPTION_TEXT("text", "WORDS", struct series_arguments, filter.text,
                    "for list and drops: each word in a name of series, campaign or operator, a note, a "
                    "reason or a flag of one drop"),
        OPTION_UNSIGNED("limit", "N", struct series_arguments, filter.limit, 1, 1e6,
                        "for list and drops: the newest N, and whether there are more"),
        OPTION_TEXT("reason", "TEXT", struct series_arguments, reason, "of a decision"),
        OPTION_TEXT("note", "TEXT", struct series_arguments, note, "for add"),
        OPTION_FLAG("simulated", struct series_arguments, simulated, "for add: made on a simulated tower"),
        OPTION_TEXT("operator", "NAME", struct series_arguments, operator_name, "who decides ($USER)"),
        OPTION_FLAG("json", struct series_arguments, json, "JSON on standard output"),
        OPTION_TEXT("csv", "FILE", struct series_arguments, csv,
                    "a table for spreadsheets, instead; - is standard output"),
};

static const struct option_table known_options = {
        .program = "droptower",
        .command = "series",
        .head = "usage: droptower series [VERB] [OPTIONS]\n"
                "\n"
                "Series of drops in an archive. A drop is named SERIES/NUMBER.\n"
                "\n"
                "  list                    series with their counts (what it does without a verb)\n"
                "  drops                   drops of all series\n"
                "  new NAME --scene FILE   a series of --drops N at --angle DEG from --height M, in "
                "--campaign NAME\n"
                "  add SERIES FILE...      takes in and analyses every drop of the logs, and recordings of "
                "others; leaves\n"
                "                          out what is there already in whatever file, refuses what "
                "disagrees with the series\n"
                "  show SERIES             its drops; mean, SD and count of the accepted ones\n"
                "  accept DROP|SERIES...   a drop, or all drops of a series that are not decided\n"
                "  reject DROP...          keeps it and counts it nowhere; --reason TEXT\n"
                "  reopen DROP...          takes the decision back; --reason TEXT\n"
                "  note DROP TEXT          the operator's note\n"
                "  photo DROP WHEN FILE    a JPEG or PNG of what fell, WHEN is before or after; without what "
                "it "
                "tells of\n"
                "                          place and camera; for DROP a SERIES is its next drop, before it\n"
                "  result DROP             the analysis in full, as JSON; --version V for an older one\n"
                "  tables [CAMPAIGN]       means, SDs and ratios by scene and angle\n"
                "  reanalyse SERIES...     by this version; the results of others stay\n"
                "\n",
        OPTION_ROWS(rows),
        .words = true,
};

/* What does not go together. */
static int series_check_options(const struct series_arguments *a)
{
	if (a->json && a->csv != NULL)
		return command_usage("series", "--json and --csv exclude each other");
	if (a->filter.limit > 0 && a->csv != NULL)
		return command_usage("series",
		                     "--limit goes without --csv, which cannot say that there are more");
	return COMMAND_DONE;
}

/* ---- which verb ---- */

static const struct verb {
	const char *name;
	enum archive_mode mode;
	int least, most; /* words behind it */
	int (*run)(struct archive *archive, struct series_arguments *arguments);
	const char *expected;
} verbs[] = {
        {"list", ARCHIVE_READ, 0, 0, series_verb_list, "nothing behind it"},
        {"drops", ARCHIVE_READ, 0, 0, series_verb_drops, "nothing behind it"},
        {"new", ARCHIVE_CREATE, 1, 1, series_verb_new, "NAME"},
        {"add", ARCHIVE_WRITE, 2, 1 << 20, series_verb_add, "SERIES LOG..."},
        {"show", ARCHIVE_READ, 1, 1, series_verb_show, "SERIES"},
        {"accept", ARCHIVE_WRITE, 1, 1 << 20, series_verb_accept, "DROP... or SERIES..."},
        {"reject", ARCHIVE_WRITE, 1, 1 << 20, series_verb_reject, "DROP..."},
        {"reopen", ARCHIVE_WRITE, 1, 1 << 20, series_verb_reopen, "DROP..."},
        {"note", ARCHIVE_WRITE, 2, 2, series_verb_note, "DROP TEXT"},
        {"photo", ARCHIVE_WRITE, 3, 3, series_verb_photo, "DROP before|after FILE"},
        {"result", ARCHIVE_READ, 1, 1, series_verb_result, "DROP"},
        {"tables", ARCHIVE_READ, 0, 1, series_verb_tables, "at most a CAMPAIGN"},
        {"reanalyse", ARCHIVE_WRITE, 1, 1 << 20, series_verb_reanalyse, "SERIES..."},
};
enum { VERBS = sizeof(verbs) / sizeof(verbs[0]) };

/* Whether a word is one of several with a blank between. */
static bool is_among(const char *word, const char *words)
{
	size_t length = strlen(word);

	for (const char *at = words; (at = strstr(at, word)) != NULL; at += length)
		if ((at == words || at[-1] == ' ') && (at[length] == ' ' || at[length] == '\0'))
			return true;
	return false;
}

/* An option that a verb does not heed is refused: somebody relies on it. */
static int check_heeded(const char *verb, const struct series_arguments *a)
{
	static const char lists[] = "list drops show tables";
	const struct {
		const char *option;
		bool given;
		const char *with;
	} options[] = {
	        {"fewer", a->fewer, "--rebuild"},
	        {"campaign", a->filter.campaign != NULL, "list drops show tables new"},
	        {"scene", a->scene != NULL, "list drops show tables new"},
	        {"angle", !isnan(a->filter.angle_deg), "list drops show tables new add"},
	        {"height", !isnan(a->height_m), "new"},
	        {"date", a->date != NULL, "list drops show tables"},
	        {"chain", a->chain != NULL, "new add reanalyse"},
	        {"drops", a->drops > 0, "new"},
	        {"version", a->filter.version != NULL, "list drops show tables result"},
	        {"undecided", a->undecided, lists},
	        {"reference", a->reference != NULL, "tables"},
	        {"text", a->filter.text != NULL, "list drops"},
	        {"limit", a->filter.limit > 0, "list drops"},
	        {"reason", a->reason != NULL, "accept reject reopen"},
	        {"note", a->note != NULL, "add"},
	        {"simulated", a->simulated, "add"},
	        {"operator", a->operator_name != NULL, "add accept reject reopen note photo"},
	        {"json", a->json, "list drops show tables result"},
	        {"csv", a->csv != NULL, "list drops show tables"},
	};

	for (size_t i = 0; i < sizeof(options) / sizeof(options[0]); i++)
		if (options[i].given && !is_among(verb, options[i].with))
			return command_usage("series", "--%s goes with %s, not with %s", options[i].option,
			                     options[i].with, verb);
	return COMMAND_DONE;
}

/* What a verb needs beside its words. */
static int series_check(const struct verb *verb, struct series_arguments *a)
{
	const char *name = verb->name;

	if (a->count < verb->least || a->count > verb->most)
		return command_usage("series", "%s: %d words, expected %s", name, a->count, verb->expected);
	if (verb->run == series_verb_new) {
		if (a->scene == NULL)
			return command_usage("series", "new: expected --scene FILE");
		return COMMAND_DONE;
	}
	a->filter.scene_name = a->scene;
	if ((verb->run == series_verb_reject || verb->run == series_verb_reopen) && a->reason == NULL)
		return command_usage("series", "%s: expected --reason TEXT", name);
	return COMMAND_DONE;
}

static int run_verb(const struct verb *verb, struct series_arguments *a)
{
	char message[ARCHIVE_MESSAGE_MAX];
	struct archive *archive;
	int code = series_check(verb, a);

	if (code != COMMAND_DONE)
		return code;
	archive = archive_open(a->archive, verb->mode, message);
	if (archive == NULL) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	code = verb->run(archive, a);
	archive_close(archive);
	return code;
}

int command_series(int argc, char **argv)
{
	struct series_arguments a = {.height_m = NAN, .filter = archive_filter_none()};
	int code = option_read(&known_options, &a, argc, argv);
	const char *name;

	if (code != OPTIONS_READ)
		return code;
	code = series_check_options(&a);
	name = a.rebuild ? "--rebuild" : optind < argc ? argv[optind] : "list";
	for (int i = 0; i < VERBS && code == COMMAND_DONE; i++)
		if (a.rebuild || strcmp(name, verbs[i].name) == 0)
			code = check_heeded(name, &a);
	if (code != COMMAND_DONE)
		return code;
	a.operator_name = archived_operator(a.operator_name);
	a.archive = archived_folder(a.archive);
	a.count = optind < argc ? argc - optind - 1 : 0;
	a.word = argv + optind + 1;
	if (a.rebuild)
		return optind < argc ? command_usage("series", "--rebuild goes without '%s'", argv[optind])
		                     : series_rebuild(&a);
	for (int i = 0; i < VERBS; i++)
		if (strcmp(name, verbs[i].name) == 0)
			return run_verb(&verbs[i], &a);
	if (strcmp(name, "calibrate") == 0)
		return command_usage("series",
		                     "no verb 'calibrate': a calibration stands in its sensor's file, "
		                     "which --chain names");
	return command_usage("series", "no verb '%s'", name);
}
