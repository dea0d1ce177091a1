/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The journal of verbs: its lines, its place, what it makes of hostile names, and that many writers lose
 * nothing.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <regex.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "host/session/journal.h"
#include "tests/unit/scratch.h"

static char folder[64];

static int set_up(void **state)
{
	(void)state;
	return mkdtemp(scratch_name(folder, "journal")) == NULL;
}

static int tear_down(void **state)
{
	char command[128];

	(void)state;
	snprintf(command, sizeof(command), "rm -r %s", folder);
	return system(command);
}

static void expect_line(const char *path, const char *pattern)
{
	FILE *file = fopen(path, "r");
	char line[1024] = "", text[1024];
	regex_t regex;

	assert_non_null(file);
	while (fgets(text, sizeof(text), file) != NULL)
		memcpy(line, text, sizeof(line));
	fclose(file);
	assert_int_equal(regcomp(&regex, pattern, REG_EXTENDED), 0);
	if (regexec(&regex, line, 0, NULL, 0) != 0)
		fail_msg("'%s' is not '%s'", line, pattern);
	regfree(&regex);
}

#define TIME "^20[0-9]{2}-[01][0-9]-[0-3][0-9]T[0-2][0-9]:[0-5][0-9]:[0-6][0-9]\\.[0-9]{3}Z "

static void lines(void **state)
{
	char path[128];
	struct stat file;

	(void)state;
	snprintf(path, sizeof(path), "%s/journal", folder);
	assert_int_equal(setenv("DROPTOWER_JOURNAL", path, 1), 0);
	journal_write(&(struct journal_line){"ctl", "ann", 0x1A2B3C4D, "ARM", NULL});
	expect_line(path, TIME "ctl\\[[0-9]+\\] ann session 1a2b3c4d ARM taken\n$");
	assert_int_equal(stat(path, &file), 0);
	assert_int_equal(file.st_mode & 07777, 0600);
	journal_write(&(struct journal_line){"run", NULL, 1, "RELEASE", "the warning is not over yet"});
	expect_line(path, TIME
	            "run\\[[0-9]+\\] [^ ]+ session 00000001 RELEASE refused: the warning is not over yet\n$");
	journal_write(&(struct journal_line){"page", "a\nb c\x1B[2J", 1, "AB ORT\n", "x\ny"});
	expect_line(path,
	            TIME "page\\[[0-9]+\\] a\\?b_c\\?\\[2J session 00000001 AB_ORT\\? refused: x\\?y\n$");
}

static void long_texts(void **state)
{
	char path[128], text[2000];

	(void)state;
	snprintf(path, sizeof(path), "%s/journal", folder);
	memset(text, 'x', sizeof(text));
	text[sizeof(text) - 1] = '\0';
	assert_int_equal(setenv("DROPTOWER_JOURNAL", path, 1), 0);
	journal_write(&(struct journal_line){"ctl", text, 1, text, text});
	expect_line(path, TIME "ctl\\[[0-9]+\\] x{64} session 00000001 x{64} refused: x{255}x*\n$"); /* cut */
}

static void places(void **state)
{
	char path[192];

	(void)state;
	assert_int_equal(unsetenv("DROPTOWER_JOURNAL"), 0);
	snprintf(path, sizeof(path), "%s/state", folder);
	assert_int_equal(setenv("XDG_STATE_HOME", path, 1), 0);
	journal_write(&(struct journal_line){"ctl", "ann", 1, "CLEAR", NULL});
	snprintf(path, sizeof(path), "%s/state/droptower/journal.log", folder);
	expect_line(path, "CLEAR taken");
	assert_int_equal(unsetenv("XDG_STATE_HOME"), 0);
	assert_int_equal(setenv("HOME", folder, 1), 0);
	journal_write(&(struct journal_line){"ctl", "ann", 2, "CLEAR", NULL});
	snprintf(path, sizeof(path), "%s/.local/state/droptower/journal.log", folder);
	expect_line(path, "session 00000002 CLEAR taken");
}

/* No line is lost or mixed with another's. */
static void many_writers(void **state)
{
	enum { WRITERS = 8, LINES = 200 };
	char path[128], line[1024];
	unsigned count = 0;
	FILE *file;

	(void)state;
	snprintf(path, sizeof(path), "%s/many", folder);
	assert_int_equal(setenv("DROPTOWER_JOURNAL", path, 1), 0);
	for (unsigned i = 0; i < WRITERS; i++) {
		pid_t child = fork();

		assert_true(child >= 0);
		if (child == 0) {
			for (unsigned k = 0; k < LINES; k++)
				journal_write(&(struct journal_line){"ctl", "ann", i, "ABORT", NULL});
			_exit(0);
		}
	}
	for (unsigned i = 0; i < WRITERS; i++)
		assert_true(wait(NULL) > 0);
	file = fopen(path, "r");
	assert_non_null(file);
	while (fgets(line, sizeof(line), file) != NULL) {
		const char *end = strstr(line, " ABORT taken\n");

		assert_non_null(end);
		assert_int_equal(strlen(end), strlen(" ABORT taken\n"));
		count++;
	}
	fclose(file);
	assert_int_equal(count, WRITERS * LINES);
}

/* It says so, and goes on. */
static void nowhere(void **state)
{
	char path[128];

	(void)state;
	snprintf(path, sizeof(path), "%s", folder); /* a folder is no file */
	assert_int_equal(setenv("DROPTOWER_JOURNAL", path, 1), 0);
	journal_write(&(struct journal_line){"ctl", "ann", 1, "ABORT", NULL});
	assert_int_equal(setenv("DROPTOWER_JOURNAL", "/dev/full", 1), 0);
	journal_write(&(struct journal_line){"ctl", "ann", 1, "ABORT", NULL});
}

static void sender(void **state)
{
	char text[32];

	(void)state;
	journal_sender("run", text, sizeof(text));
	assert_non_null(strstr(text, "/run["));
	assert_true(strlen(text) < sizeof(text));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(lines),        cmocka_unit_test(long_texts), cmocka_unit_test(places),
	        cmocka_unit_test(many_writers), cmocka_unit_test(nowhere),    cmocka_unit_test(sender),
	};

	return cmocka_run_group_tests(tests, set_up, tear_down);
}
