/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Linked into a unit test whose firmware and host modules have every mutant in them (see instrument).
 * DT_MUTANT=N chooses one, 0 or none leaves the code right. DT_REACHED=FILE: the numbers of the mutants that
 * the run came by are written there. DT_LIMIT_MS ends the run by SIGPROF after so much processor time. The
 * first assertion that fails ends the program with MUTANT_KILLED: what follows it would only take time.
 */
#include <stdio.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <unistd.h>

enum {
	MUTANTS_MAX = 200000,
	MUTANT_KILLED = 99,
};

unsigned dt_mutant_chosen;
unsigned char dt_mutant_reached[MUTANTS_MAX];

/* cmocka's own, which every assertion of it ends in. */
void _fail(const char *file, int line);
void cmocka_set_skip_filter(const char *pattern);

void _fail(const char *file, int line)
{
	fprintf(stderr, "%s:%d: killed\n", file, line);
	fflush(NULL);
	_exit(MUTANT_KILLED);
}

static unsigned number(const char *name)
{
	const char *text = getenv(name);

	return text == NULL ? 0 : (unsigned)strtoul(text, NULL, 10);
}

/* Before the tables are spoilt (priority 200). */
__attribute__((constructor(101))) static void choose(void)
{
	unsigned limit_ms = number("DT_LIMIT_MS");
	struct itimerval limit = {.it_value = {limit_ms / 1000, limit_ms % 1000 * 1000}};

	dt_mutant_chosen = number("DT_MUTANT");
	cmocka_set_skip_filter(
	        "*stay*safe"); /* random walks: long, and what they find others must find too */
	setitimer(ITIMER_PROF, &limit, NULL);
	setrlimit(RLIMIT_CORE, &(struct rlimit){0, 0});
}

__attribute__((destructor)) static void tell(void)
{
	const char *path = getenv("DT_REACHED");
	FILE *file = path == NULL || *path == 0 ? NULL : fopen(path, "w");

	if (file == NULL)
		return;
	for (unsigned n = 0; n < MUTANTS_MAX; n++)
		if (dt_mutant_reached[n])
			fprintf(file, "%u\n", n);
	fclose(file);
}
