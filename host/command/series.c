/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <errno.h>
#include <fcntl.h>
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "host/archive/print.h"
#include "host/command/archived.h"
#include "host/command/command.h"
#include "host/record/read.h"
#include "host/record/whole.h"

static const char help[] =
        "usage: droptower series [VERB] [OPTIONS]\n"
        "\n"
        "Series of drops in an archive. A drop is named SERIES/NUMBER.\n"
        "\n"
        "  list                    series with their counts (what it does without a verb)\n"
        "  drops                   drops of all series\n"
        "  new NAME --scene FILE   a series of --drops N at --angle DEG, in --campaign NAME\n"
        "  add SERIES LOG...       takes logs in and analyses them\n"
        "  show SERIES             its drops; mean, SD and count of the accepted ones\n"
        "  accept DROP|SERIES...   a drop, or all drops of a series that are not decided\n"
        "  reject DROP...          keeps it and counts it nowhere; --reason TEXT\n"
        "  reopen DROP...          takes the decision back; --reason TEXT\n"
        "  note DROP TEXT          the operator's note\n"
        "  result DROP             the analysis in full, as JSON; --version V for an older one\n"
        "  tables [CAMPAIGN]       means, SDs and ratios by scene and angle\n"
        "  reanalyse SERIES...     by this version; the results of others stay\n"
        "  verify                  every raw file against its SHA-256\n"
        "  calibrate [SENSOR GAIN] notes a calibration of --date DAY (--note TEXT), or lists them\n"
        "\n"
        "  --archive DIR    the archive's folder; without it $DROPTOWER_ARCHIVE, else ./archive\n"
        "  --rebuild        make its index again from the raw files (no verb)\n"
        "  --campaign NAME  those of a campaign; for new: which it belongs to (default)\n"
        "  --scene NAME     those of a scene; for new: the scene's file\n"
        "  --angle DEG      those at an angle; for new: instead of the scene's\n"
        "  --date DAY       drops of a day, month or year (UTC), or FROM..TO: 2026-11, "
        "2026-11-02..2026-11-05\n"
        "  --drops N        for new: how many are planned (5)\n"
        "  --version V      look at the results of this version, not at the newest of each drop\n"
        "  --undecided      means count drops that are not decided, too\n"
        "  --reference NAME for tables: the scene to divide by; without it the one without a plate\n"
        "  --reason TEXT    of a decision\n"
        "  --note TEXT      for add and calibrate\n"
        "  --operator NAME  who decides ($USER)\n"
        "  --json           JSON on standard output\n"
        "  --csv FILE       a table for spreadsheets, instead\n";

struct arguments {
	const char *archive, *csv, *reason, *note, *operator_name, *reference, *scene, *date;
	bool json, rebuild, undecided, help;
	double drops;
	struct archive_filter filter;
	char from[24], to[24];
	int count;
	char **word; /* behind the verb */
};

enum {
	OPTION_ARCHIVE = 256,
	OPTION_REBUILD,
	OPTION_CAMPAIGN,
	OPTION_SCENE,
	OPTION_ANGLE,
	OPTION_DATE,
	OPTION_DROPS,
	OPTION_VERSION,
	OPTION_UNDECIDED,
	OPTION_REFERENCE,
	OPTION_REASON,
	OPTION_NOTE,
	OPTION_OPERATOR,
	OPTION_JSON,
	OPTION_CSV
};

static const struct option long_options[] = {
        {"archive", required_argument, NULL, OPTION_ARCHIVE},
        {"rebuild", no_argument, NULL, OPTION_REBUILD},
        {"campaign", required_argument, NULL, OPTION_CAMPAIGN},
        {"scene", required_argument, NULL, OPTION_SCENE},
        {"angle", required_argument, NULL, OPTION_ANGLE},
        {"date", required_argument, NULL, OPTION_DATE},
        {"drops", required_argument, NULL, OPTION_DROPS},
        {"version", required_argument, NULL, OPTION_VERSION},
        {"undecided", no_argument, NULL, OPTION_UNDECIDED},
        {"reference", required_argument, NULL, OPTION_REFERENCE},
        {"reason", required_argument, NULL, OPTION_REASON},
        {"note", required_argument, NULL, OPTION_NOTE},
        {"operator", required_argument, NULL, OPTION_OPERATOR},
        {"json", no_argument, NULL, OPTION_JSON},
        {"csv", required_argument, NULL, OPTION_CSV},
        {"help", no_argument, NULL, 'h'},
        {0},
};

