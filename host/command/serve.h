/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_COMMAND_SERVE_H
#define DT_HOST_COMMAND_SERVE_H
/*
 * The options of `droptower serve`, which this program tells and droptower-console reads.
 */
#include "common/base/option.h"

enum { SERVE_SCENES_MAX = 64, SERVE_BENCH_WORDS_MAX = 24 };

struct serve_arguments {
	const char *link, *control, *archive, *series, *operator_name, *address, *token_file;
	unsigned port;
	struct option_words scenes, bench;
};

extern const struct option_table serve_options; /* into a struct serve_arguments */

#endif
