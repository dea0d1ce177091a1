/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "common/assert.h"

#include <stdio.h>
#include <unistd.h>

void assert_failed(const char *file, int line, const char *condition)
{
	fprintf(stderr, "%s:%d: this cannot be: not %s; please report it\n", file, line, condition);
	_exit(ASSERT_EXIT);
}