/* ---- options ---- */

static bool is_date(const char *text)
{
	static const char pattern[] = "0000-00-00";
	size_t length = strlen(text);

	for (size_t i = 0; i < length; i++)
		if (i >= sizeof(pattern) - 1 ||
		    (pattern[i] == '-' ? text[i] != '-' : text[i] < '0' || text[i] > '9'))
			return false;
	return length == 4 || length == 7 || length == 10;
}

static int parse_date(struct arguments *a, const char *text)
{
	const char *dots = strstr(text, "..");
	size_t length = dots != NULL ? (size_t)(dots - text) : strlen(text);

	snprintf(a->from, sizeof(a->from), "%.*s", length < 20 ? (int)length : 20, text);
	snprintf(a->to, sizeof(a->to), "%.20s", dots != NULL ? dots + 2 : a->from);
	a->filter.from = a->from;
	a->filter.to = a->to;
	a->date = text;
	if (is_date(a->from) && is_date(a->to))
		return COMMAND_DONE;
	return command_usage("series",
	                     "--date is '%s', expected YYYY, YYYY-MM, YYYY-MM-DD, or two of them "
	                     "with .. between",
	                     text);
}

static int parse_text(struct arguments *a, int option, const char *unknown)
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
		return command_usage("series", "option '%s' is not known or lacks its value", unknown);
	}
	*to = optarg;
	return COMMAND_DONE;
}

static int parse_one(struct arguments *a, int option, const char *unknown)
{
	switch (option) {
	case OPTION_REBUILD:
		a->rebuild = true;
		return COMMAND_DONE;
	case OPTION_UNDECIDED:
		a->undecided = true;
		return COMMAND_DONE;
	case OPTION_JSON:
		a->json = true;
		return COMMAND_DONE;
	case 'h':
		a->help = true;
		return COMMAND_DONE;
	case OPTION_ANGLE:
		return command_number("series", "angle", optarg, 10, 80, &a->filter.angle_deg);
	case OPTION_DROPS:
		return command_number("series", "drops", optarg, 1, 100000, &a->drops);
	case OPTION_DATE:
		return parse_date(a, optarg);
	default:
		return parse_text(a, option, unknown);
	}
}

static int parse(struct arguments *a, int argc, char **argv)
{
	int option, code = COMMAND_DONE;

	opterr = 0;
	while (code == COMMAND_DONE && (option = getopt_long(argc, argv, "h", long_options, NULL)) != -1)
		code = parse_one(a, option, argv[optind - 1]);
	if (code == COMMAND_DONE && a->json && a->csv != NULL)
		code = command_usage("series", "--json and --csv exclude each other");
	a->operator_name = archived_operator(a->operator_name);
	return code;
}

/* ---- what verbs share ---- */

/* How a printing verb ends: to standard output, or into the file of --csv. */
static int print_failed(const struct archive *archive, int result)
{
	if (result == DT_E_MEMORY || archive_message(archive)[0] == '\0') {
		command_error("standard output: %s",
		              result == DT_E_MEMORY ? error_text(result) : strerror(errno));
		return COMMAND_INPUT;
	}
	return archived_failed(archive);
}

struct job {
	struct archive *archive;
	struct arguments *arguments;
	int (*print)(struct job *job, enum print_format format, FILE *out);
};

