/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_COMMAND_ANALYZE_H
#define DT_HOST_COMMAND_ANALYZE_H
/*
 * What `analyze` does with a file, for `batch`, which does the same with many: its options, what they name
 * read once, and a file analysed by them. Results go to standard output, errors to stderr.
 */
#include "common/base/option.h"
#include "host/command/evaluate.h"
#include "host/command/stretch.h"

struct analyze_arguments {
	const char *columns, *profile, *save_profile, *scene_file, *band_file;
	char profile_as_columns[4096];
	double angle_deg;
	unsigned drop; /* of the log; 0: all */
	bool list, repeats;
	struct stretch stretch;
	struct evaluate_options evaluate;
	struct limit_curve band; /* these two are what the options name */
	struct scene scene;
};

/* Before options are read. */
void analyze_begin(struct analyze_arguments *arguments);

/* The rows of options that say how a recording is analysed, not what is shown of it; how many. They read
 * into struct analyze_arguments. */
int analyze_rows(struct option_row rows[OPTION_ROWS_MAX]);

/* Whether options agree, for the command of that name; then what they name is read. A COMMAND_* code, errors
 * printed. analyze_end in any case. */
int analyze_ready(struct analyze_arguments *arguments, const char *command);
void analyze_end(struct analyze_arguments *arguments);

/* A COMMAND_* code. */
int analyze_file(const char *file, const struct analyze_arguments *arguments);

#endif
