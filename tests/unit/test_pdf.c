/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Printing a page, with browsers of our own making on PATH: what they are given, and what comes of those that
 * are missing, fail, print something else or do not end.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <dirent.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "host/report/pdf.h"
#include "tests/unit/scratch.h"

#define PAGE "<!DOCTYPE html><title>a page</title>"

/* bin has the browsers, temporary is where their folders are made, and seen what they say of themselves. */
static char folder[SCRATCH_MAX], bin[80], temporary[80], seen[80], home[128];
static char message[512];

static int set_up(void **state)
{
	char path[256];

	(void)state;
	snprintf(home, sizeof(home), "%s", getenv("TMPDIR") ? getenv("TMPDIR") : "/tmp");
	if (!mkdtemp(scratch_name(folder, "pdf-test")))
		return 1;
	snprintf(bin, sizeof(bin), "%s/bin", folder);
	snprintf(temporary, sizeof(temporary), "%s/with a blank #", folder);
	snprintf(seen, sizeof(seen), "%s/seen", folder);
	snprintf(path, sizeof(path), "%s/none:%s", folder, bin);
	return mkdir(bin, 0700) || mkdir(temporary, 0700) || setenv("PATH", path, 1) ||
	       setenv("TMPDIR", temporary, 1);
}

static int tear_down(void **state)
{
	char command[128];

	(void)state;
	snprintf(command, sizeof(command), "/bin/rm -rf '%s'", folder);
	return system(command) || setenv("TMPDIR", home, 1);
}

static void browser(const char *name, const char *script)
{
	char path[160];
	FILE *out;

	snprintf(path, sizeof(path), "%s/%s", bin, name);
	out = fopen(path, "w");
	assert_non_null(out);
	fprintf(out, "#!/bin/sh\nPATH=/usr/bin:/bin\n%s\n", script);
	assert_int_equal(fclose(out), 0);
	assert_int_equal(chmod(path, 0700), 0);
}

static int print(int (*stop)(void), char **pdf, size_t *length)
{
	message[0] = '\0';
	return pdf_print(PAGE, strlen(PAGE), stop, pdf, length, message, sizeof(message));
}

/* Its folder, with all that the browser left, is gone. */
static void assert_clean(void)
{
	DIR *d = opendir(temporary);
	int count = 0;

	assert_non_null(d);
	while (readdir(d))
		count++;
	closedir(d);
	assert_int_equal(count, 2); /* . and .. */
}

static void assert_fails(int result, int expected, const char *says)
{
	assert_int_equal(result, expected);
	assert_non_null(strstr(message, says));
	assert_null(strchr(message, '\n'));
	assert_clean();
}

static void assert_seen(const char *line, bool there)
{
	char text[8192];
	FILE *in = fopen(seen, "r");
	size_t n;

	assert_non_null(in);
	n = fread(text, 1, sizeof(text) - 1, in);
	fclose(in);
	text[n] = '\0';
	if ((strstr(text, line) != NULL) != there)
		fail_msg("'%s' is %sin:\n%s", line, there ? "not " : "", text);
}

static void test_prints(void **state)
{
	char script[512], *pdf = NULL;
	size_t length = 0;

	(void)state;
	snprintf(script, sizeof(script),
	         "{ printf '%%s\\n' \"$@\"; echo; env; cat page.html; } >'%s'\n"
	         "mkdir -p profile/deep; touch profile/deep/file; ln -s / profile/link\n"
	         "printf '%%%%PDF-1.4 of a page' >page.pdf",
	         seen);
	browser("chromium-browser", script);
	assert_int_equal(setenv("SECRET_OF_MINE", "yes", 1), 0);
	if (print(NULL, &pdf, &length))
		fail_msg("%s", message);
	assert_int_equal(length, strlen("%PDF-1.4 of a page"));
	assert_memory_equal(pdf, "%PDF-1.4 of a page", length);
	free(pdf);
	assert_seen(PAGE, true);
	assert_seen("--headless\n", true);
	assert_seen("--no-pdf-header-footer\n", true);
	assert_seen("--no-sandbox\n", geteuid() == 0);
	assert_seen("SECRET_OF_MINE", false);
	assert_clean();
}

static void test_no_browser(void **state)
{
	char *pdf = NULL;
	size_t length = 0;

	(void)state;
	assert_fails(print(NULL, &pdf, &length), DT_E_UNKNOWN, "chromium-browser");
	assert_null(pdf);
}

static void test_browser_fails(void **state)
{
	char *pdf = NULL;
	size_t length = 0;

	(void)state;
	browser("chromium", "printf '%%PDF-1.4' >page.pdf; exit 1");
	assert_fails(print(NULL, &pdf, &length), DT_E_SYSTEM, "the browser failed");
	browser("chromium", "exit 0");
	assert_fails(print(NULL, &pdf, &length), DT_E_SYSTEM, "the browser failed");
	browser("chromium", "echo no PDF at all >page.pdf");
	assert_fails(print(NULL, &pdf, &length), DT_E_SYSTEM, "the browser failed");
	assert_null(pdf);
}

static int at_once(void)
{
	return 1;
}

/* Its children, too: the file would appear. */
static void test_stopped(void **state)
{
	char script[256], *pdf = NULL;
	size_t length = 0;

	(void)state;
	snprintf(script, sizeof(script),
	         "(while [ ! -e '%s/ended' ]; do sleep 0.1; done; touch '%s/late') & sleep 1000", folder,
	         folder);
	browser("chromium", script);
	assert_fails(print(at_once, &pdf, &length), DT_E_CLOSED, "interrupted");
	snprintf(script, sizeof(script), "%s/ended", folder);
	assert_int_equal(mkdir(script, 0700), 0);
	sleep(1);
	assert_int_equal(rmdir(script), 0);
	snprintf(script, sizeof(script), "%s/late", folder);
	assert_int_equal(access(script, F_OK), -1);
}

static void test_no_temporary_folder(void **state)
{
	char *pdf = NULL, gone[128];
	size_t length = 0;
	int result;

	(void)state;
	browser("chromium", "exit 0");
	snprintf(gone, sizeof(gone), "%s/gone", folder);
	assert_int_equal(setenv("TMPDIR", gone, 1), 0);
	result = print(NULL, &pdf, &length);
	assert_int_equal(setenv("TMPDIR", temporary, 1), 0);
	assert_fails(result, DT_E_SYSTEM, "no temporary folder");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test_setup_teardown(test_prints, set_up, tear_down),
	        cmocka_unit_test_setup_teardown(test_no_browser, set_up, tear_down),
	        cmocka_unit_test_setup_teardown(test_browser_fails, set_up, tear_down),
	        cmocka_unit_test_setup_teardown(test_stopped, set_up, tear_down),
	        cmocka_unit_test_setup_teardown(test_no_temporary_folder, set_up, tear_down),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