static int print(struct job *job)
{
	const struct arguments *a = job->arguments;
	char message[512];
	struct whole whole;
	int result;

	if (a->csv == NULL) {
		result = job->print(job, a->json ? PRINT_JSON : PRINT_TEXT, stdout);
		return result == 0 ? COMMAND_DONE : print_failed(job->archive, result);
	}
	result = whole_open(&whole, a->csv, message, sizeof(message));
	if (result == 0)
		result = whole_close(&whole, job->print(job, PRINT_CSV, whole.out), message, sizeof(message));
	if (result == 0)
		return COMMAND_DONE;
	command_error("%s",
	              archive_message(job->archive)[0] != '\0' ? archive_message(job->archive) : message);
	return COMMAND_INPUT;
}

/* The drops that a verb works on: looked up first, since what it does changes the list. */
struct chosen {
	struct {
		char name[ARCHIVE_NAME_MAX + 16], series[ARCHIVE_NAME_MAX + 1];
		char raw[ARCHIVE_NAME_MAX + 64];
		unsigned number;
	} * drop;
	size_t count, room;
	bool undecided_only, without_result_only;
};

static int choose_one(void *context, const struct archive_drop *drop)
{
	struct chosen *c = context;

	if (strcmp(drop->state, "recorded") != 0 ||
	    (c->undecided_only && strcmp(drop->decision, "open") != 0) ||
	    (c->without_result_only && drop->version != NULL))
		return 0;
	if (c->count == c->room) {
		size_t room = 2 * c->room + 16;
		void *more = realloc(c->drop, room * sizeof(*c->drop));

		if (more == NULL)
			return DT_E_MEMORY;
		c->drop = more;
		c->room = room;
	}
	snprintf(c->drop[c->count].name, sizeof(c->drop->name), "%.60s/%u", drop->series.name, drop->number);
	snprintf(c->drop[c->count].series, sizeof(c->drop->series), "%s", drop->series.name);
	snprintf(c->drop[c->count].raw, sizeof(c->drop->raw), "%s", drop->raw);
	c->drop[c->count++].number = drop->number;
	return 0;
}

static int must_have_series(struct archive *archive, const char *name)
{
	struct scene scene;

	return archive_scene(archive, name, &scene) == 0 ? COMMAND_DONE : archived_failed(archive);
}

static int choose(struct archive *archive, const char *series, struct chosen *chosen)
{
	struct archive_filter filter = archive_filter_none();
	int code = series != NULL ? must_have_series(archive, series) : COMMAND_DONE;

	filter.series = series;
	if (code == COMMAND_DONE && archive_each_drop(archive, &filter, choose_one, chosen) != 0)
		code = archived_failed(archive);
	return code;
}

/* Analyses all chosen, and goes on past those that cannot be. */
static int analyse_chosen(struct archive *archive, struct chosen *chosen)
{
	int code = COMMAND_DONE;

	for (size_t i = 0; i < chosen->count && !command_interrupted(); i++) {
		int one = archived_analyse(archive, chosen->drop[i].series, chosen->drop[i].number,
		                           chosen->drop[i].raw);

		if (one != COMMAND_DONE)
			code = one;
	}
	if (command_interrupted())
		command_error("interrupted; the rest keeps the results it had");
	free(chosen->drop);
	return command_interrupted() ? COMMAND_REFUSED : code;
}

/* ---- verbs that look ---- */

static int print_list(struct job *job, enum print_format format, FILE *out)
{
	return print_series(job->archive, &job->arguments->filter, format, out);
}

static int print_all(struct job *job, enum print_format format, FILE *out)
{
	return print_drops(job->archive, &job->arguments->filter, job->arguments->undecided, format, out);
}

static int print_table(struct job *job, enum print_format format, FILE *out)
{
	return print_tables(job->archive, &job->arguments->filter, job->arguments->undecided,
	                    job->arguments->reference, format, out);
}

static int print_gains(struct job *job, enum print_format format, FILE *out)
{
	return print_calibrations(job->archive, format, out);
}

static int verb_list(struct archive *archive, struct arguments *a)
{
	return print(&(struct job){archive, a, print_list});
}

