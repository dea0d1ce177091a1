/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * All unit tests in one program, which runs the one it is called by: build/tests/test_X is a link to it,
 * whose main is test_X_main here. `unit test_X` runs it as well.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define UNIT(name) int name##_main(int count, char *words[]);
#include <droptower_units.h>
#undef UNIT

static const struct {
	const char *name;
	int (*run)(int, char *[]);
} units[] = {
#define UNIT(name) {#name, name##_main},
#include <droptower_units.h>
#undef UNIT
};

int main(int count, char *words[])
{
	const char *name = program_invocation_short_name;

	setenv("DROPTOWER_JOURNAL", "/dev/null", 0); /* not the one of who runs this */
	if (strcmp(name, "unit") == 0 && count > 1)
		name = words[1];
	for (size_t i = 0; i < sizeof(units) / sizeof(units[0]); i++)
		if (strcmp(units[i].name, name) == 0)
			return units[i].run(count, words);
	fprintf(stderr, "%s: no such unit test\n", name);
	return 2;
}
