/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <droptower_version.h>
#include <errno.h>
#include <getopt.h>
#include <math.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/base/number.h"
#include "common/base/text.h"
#include "host/base/installed.h"
#include "host/base/progress.h"
#include "host/batch/batch.h"
#include "host/command/analyze.h"
#include "host/command/command.h"
#include "host/command/files.h"
#include "host/record/digest.h"

enum { JOBS_MAX = 4096, SHARDS_MAX = 1000000, REFUSALS_SHOWN = 20 };

struct batch_arguments {
	struct analyze_arguments analyze; /* first: its rows read into it */
	const char *out, *list;
	unsigned jobs, shard, shards, forms;
	struct option_words given; /* of the analysis: name, value, name, value */
};

struct told {
	struct analyze_arguments *analyze;
	const struct inputs *inputs;
	struct progress progress;
};

/* ---- options ---- */

static int take_shard(const struct option_table *table, const char *name, const char *text, void *into)
{
	struct batch_arguments *arguments = into;
	const char *slash = strchr(text, '/');
	char head[16];
	uint64_t shard, shards;

	snprintf(head, sizeof(head), "%.*s", slash != NULL ? (int)(slash - text) : 0, text);
	if (slash == NULL || !number_whole(slash + 1, 1, SHARDS_MAX, &shards) ||
	    !number_whole(head, 1, shards, &shard))
		return option_wrong(table, "--%s is '%s', expected I/N with I from 1 to N", name, text);
	arguments->shard = (unsigned)shard;
	arguments->shards = (unsigned)shards;
	return OPTIONS_READ;
}

static int take_forms(const struct option_table *table, const char *name, const char *text, void *into)
{
	static const char *const forms[] = {"jsonl", "csv", "sqlite"};
	unsigned *wanted = into;

	*wanted = 0;
	for (const char *at = text; *at != '\0';) {
		size_t length = strcspn(at, ","), i = 0;

		while (i < 3 && (strlen(forms[i]) != length || strncmp(forms[i], at, length) != 0))
			i++;
		if (i == 3)
			return option_wrong(table,
			                    "--%s is '%s', expected jsonl, csv, sqlite or some of them", name,
			                    text);
		*wanted |= 1u << i;
		at += length + (at[length] == ',');
	}
	return OPTIONS_READ;
}

static const struct option_row own_rows[] = {
        OPTION_TEXT("out", "FOLDER", struct batch_arguments, out,
                    "results, kept file by file; a batch that was stopped goes on there"),
        OPTION_UNSIGNED("jobs", "N", struct batch_arguments, jobs, 1, JOBS_MAX,
                        "files analysed side by side, also as -j N (the processors this program may use)"),
        OPTION_TAKEN_BY(
                "shard", "I/N", take_shard,
                "only the I-th of N shares of the files, without the union: for many machines at once; "
                "without --shard the same command then collects it"),
        OPTION_TEXT("list", "FILE", struct batch_arguments, list,
                    "files named in FILE, one a line; - is standard input"),
        OPTION_TAKEN("to", "LIST", struct batch_arguments, forms, take_forms,
                     "forms of the union (jsonl,csv,sqlite)"),
};
enum { OWN_ROWS = sizeof(own_rows) / sizeof(own_rows[0]) };

static bool is_own(const struct option_row *row)
{
	for (int i = 0; i < OWN_ROWS; i++)
		if (strcmp(own_rows[i].name, row->name) == 0)
			return true;
	return false;
}

/* What results depend on. */
static void note_given(void *into, const struct option_row *row, const char *text)
{
	struct option_words *given = &((struct batch_arguments *)into)->given;

	if (is_own(row) || given->count + 2 > OPTION_WORDS_ROOM)
		return;
	given->word[given->count++] = row->name;
	given->word[given->count++] = text != NULL ? text : "";
}

static int batch_read(struct batch_arguments *arguments, int argc, char **argv)
{
	struct option_row rows[OPTION_ROWS_MAX + OWN_ROWS];
	struct option_table table = {
	        .program = "droptower",
	        .command = "batch",
	        .head = "usage: droptower batch FILE|FOLDER|PATTERN... --out FOLDER [OPTIONS]\n"
	                "\n"
	                "What 'droptower analyze --json' says of any number of files, several side by side. "
	                "Results are\n"
	                "kept by content as they come; run again, only what is missing is done. In the end\n"
	                "FOLDER/results.jsonl, drops.csv, channels.csv and results.sqlite hold all of them, "
	                "and\n"
	                "messages.csv what was refused and why. host/batch/README.md has Slurm and the cost "
	                "of a million.\n"
	                "\n",
	        .words = true,
	        .note = note_given,
	        .letters = " j", /* --jobs */
	        .rows = rows,
	};

	memcpy(rows, own_rows, sizeof(own_rows));
	table.count = OWN_ROWS + analyze_rows(rows + OWN_ROWS);
	return option_read(&table, arguments, argc, argv);
}

