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
        OPTION_TEXT("csv", "FILE", struct series_arguments, csv, "a table for spreadsheets, instead"),
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
                "  add SERIES LOG...       takes every drop of the logs in and analyses it; leaves out what "
                "is "
                "there\n"
                "                          already in whatever file, refuses what disagrees with the series\n"
                "  show SERIES             its drops; mean, SD and count of the accepted ones\n"
                "  accept DROP|SERIES...   a drop, or all drops of a series that are not decided\n"
                "  reject DROP...          keeps it and counts it nowhere; --reason TEXT\n"
                "  reopen DROP...          takes the decision back; --reason TEXT\n"
                "  note DROP TEXT          the operator's note\n"
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
	if (a->fewer && !a->rebuild)
		return command_usage("series", "--fewer goes with --rebuild");
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
        {"result", ARCHIVE_READ, 1, 1, series_verb_result, "DROP"},
        {"tables", ARCHIVE_READ, 0, 1, series_verb_tables, "at most a CAMPAIGN"},
        {"reanalyse", ARCHIVE_WRITE, 1, 1 << 20, series_verb_reanalyse, "SERIES..."},
};
enum { VERBS = sizeof(verbs) / sizeof(verbs[0]) };

/* What a verb needs beside its words. */
static int series_check(const struct verb *verb, struct series_arguments *a)
{
	const char *name = verb->name;

	if (a->count < verb->least || a->count > verb->most)
		return command_usage("series", "%s: %d words, expected %s", name, a->count, verb->expected);
	if (a->chain != NULL && verb->run != series_verb_new && verb->run != series_verb_add &&
	    verb->run != series_verb_reanalyse)
		return command_usage("series", "--chain goes with new, add and reanalyse, not with %s", name);
	if (verb->run == series_verb_new) {
		if (a->scene == NULL)
			return command_usage("series", "new: expected --scene FILE");
		return COMMAND_DONE;
	}
	if (!isnan(a->height_m))
		return command_usage("series", "--height goes with new, not with %s", name);
	if (a->simulated && verb->run != series_verb_add)
		return command_usage("series", "--simulated goes with add, not with %s", name);
	if ((a->filter.text != NULL || a->filter.limit > 0) && verb->run != series_verb_list &&
	    verb->run != series_verb_drops)
		return command_usage("series", "--text and --limit go with list and drops, not with %s",
		                     name);
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
	struct series_arguments a = {.drops = 5, .height_m = NAN, .filter = archive_filter_none()};
	int code = option_read(&known_options, &a, argc, argv);
	const char *name;

	if (code != OPTIONS_READ)
		return code;
	code = series_check_options(&a);
	if (code != COMMAND_DONE)
		return code;
	a.operator_name = archived_operator(a.operator_name);
	a.archive = archived_folder(a.archive);
	name = optind < argc ? argv[optind] : "list";
	a.count = optind < argc ? argc - optind - 1 : 0;
	a.word = argv + optind + 1;
	if (a.rebuild)
		return optind < argc ? command_usage("series", "--rebuild goes without '%s'", name)
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
