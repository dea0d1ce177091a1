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

static const char help[] =
        "usage: droptower series [VERB] [OPTIONS]\n"
        "\n"
        "Series of drops in an archive. A drop is named SERIES/NUMBER.\n"
        "\n"
        "  list                    series with their counts (what it does without a verb)\n"
        "  drops                   drops of all series\n"
        "  new NAME --scene FILE   a series of --drops N at --angle DEG from --height M, in --campaign NAME\n"
        "  add SERIES LOG...       takes every drop of the logs in and analyses it; leaves out what is "
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
        "  calibrate [SENSOR GAIN] notes a calibration of --date DAY (--note TEXT), or lists them\n"
        "\n"
        "  --archive DIR    the archive's folder; without it $DROPTOWER_ARCHIVE, else ./archive\n"
        "  --rebuild        make its index again from the raw files (no verb)\n"
        "  --fewer          for --rebuild: even if it then knows fewer drops than before\n"
        "  --campaign NAME  those of a campaign; for new: which it belongs to (default)\n"
        "  --scene NAME     those of a scene; for new: the scene's file, or one that comes along\n"
        "  --angle DEG      those at an angle; for new: instead of the scene's; for add: of these logs\n"
        "  --height M       for new: instead of the scene's\n"
        "  --date DAY       drops of a day, month or year (UTC), or FROM..TO: 2026-11, "
        "2026-11-02..2026-11-05\n"
        "  --drops N        for new: how many are planned (5)\n"
        "  --version V      look at the results of this version, not at the newest of each drop\n"
        "  --undecided      means count drops that are not decided, too\n"
        "  --reference NAME for tables: the scene to divide by; without it the one without a plate\n"
        "  --text WORDS     for list and drops: each word in a name of series, campaign or operator, a "
        "note,\n"
        "                   a reason or a flag of one drop\n"
        "  --limit N        for list and drops: the newest N, and whether there are more\n"
        "  --reason TEXT    of a decision\n"
        "  --note TEXT      for add and calibrate\n"
        "  --simulated      for add: made on a simulated tower\n"
        "  --operator NAME  who decides ($USER)\n"
        "  --json           JSON on standard output\n"
        "  --csv FILE       a table for spreadsheets, instead\n";

enum {
	OPTION_ARCHIVE = 256,
	OPTION_REBUILD,
	OPTION_FEWER,
	OPTION_CAMPAIGN,
	OPTION_SCENE,
	OPTION_ANGLE,
	OPTION_HEIGHT,
	OPTION_DATE,
	OPTION_DROPS,
	OPTION_VERSION,
	OPTION_UNDECIDED,
	OPTION_REFERENCE,
	OPTION_TEXT,
	OPTION_LIMIT,
	OPTION_REASON,
	OPTION_NOTE,
	OPTION_SIMULATED,
	OPTION_OPERATOR,
	OPTION_JSON,
	OPTION_CSV
};

static const struct option long_options[] = {
        {"archive", required_argument, NULL, OPTION_ARCHIVE},
        {"rebuild", no_argument, NULL, OPTION_REBUILD},
        {"fewer", no_argument, NULL, OPTION_FEWER},
        {"campaign", required_argument, NULL, OPTION_CAMPAIGN},
        {"scene", required_argument, NULL, OPTION_SCENE},
        {"angle", required_argument, NULL, OPTION_ANGLE},
        {"height", required_argument, NULL, OPTION_HEIGHT},
        {"date", required_argument, NULL, OPTION_DATE},
        {"drops", required_argument, NULL, OPTION_DROPS},
        {"version", required_argument, NULL, OPTION_VERSION},
        {"undecided", no_argument, NULL, OPTION_UNDECIDED},
        {"reference", required_argument, NULL, OPTION_REFERENCE},
        {"text", required_argument, NULL, OPTION_TEXT},
        {"limit", required_argument, NULL, OPTION_LIMIT},
        {"reason", required_argument, NULL, OPTION_REASON},
        {"note", required_argument, NULL, OPTION_NOTE},
        {"simulated", no_argument, NULL, OPTION_SIMULATED},
        {"operator", required_argument, NULL, OPTION_OPERATOR},
        {"json", no_argument, NULL, OPTION_JSON},
        {"csv", required_argument, NULL, OPTION_CSV},
        {"help", no_argument, NULL, 'h'},
        {0},
};

/* ---- options ---- */

static int parse_dates(struct series_arguments *a, const char *text)
{
	a->date = text;
	if (archive_parse_dates(text, &a->dates, &a->filter))
		return COMMAND_DONE;
	return command_usage("series",
	                     "--date is '%s', expected YYYY, YYYY-MM, YYYY-MM-DD of the calendar, or "
	                     "two of them with .. between",
	                     text);
}