static int verb_drops(struct archive *archive, struct arguments *a)
{
	return print(&(struct job){archive, a, print_all});
}

static int verb_show(struct archive *archive, struct arguments *a)
{
	int code = must_have_series(archive, a->word[0]);

	a->filter.series = a->word[0];
	return code != COMMAND_DONE ? code : print(&(struct job){archive, a, print_all});
}

static int verb_tables(struct archive *archive, struct arguments *a)
{
	if (a->count == 1)
		a->filter.campaign = a->word[0];
	return print(&(struct job){archive, a, print_table});
}

static int verb_result(struct archive *archive, struct arguments *a)
{
	char *json = archive_json(archive, a->word[0], a->filter.version);
	bool failed;

	if (json == NULL)
		return archived_failed(archive);
	failed = fputs(json, stdout) < 0 || fflush(stdout) != 0;
	free(json);
	if (failed)
		command_error("standard output: %s", strerror(errno));
	return failed ? COMMAND_INPUT : COMMAND_DONE;
}

/* ---- verbs that change ---- */

static int verb_new(struct archive *archive, struct arguments *a)
{
	const char *campaign = a->filter.campaign != NULL ? a->filter.campaign : "default";

	if (archive_new_series(archive, a->word[0], campaign, a->scene, a->filter.angle_deg,
	                       (unsigned)a->drops) != 0)
		return archived_failed(archive);
	printf("series %s\n", a->word[0]);
	return COMMAND_DONE;
}

static int copy_bytes(int from, int to)
{
	char block[65536];
	ssize_t n, done;

	while ((n = read(from, block, sizeof(block))) > 0)
		for (ssize_t at = 0; at < n; at += done) {
			done = write(to, block + at, (size_t)(n - at));
			if (done < 0)
				return -1;
		}
	return n == 0 ? 0 : -1;
}

/* file to the log of r, and when file was last written. */
static int copy_log(const char *file, const struct archive_recording *r, int64_t *time_s)
{
	int from = open(file, O_RDONLY | O_CLOEXEC), to = open(r->log, O_WRONLY | O_CLOEXEC), result = -1;
	struct stat status;

	if (from >= 0 && to >= 0 && fstat(from, &status) == 0) {
		*time_s = status.st_mtime;
		result = copy_bytes(from, to);
	}
	if (result != 0)
		command_error("%s to %s: %s", file, r->log, strerror(errno));
	if (from >= 0)
		close(from);
	if (to >= 0 && close(to) != 0 && result == 0) {
		command_error("%s: %s", r->log, strerror(errno));
		result = -1;
	}
	return result;
}

/* A log is looked at before anything is made of it. */
static int is_new_log(struct archive *archive, const char *file, const char **ending)
{
	char message[READ_MESSAGE_MAX], drop[ARCHIVE_NAME_MAX + 16];
	struct record record;
	int found;

	if (read_record(&record, file, NULL, message) != 0) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	*ending = strcmp(record.format, "lcm") == 0   ? ".lcm"
	          : strcmp(record.format, "csv") == 0 ? ".csv"
	                                              : ".log";
	record_free(&record);
	found = archive_find(archive, file, drop);
	if (found < 0)
		return archived_failed(archive);
	if (found == 0)
		return COMMAND_DONE;
	command_error("%s: is there already as %s, expected a log that is not", file, drop);
	return COMMAND_INPUT;
}

static int add_log(struct archive *archive, const struct arguments *a, const char *file)
{
	struct archive_recording r;
	const char *ending = NULL;
	int64_t time_s = 0;
	int code = is_new_log(archive, file, &ending);

	if (code != COMMAND_DONE)
		return code;
	if (archive_begin(archive, a->word[0], a->operator_name, ending, &r) != 0)
		return archived_failed(archive);
	if (copy_log(file, &r, &time_s) != 0) {
		archive_discard(archive, &r);
		return COMMAND_INPUT;
	}
	if (archive_finish(archive, &r, time_s, a->note != NULL ? a->note : "") != 0)
		return archived_failed(archive);
	printf("%s/%u  %s\n", r.series, r.number, file);
	fflush(stdout);
	return archived_analyse(archive, r.series, r.number, r.raw);
}

