/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * accuracy [--drops N] [--only TEXT] [--quiet]: every cell, one table; exit 1 if one is out of its limits.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <gsl/gsl_errno.h>

#include "tests/accuracy/cells.h"

static int judge(const struct cells *cells, enum cells_print print)
{
	unsigned failed = 0, judged = 0;

	for (int group = 0; group < GROUPS; group++) {
		unsigned more;

		failed += cells_judge(cells, (enum group)group, 0, print, &more);
		judged += more;
	}
	printf("%u cells, %u out of their limits\n", judged, failed);
	return failed > 0 || judged == 0;
}

int main(int argc, char **argv)
{
	struct cells_options options = {.drops = 10000, .all = true};
	struct cells cells;
	enum cells_print print = CELLS_ALL;
	int code;

	for (int i = 1; i < argc; i++) {
		if (strcmp(argv[i], "--quiet") == 0)
			print = CELLS_FAILURES;
		else if (strcmp(argv[i], "--drops") == 0 && i + 1 < argc)
			options.drops = (unsigned)strtoul(argv[++i], NULL, 10);
		else if (strcmp(argv[i], "--only") == 0 && i + 1 < argc)
			options.only = argv[++i];
		else
			return fprintf(stderr, "accuracy [--drops N] [--only TEXT] [--quiet]\n"), 2;
	}
	gsl_set_error_handler_off();
	printf("%u drops a scene; ratio is the error over the Cramer-Rao bound (limit), covers is what two "
	       "reported sigma cover\n",
	       options.drops);
	fflush(stdout);
	cells_run(&options, &cells);
	code = judge(&cells, print);
	cells_free(&cells);
	return code;
}