/* ---- settings ---- */

static int by_word(const void *a, const void *b)
{
	return strcmp(*(const char *const *)a, *(const char *const *)b);
}

/* "name value", a file that is named by its content. */
static char *setting(const char *name, const char *value)
{
	const char *file = value[0] == '@' ? value + 1 : value;
	char digest[DIGEST_CHARS], path[PATH_MAX], *line;
	int64_t size;

	if (strcmp(name, "scene") == 0)
		file = installed_scene_file(value, path);
	if (strcmp(name, "columns") == 0 && value[0] != '@')
		file = "";
	if (file[0] != '\0' && digest_file(file, digest, &size, -1) == 0)
		value = digest;
	return asprintf(&line, "%s %s\n", name, value) < 0 ? NULL : line;
}

/* The sensors' files, of --chain or of the scene, by their contents. */
static int put_sensors(const struct evaluate_options *options, FILE *out)
{
	char message[SETTINGS_MESSAGE_MAX];
	struct sensors sensors;
	int result = sensors_read(&sensors, evaluate_chain(options), 0.0, message);

	for (size_t i = 0; result == 0 && i < sensors.count; i++)
		fprintf(out, "sensor %s\n", sensors.used[i].file_sha256);
	return result;
}

/* In one order, however they were given. */
static char *settings_of(const struct batch_arguments *arguments)
{
	const struct option_words *given = &arguments->given;
	char *line[OPTION_WORDS_ROOM] = {NULL};
	size_t count = 0;
	struct text text;
	int result = text_open(&text);

	if (result == 0)
		fprintf(text.out, "droptower %s\nquantities %s\n", DT_VERSION, quantity_version());
	if (result == 0)
		result = put_sensors(&arguments->analyze.evaluate, text.out);
	for (int i = 0; i < given->count && result == 0; i += 2) {
		if (strcmp(given->word[i], "chain") == 0)
			continue;
		line[count] = setting(given->word[i], given->word[i + 1]);
		result = line[count++] != NULL ? 0 : DT_E_MEMORY;
	}
	if (result == 0)
		qsort(line, count, sizeof(line[0]), by_word);
	for (size_t i = 0; i < count; i++) {
		if (result == 0)
			fputs(line[i], text.out);
		free(line[i]);
	}
	return text_close(&text, result) == 0 ? text.bytes : NULL;
}

/* ---- files ---- */

static int read_names(struct files *files, const char *name)
{
	FILE *in = strcmp(name, "-") == 0 ? stdin : fopen(name, "re");
	char *line = NULL;
	size_t room = 0;
	ssize_t length;
	int code = COMMAND_DONE;

	if (in == NULL) {
		command_error("%s: %s", name, strerror(errno));
		return COMMAND_INPUT;
	}
	while (code == COMMAND_DONE && (length = getline(&line, &room, in)) > 0) {
		if (line[length - 1] == '\n')
			line[length - 1] = '\0';
		if (line[0] != '\0' && !files_add(files, line))
			code = COMMAND_INPUT;
	}
	if (code != COMMAND_DONE || ferror(in)) {
		command_error("%s: %s", name, strerror(errno));
		code = COMMAND_INPUT;
	}
	free(line);
	if (in != stdin)
		fclose(in);
	return code;
}

/* ---- told ---- */

/* On a terminal: how far, how fast, until when. */
static void tell_progress(const struct crew_progress *p, void *context)
{
	struct told *told = context;
	double rest = (double)(told->inputs->bytes - p->bytes), new = (double)p->new_bytes;

	progress_tell(&told->progress, new / (new + rest), "%lu of %zu files, %lu results, %.0f files/s",
	              p->files, told->inputs->count, p->results,
	              (double)(p->files - p->found) / fmax(progress_seconds(&told->progress), 1e-3));
}