static int verb_add(struct archive *archive, struct arguments *a)
{
	int code = must_have_series(archive, a->word[0]);

	for (int i = 1; i < a->count && code == COMMAND_DONE; i++)
		code = add_log(archive, a, a->word[i]);
	return code;
}

static int decide(struct archive *archive, const struct arguments *a, const char *drop,
                  enum archive_decision decision)
{
	const char *reason = a->reason != NULL ? a->reason : "";

	if (archive_decide(archive, drop, decision, a->operator_name, reason) != 0)
		return archived_failed(archive);
	printf("%s %s\n", drop,
	       decision == ARCHIVE_OPEN       ? "open"
	       : decision == ARCHIVE_ACCEPTED ? "accepted"
	                                      : "rejected");
	return COMMAND_DONE;
}

static int accept_series(struct archive *archive, const struct arguments *a, const char *series)
{
	struct chosen chosen = {.undecided_only = true};
	int code = choose(archive, series, &chosen);

	for (size_t i = 0; i < chosen.count && code == COMMAND_DONE; i++)
		code = decide(archive, a, chosen.drop[i].name, ARCHIVE_ACCEPTED);
	free(chosen.drop);
	return code;
}

static int verb_accept(struct archive *archive, struct arguments *a)
{
	int code = COMMAND_DONE;

	for (int i = 0; i < a->count && code == COMMAND_DONE; i++)
		code = strchr(a->word[i], '/') != NULL ? decide(archive, a, a->word[i], ARCHIVE_ACCEPTED)
		                                       : accept_series(archive, a, a->word[i]);
	return code;
}

static int decide_all(struct archive *archive, const struct arguments *a, enum archive_decision decision)
{
	int code = COMMAND_DONE;

	for (int i = 0; i < a->count && code == COMMAND_DONE; i++)
		code = decide(archive, a, a->word[i], decision);
	return code;
}

static int verb_reject(struct archive *archive, struct arguments *a)
{
	return decide_all(archive, a, ARCHIVE_REJECTED);
}

static int verb_reopen(struct archive *archive, struct arguments *a)
{
	return decide_all(archive, a, ARCHIVE_OPEN);
}

static int verb_note(struct archive *archive, struct arguments *a)
{
	if (archive_note(archive, a->word[0], a->operator_name, a->word[1]) != 0)
		return archived_failed(archive);
	return COMMAND_DONE;
}

static int verb_reanalyse(struct archive *archive, struct arguments *a)
{
	int code = COMMAND_DONE;

	command_catch_signals();
	for (int i = 0; i < a->count && code == COMMAND_DONE; i++) {
		struct chosen chosen = {0};

		code = choose(archive, a->word[i], &chosen);
		if (code == COMMAND_DONE)
			code = analyse_chosen(archive, &chosen);
	}
	return code;
}

static int verb_calibrate(struct archive *archive, struct arguments *a)
{
	double gain;
	int code;

	if (a->count == 0)
		return print(&(struct job){archive, a, print_gains});
	code = command_number("series", "gain", a->word[1], 0.1, 10, &gain);
	if (code == COMMAND_DONE &&
	    archive_calibrate(archive, a->word[0], gain, a->date, a->note != NULL ? a->note : "") != 0)
		code = archived_failed(archive);
	return code;
}

static void tell_wrong(void *context, const char *text)
{
	int *count = context;

	(*count)++;
	command_error("%s", text);
}

static int verb_verify(struct archive *archive, struct arguments *a)
{
	int told = 0, count = archive_verify(archive, tell_wrong, &told);

	(void)a;
	if (count < 0)
		return archived_failed(archive);
	if (count == 0)
		puts("every raw file is what was recorded");
	return count == 0 ? COMMAND_DONE : COMMAND_INPUT;
}

