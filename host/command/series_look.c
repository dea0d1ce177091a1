/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The verbs of `droptower series` that look: lists, tables, results, what is there and sound.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/archive/print.h"
#include "host/command/archived.h"
#include "host/command/command.h"
#include "host/command/series_private.h"
#include "host/base/atomic_file.h"

int series_must_be(struct archive *archive, const char *name)
{
	struct scene scene;

	return archive_scene(archive, name, &scene) == 0 ? COMMAND_DONE : archived_failed(archive);
}

/* How a printing verb ends: to standard output, or into the file of --csv. */
static int print_failed(const struct archive *archive, int result)
{
	if (result == DT_E_MEMORY || archive_message(archive)[0] == '\0')
		return command_output_failed(result == DT_E_MEMORY ? error_text(result) : strerror(errno));
	return archived_failed(archive);
}

struct job {
	struct archive *archive;
	struct series_arguments *arguments;
	int (*print)(struct job *job, enum table_format format, FILE *out);
};

static int print(struct job *job)
{
	const struct series_arguments *a = job->arguments;
	char message[512];
	struct atomic_file atomic;
	int result;

	if (a->csv == NULL || strcmp(a->csv, "-") == 0) {
		result = job->print(job,
		                    a->csv != NULL ? TABLE_CSV
		                    : a->json      ? TABLE_JSON
		                                   : TABLE_TEXT,
		                    stdout);
		return result == 0 ? COMMAND_DONE : print_failed(job->archive, result);
	}
	result = atomic_file_open(&atomic, a->csv, message, sizeof(message));
	if (result == 0)
		result = atomic_file_close(&atomic, job->print(job, TABLE_CSV, atomic.out), message,
		                           sizeof(message));
	if (result == 0)
		return COMMAND_DONE;
	command_error("%s",
	              archive_message(job->archive)[0] != '\0' ? archive_message(job->archive) : message);
	return COMMAND_INPUT;
}

static int print_list(struct job *job, enum table_format format, FILE *out)
{
	return print_series(job->archive, &job->arguments->filter, format, out);
}

static int print_all(struct job *job, enum table_format format, FILE *out)
{
	return print_drops(job->archive, &job->arguments->filter, job->arguments->undecided, format, out);
}

static int series_look_print_table(struct job *job, enum table_format format, FILE *out)
{
	return print_tables(job->archive, &job->arguments->filter, job->arguments->undecided,
	                    job->arguments->reference, format, out);
}

int series_verb_list(struct archive *archive, struct series_arguments *a)
{
	return print(&(struct job){archive, a, print_list});
}

int series_verb_drops(struct archive *archive, struct series_arguments *a)
{
	return print(&(struct job){archive, a, print_all});
}

int series_verb_show(struct archive *archive, struct series_arguments *a)
{
	int code = series_must_be(archive, a->word[0]);

	a->filter.series = a->word[0];
	if (code == COMMAND_DONE)
		code = print(&(struct job){archive, a, print_all});
	if (code == COMMAND_DONE && archive_unread(archive)[0] != '\0') {
		command_error("%s", archive_unread(archive));
		code = COMMAND_INPUT;
	}
	return code;
}

static int count_one(void *context, const struct archive_series *series)
{
	int *count = context;

	(void)series;
	(*count)++;
	return 0;
}

static int campaign_must_be(struct archive *archive, const char *campaign)
{
	struct archive_filter filter = archive_filter_none();
	int count = 0;

	filter.campaign = campaign;
	if (archive_each_series(archive, &filter, count_one, &count) != 0)
		return archived_failed(archive);
	if (count > 0)
		return COMMAND_DONE;
	command_error("no campaign '%s' in %s", campaign, archive_folder(archive));
	return COMMAND_INPUT;
}

int series_verb_tables(struct archive *archive, struct series_arguments *a)
{
	int code = COMMAND_DONE;

	if (a->count == 1)
		a->filter.campaign = a->word[0];
	if (a->filter.campaign != NULL)
		code = campaign_must_be(archive, a->filter.campaign);
	return code != COMMAND_DONE ? code : print(&(struct job){archive, a, series_look_print_table});
}

int series_verb_result(struct archive *archive, struct series_arguments *a)
{
	char *json;
	bool failed;

	if (archive_json(archive, a->word[0], a->filter.version, &json) != 0)
		return archived_failed(archive);
	failed = fputs(json, stdout) < 0 || fflush(stdout) != 0;
	free(json);
	return failed ? command_output_failed(strerror(errno)) : COMMAND_DONE;
}

void series_tell_wrong(void *context, const char *text)
{
	int *count = context;

	(*count)++;
	command_error("%s", text);
}