static void tell_refused(const struct inputs *inputs, unsigned long refused)
{
	unsigned long shown = 0;

	for (size_t i = 0; i < inputs->count && shown < REFUSALS_SHOWN; i++)
		if (inputs->input[i].noted.message != NULL) {
			command_error("%s: %s", inputs->input[i].path, inputs->input[i].noted.message);
			shown++;
		}
	if (refused > shown)
		command_error("%lu files more without a result: messages.csv has all", refused - shown);
}

static void tell_summary(const struct batch *batch, const struct told *told)
{
	const struct crew_progress *p = &batch->crew.progress;
	double passed_s = progress_seconds(&told->progress);

	printf("%lu of %zu files: %lu results, %lu without a result, %lu with a failure, %lu done before, "
	       "%lu "
	       "copies of another; %.1f s, %.0f files/s\n",
	       p->files, batch->inputs.count, p->results, p->refused, p->failed, p->found,
	       batch->collected.copies, passed_s, (double)(p->files - p->found) / fmax(passed_s, 1e-3));
	if (batch->stopped)
		puts("stopped; the same command goes on");
	else if (batch->shards > 1)
		printf("share %u of %u; the same command without --shard collects all of them in %s\n",
		       batch->shard, batch->shards, batch->folder);
	else
		printf("%s\n", batch->folder);
}

/* ---- work ---- */

static int analyse_file(const char *file, void *context)
{
	return analyze_file(file, ((struct told *)context)->analyze);
}

static int batch_files(struct batch_arguments *arguments, const struct files *files, char *settings)
{
	struct told told = {.analyze = &arguments->analyze};
	struct batch batch = {.folder = arguments->out,
	                      .settings = settings,
	                      .shard = arguments->shard,
	                      .shards = arguments->shards,
	                      .forms = arguments->forms,
	                      .crew = {.analyse = analyse_file,
	                               .context = &told,
	                               .jobs = arguments->jobs,
	                               .failed_code = COMMAND_INPUT,
	                               .limit_code = COMMAND_LIMIT,
	                               .tell = tell_progress}};
	char message[STORE_MESSAGE_MAX];
	int result, code;

	told.inputs = &batch.inputs;
	progress_begin(&told.progress, 0.0);
	interrupt_catch();
	result = batch_work(&batch, files->file, files->count, message);
	progress_end(&told.progress);
	if (result != 0) {
		command_error("%s", message);
		code = COMMAND_INPUT;
	} else {
		tell_refused(&batch.inputs, batch.crew.progress.refused);
		tell_summary(&batch, &told);
		code = batch.collected.refused > 0 ? COMMAND_INPUT : batch.crew.progress.code;
		code = batch.stopped ? COMMAND_REFUSED : code;
	}
	batch_end(&batch);
	return code;
}

static int batch_words(struct batch_arguments *arguments, char **words, int count)
{
	struct files files;
	char *settings;
	int code = files_expand(&files, words, count);

	if (code != COMMAND_DONE)
		return code;
	if (arguments->list != NULL)
		code = read_names(&files, arguments->list);
	settings = code == COMMAND_DONE ? settings_of(arguments) : NULL;
	if (settings != NULL)
		code = batch_files(arguments, &files, settings);
	else if (code == COMMAND_DONE) {
		command_error("%s", error_text(DT_E_MEMORY));
		code = COMMAND_INPUT;
	}
	free(settings);
	files_free(&files);
	return code;
}

static unsigned processors(void)
{
	cpu_set_t set;
	int count = sched_getaffinity(0, sizeof(set), &set) == 0 ? CPU_COUNT(&set) : 1;

	return count > 0 ? (unsigned)count : 1;
}

int command_batch(int argc, char **argv)
{
	struct batch_arguments arguments = {
	        .jobs = processors(), .shard = 1, .shards = 1, .forms = COLLECT_ALL};
	int code;

	analyze_begin(&arguments.analyze);
	arguments.analyze.evaluate.json = true;
	code = batch_read(&arguments, argc, argv);
	if (code != OPTIONS_READ)
		return code;
	if (arguments.out == NULL)
		return command_usage("batch", "no --out FOLDER given");
	if (optind == argc && arguments.list == NULL)
		return command_usage("batch", "no FILE given");
	if (evaluate_is_list(arguments.analyze.evaluate.limits))
		return command_usage("batch", EVALUATE_NO_LIST);
	code = analyze_ready(&arguments.analyze, "batch");
	if (code == COMMAND_DONE)
		code = batch_words(&arguments, argv + optind, argc - optind);
	analyze_end(&arguments.analyze);
	return code;
}
