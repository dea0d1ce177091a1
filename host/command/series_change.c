/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The verbs of `droptower series` that change an archive: series, decisions, notes, results. Logs are added
 * by series_add.c.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/command/archived.h"
#include "host/base/installed.h"
#include "host/base/durable.h"
#include "host/command/command.h"
#include "host/command/evaluate.h"
#include "host/command/series_private.h"

/* ---- a new series, and its sensors ---- */

int series_check_chain(const struct series_arguments *a)
{
	return a->chain != NULL ? evaluate_check_chain(a->chain) : COMMAND_DONE;
}

int series_verb_new(struct archive *archive, struct series_arguments *a)
{
	const char *campaign = a->filter.campaign != NULL ? a->filter.campaign : "default";
	int code = series_check_chain(a);
	char path[PATH_MAX];
	struct scene scene;

	if (code == COMMAND_DONE && a->chain == NULL)
		code = evaluate_read_scene(&scene, a->scene, NAN);
	if (code != COMMAND_DONE)
		return code;
	if (archive_new_series(archive, a->word[0], campaign, installed_scene_file(a->scene, path),
	                       a->filter.angle_deg, a->height_m, a->chain, a->drops > 0 ? a->drops : 5) != 0)
		return archived_failed(archive);
	printf("series %s\n", a->word[0]);
	return COMMAND_DONE;
}

/* ---- the drops that a verb works on ---- */

/* The drops that a verb works on: looked up first, since what it does changes the list. */
struct chosen {
	struct {
		char name[ARCHIVE_NAME_MAX + 16], series[ARCHIVE_NAME_MAX + 1];
		unsigned number;
	} * drop;
	size_t count, room;
	bool undecided_only, without_result_only;
};

static int choose_one(void *context, const struct archive_drop *drop)
{
	struct chosen *c = context;

	if (drop->sha256[0] == '\0' || (c->undecided_only && strcmp(drop->decision, "open") != 0) ||
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
	c->drop[c->count++].number = drop->number;
	return 0;
}

static int series_change_choose(struct archive *archive, const char *series, struct chosen *chosen)
{
	struct archive_filter filter = archive_filter_none();
	int code = series != NULL ? series_must_be(archive, series) : COMMAND_DONE;

	filter.series = series;
	if (code == COMMAND_DONE && archive_each_drop(archive, &filter, choose_one, chosen) != 0)
		code = archived_failed(archive);
	return code;
}

/* Analyses all chosen, and goes on past those that cannot be. */
static int analyse_chosen(struct archive *archive, struct chosen *chosen, const char *chain)
{
	int code = COMMAND_DONE;

	for (size_t i = 0; i < chosen->count && !interrupt_came(); i++) {
		int one = archived_analyse(archive, chosen->drop[i].series, chosen->drop[i].number, chain);

		if (one != COMMAND_DONE)
			code = one;
	}
	if (interrupt_came())
		command_error("interrupted; the rest keeps the results it had");
	free(chosen->drop);
	return interrupt_came() ? COMMAND_REFUSED : code;
}

/* ---- decisions and notes ---- */

static int decide(struct archive *archive, const struct series_arguments *a, const char *drop,
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

static int accept_series(struct archive *archive, const struct series_arguments *a, const char *series)
{
	struct chosen chosen = {.undecided_only = true};
	int code = series_change_choose(archive, series, &chosen);

	for (size_t i = 0; i < chosen.count && code == COMMAND_DONE; i++)
		code = decide(archive, a, chosen.drop[i].name, ARCHIVE_ACCEPTED);
	if (code == COMMAND_DONE && chosen.count == 0)
		printf("%s: no drop to decide\n", series);
	free(chosen.drop);
	return code;
}

int series_verb_accept(struct archive *archive, struct series_arguments *a)
{
	int code = COMMAND_DONE;

	for (int i = 0; i < a->count && code == COMMAND_DONE; i++)
		code = strchr(a->word[i], '/') != NULL ? decide(archive, a, a->word[i], ARCHIVE_ACCEPTED)
		                                       : accept_series(archive, a, a->word[i]);
	return code;
}

static int decide_each(struct archive *archive, const struct series_arguments *a,
                       enum archive_decision decision)
{
	int code = COMMAND_DONE;

	for (int i = 0; i < a->count && code == COMMAND_DONE; i++)
		code = decide(archive, a, a->word[i], decision);
	return code;
}

int series_verb_reject(struct archive *archive, struct series_arguments *a)
{
	return decide_each(archive, a, ARCHIVE_REJECTED);
}

int series_verb_reopen(struct archive *archive, struct series_arguments *a)
{
	return decide_each(archive, a, ARCHIVE_OPEN);
}

int series_verb_note(struct archive *archive, struct series_arguments *a)
{
	if (archive_note(archive, a->word[0], a->operator_name, a->word[1]) != 0)
		return archived_failed(archive);
	return COMMAND_DONE;
}

int series_verb_photo(struct archive *archive, struct series_arguments *a)
{
	bool after = strcmp(a->word[1], "after") == 0;
	char *bytes;
	size_t size;
	int result;

	if (!after && strcmp(a->word[1], "before") != 0)
		return command_usage("series", "photo: '%s', expected before or after", a->word[1]);
	bytes = durable_read(a->word[2], &size);
	if (bytes == NULL) {
		command_error("%s: %s", a->word[2], strerror(errno));
		return COMMAND_INPUT;
	}
	result = archive_photo(archive, a->word[0], after, a->operator_name, bytes, size);
	free(bytes);
	return result != 0 ? archived_failed(archive) : COMMAND_DONE;
}

/* ---- analysed again ---- */

int series_verb_reanalyse(struct archive *archive, struct series_arguments *a)
{
	int code = series_check_chain(a);

	interrupt_catch();
	for (int i = 0; i < a->count && code == COMMAND_DONE; i++) {
		struct chosen chosen = {0};

		code = series_change_choose(archive, a->word[i], &chosen);
		if (code == COMMAND_DONE)
			code = analyse_chosen(archive, &chosen, a->chain);
	}
	return code;
}

/* Then analyses what came without a result. */
int series_rebuild(const struct series_arguments *a)
{
	struct chosen chosen = {.without_result_only = true};
	char message[ARCHIVE_MESSAGE_MAX];
	struct archive *archive;
	int wrong = 0, code;

	if (archive_rebuild(a->archive, a->fewer, series_tell_wrong, &wrong, message) != 0 ||
	    (archive = archive_open(a->archive, ARCHIVE_WRITE, message)) == NULL) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	interrupt_catch();
	code = series_change_choose(archive, NULL, &chosen);
	if (code == COMMAND_DONE)
		code = analyse_chosen(archive, &chosen, a->chain);
	archive_close(archive);
	printf("%s: index made again from the raw files\n", a->archive);
	return code == COMMAND_DONE && wrong > 0 ? COMMAND_INPUT : code;
}