static int parse_text(struct series_arguments *a, int option, const char *unknown)
{
	const char **to;

	switch (option) {
	case OPTION_ARCHIVE:
		to = &a->archive;
		break;
	case OPTION_CAMPAIGN:
		to = &a->filter.campaign;
		break;
	case OPTION_SCENE:
		to = &a->scene;
		break;
	case OPTION_VERSION:
		to = &a->filter.version;
		break;
	case OPTION_TEXT:
		to = &a->filter.text;
		break;
	case OPTION_REFERENCE:
		to = &a->reference;
		break;
	case OPTION_REASON:
		to = &a->reason;
		break;
	case OPTION_NOTE:
		to = &a->note;
		break;
	case OPTION_OPERATOR:
		to = &a->operator_name;
		break;
	case OPTION_CSV:
		to = &a->csv;
		break;
	default:
		return command_option("series", unknown);
	}
	*to = optarg;
	return COMMAND_DONE;
}

static int parse_one(struct series_arguments *a, int option, const char *unknown)
{
	switch (option) {
	case OPTION_REBUILD:
		a->rebuild = true;
		return COMMAND_DONE;
	case OPTION_FEWER:
		a->fewer = true;
		return COMMAND_DONE;
	case OPTION_UNDECIDED:
		a->undecided = true;
		return COMMAND_DONE;
	case OPTION_JSON:
		a->json = true;
		return COMMAND_DONE;
	case OPTION_SIMULATED:
		a->simulated = true;
		return COMMAND_DONE;
	case OPTION_LIMIT:
		return command_number("series", "limit", optarg, 1, 1e6, &a->limit);
	case 'h':
		a->help = true;
		return COMMAND_DONE;
	case OPTION_ANGLE:
		return command_angle("series", optarg, &a->filter.angle_deg);
	case OPTION_HEIGHT:
		return command_height("series", optarg, &a->height_m);
	case OPTION_DROPS:
		return command_number("series", "drops", optarg, 1, 100000, &a->drops);
	case OPTION_DATE:
		return parse_dates(a, optarg);
	default:
		return parse_text(a, option, unknown);
	}
}

static int parse(struct series_arguments *a, int argc, char **argv)
{
	int option, code = COMMAND_DONE;

	opterr = 0;
	while (code == COMMAND_DONE && (option = getopt_long(argc, argv, "h", long_options, NULL)) != -1)
		code = parse_one(a, option, argv[optind - 1]);
	if (code == COMMAND_DONE && a->json && a->csv != NULL)
		code = command_usage("series", "--json and --csv exclude each other");
	if (code == COMMAND_DONE && a->fewer && !a->rebuild)
		code = command_usage("series", "--fewer goes with --rebuild");
	if (code == COMMAND_DONE && a->limit > 0 && a->csv != NULL)
		code = command_usage("series",
		                     "--limit goes without --csv, which cannot say that there are more");
	a->filter.limit = (unsigned)a->limit;
	a->operator_name = archived_operator(a->operator_name);
	return code;
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
        {"calibrate", ARCHIVE_WRITE, 0, 2, series_verb_calibrate, "SENSOR GAIN, or nothing"},
};
enum { VERBS = sizeof(verbs) / sizeof(verbs[0]) };

/* What a verb needs beside its words. */
static int check(const struct verb *verb, struct series_arguments *a)
{
	const char *name = verb->name;

	if (a->count < verb->least || a->count > verb->most)
		return command_usage("series", "%s: %d words, expected %s", name, a->count, verb->expected);
	if (verb->run == series_verb_new) {
		if (a->scene == NULL)
			return command_usage("series", "new: expected --scene FILE");
		return COMMAND_DONE;
	}
	if (!isnan(a->height_m))
		return command_usage("series", "--height goes with new, not with %s", name);
	if (a->simulated && verb->run != series_verb_add)
		return command_usage("series", "--simulated goes with add, not with %s", name);
	if ((a->filter.text != NULL || a->limit > 0) && verb->run != series_verb_list &&
	    verb->run != series_verb_drops)
		return command_usage("series", "--text and --limit go with list and drops, not with %s",
		                     name);
	a->filter.scene_name = a->scene;
	if ((verb->run == series_verb_reject || verb->run == series_verb_reopen) && a->reason == NULL)
		return command_usage("series", "%s: expected --reason TEXT", name);
	if (verb->run == series_verb_calibrate && a->count == 1)
		return command_usage("series", "calibrate: expected SENSOR GAIN, or nothing");
	if (verb->run == series_verb_calibrate && a->count == 2 && a->date == NULL)
		return command_usage("series", "calibrate: expected --date YYYY-MM-DD");
	return COMMAND_DONE;
}

static int run_verb(const struct verb *verb, struct series_arguments *a)
{
	char message[ARCHIVE_MESSAGE_MAX];
	struct archive *archive;
	int code = check(verb, a);

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
	int code = parse(&a, argc, argv);
	const char *name;

	if (code != COMMAND_DONE)
		return code;
	if (a.help) {
		fputs(help, stdout);
		return COMMAND_DONE;
	}
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
	return command_usage("series", "no verb '%s'", name);
}
