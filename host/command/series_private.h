/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_COMMAND_SERIES_PRIVATE_H
#define DT_HOST_COMMAND_SERIES_PRIVATE_H
/*
 * What the files of `droptower series` share: its options, and its verbs. Every function returns a COMMAND_*
 * exit code and has printed what was wrong.
 */
#include <stdbool.h>

#include "host/archive/archive.h"

struct series_arguments {
	const char *archive, *csv, *reason, *note, *operator_name, *reference, *scene, *date, *chain;
	bool json, rebuild, fewer, undecided, simulated;
	unsigned drops;
	double height_m;
	struct archive_filter filter;
	struct archive_dates dates;
	int count;
	char **word; /* behind the verb */
};

/* series.c has checked the number of words behind each verb. */
int series_verb_list(struct archive *archive, struct series_arguments *arguments);
int series_verb_drops(struct archive *archive, struct series_arguments *arguments);
int series_verb_show(struct archive *archive, struct series_arguments *arguments);
int series_verb_tables(struct archive *archive, struct series_arguments *arguments);
int series_verb_result(struct archive *archive, struct series_arguments *arguments);

int series_verb_new(struct archive *archive, struct series_arguments *arguments);
int series_verb_add(struct archive *archive, struct series_arguments *arguments);
int series_verb_accept(struct archive *archive, struct series_arguments *arguments);
int series_verb_reject(struct archive *archive, struct series_arguments *arguments);
int series_verb_reopen(struct archive *archive, struct series_arguments *arguments);
int series_verb_note(struct archive *archive, struct series_arguments *arguments);
int series_verb_photo(struct archive *archive, struct series_arguments *arguments);
int series_verb_reanalyse(struct archive *archive, struct series_arguments *arguments);

/* Makes the index again, then analyses what came without a result. */
int series_rebuild(const struct series_arguments *arguments);

/* Whether the sensors' files of --chain can be used, if that was given. */
int series_check_chain(const struct series_arguments *arguments);

/* Complains when there is no series of that name. */
int series_must_be(struct archive *archive, const char *name);

/* Prints what is wrong with a raw file; context: int that counts them. */
void series_tell_wrong(void *context, const char *text);

#endif