/* Then analyses what came without a result. */
static int rebuild(const struct arguments *a)
{
	struct chosen chosen = {.without_result_only = true};
	char message[ARCHIVE_MESSAGE_MAX];
	struct archive *archive;
	int wrong = 0, code;

	if (archive_rebuild(a->archive, tell_wrong, &wrong, message) != 0 ||
	    (archive = archive_open(a->archive, ARCHIVE_WRITE, message)) == NULL) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	command_catch_signals();
	code = choose(archive, NULL, &chosen);
	if (code == COMMAND_DONE)
		code = analyse_chosen(archive, &chosen);
	archive_close(archive);
	printf("%s: index made again from the raw files\n", a->archive);
	return code == COMMAND_DONE && wrong > 0 ? COMMAND_INPUT : code;
}

/* ---- which verb ---- */

static const struct verb {
	const char *name;
	enum archive_mode mode;
	int least, most; /* words behind it */
	int (*run)(struct archive *archive, struct arguments *arguments);
	const char *expected;
} verbs[] = {
        {"list", ARCHIVE_READ, 0, 0, verb_list, "nothing behind it"},
        {"drops", ARCHIVE_READ, 0, 0, verb_drops, "nothing behind it"},
        {"new", ARCHIVE_CREATE, 1, 1, verb_new, "NAME"},
        {"add", ARCHIVE_WRITE, 2, 1 << 20, verb_add, "SERIES LOG..."},
        {"show", ARCHIVE_READ, 1, 1, verb_show, "SERIES"},
        {"accept", ARCHIVE_WRITE, 1, 1 << 20, verb_accept, "DROP... or SERIES..."},
        {"reject", ARCHIVE_WRITE, 1, 1 << 20, verb_reject, "DROP..."},
        {"reopen", ARCHIVE_WRITE, 1, 1 << 20, verb_reopen, "DROP..."},
        {"note", ARCHIVE_WRITE, 2, 2, verb_note, "DROP TEXT"},
        {"result", ARCHIVE_READ, 1, 1, verb_result, "DROP"},
        {"tables", ARCHIVE_READ, 0, 1, verb_tables, "at most a CAMPAIGN"},
        {"reanalyse", ARCHIVE_WRITE, 1, 1 << 20, verb_reanalyse, "SERIES..."},
        {"verify", ARCHIVE_WRITE, 0, 0, verb_verify, "nothing behind it"},
        {"calibrate", ARCHIVE_WRITE, 0, 2, verb_calibrate, "SENSOR GAIN, or nothing"},
};
enum { VERBS = sizeof(verbs) / sizeof(verbs[0]) };

/* What a verb needs beside its words. */
static int check(const struct verb *verb, struct arguments *a)
{
	const char *name = verb->name;

	if (a->count < verb->least || a->count > verb->most)
		return command_usage("series", "%s: %d words, expected %s", name, a->count, verb->expected);
	if (verb->run == verb_new) {
		if (a->scene == NULL)
			return command_usage("series", "new: expected --scene FILE");
		return COMMAND_DONE;
	}
	a->filter.scene_name = a->scene;
	if ((verb->run == verb_reject || verb->run == verb_reopen) && a->reason == NULL)
		return command_usage("series", "%s: expected --reason TEXT", name);
	if (verb->run == verb_calibrate && a->count == 1)
		return command_usage("series", "calibrate: expected SENSOR GAIN, or nothing");
	if (verb->run == verb_calibrate && a->count == 2 && a->date == NULL)
		return command_usage("series", "calibrate: expected --date YYYY-MM-DD");
	return COMMAND_DONE;
}

static int run_verb(const struct verb *verb, struct arguments *a)
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
	struct arguments a = {.drops = 5, .filter = archive_filter_none()};
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
		                     : rebuild(&a);
	for (int i = 0; i < VERBS; i++)
		if (strcmp(name, verbs[i].name) == 0)
			return run_verb(&verbs[i], &a);
	return command_usage("series", "no verb '%s'", name);
}
