/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_UNIT_SCRATCH_H
#define DT_TESTS_UNIT_SCRATCH_H
/*
 * Where a test puts what it writes: a name for mkdtemp or mkstemp in the temporary folder of this run, which
 * tests/run removes however the test ends.
 */
#include <stdio.h>
#include <stdlib.h>

enum { SCRATCH_MAX = 64 };

static inline char *scratch_name(char path[SCRATCH_MAX], const char *what)
{
	const char *folder = getenv("TMPDIR");

	if (folder == NULL || snprintf(path, SCRATCH_MAX, "%s/%s-XXXXXX", folder, what) >= SCRATCH_MAX)
		snprintf(path, SCRATCH_MAX, "/tmp/droptower-%s-XXXXXX", what);
	return path;
}

#endif
