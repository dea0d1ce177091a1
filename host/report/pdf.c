/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/report/pdf.h"

#include <poll.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/pidfd.h>
#include <time.h>
#include <unistd.h>

#include "common/base/process.h"
#include "common/link/temporary.h"
#include "host/base/atomic_file.h"
#include "host/base/durable.h"

enum { LIMIT_MS = 60000, ASK_MS = 100, FOLDER_MAX = TEMPORARY_PATH_MAX, PROGRAM_MAX = 4096 };

static const char *const browsers[] = {"chromium", "chromium-browser", "google-chrome"};
enum { BROWSERS = sizeof(browsers) / sizeof(browsers[0]) };

/* The first of them that PATH has. */
static bool find_in(const char *path, const char *name, char program[PROGRAM_MAX])
{
	for (const char *end; *path; path = *end ? end + 1 : end) {
		end = path + strcspn(path, ":");
		if (end > path &&
		    snprintf(program, PROGRAM_MAX, "%.*s/%s", (int)(end - path), path, name) < PROGRAM_MAX &&
		    access(program, X_OK) == 0)
			return true;
	}
	return false;
}

static bool find_browser(char program[PROGRAM_MAX])
{
	const char *path = getenv("PATH");

	for (int i = 0; path && i < BROWSERS; i++)
		if (find_in(path, browsers[i], program))
			return true;
	return false;
}

/* Starts it in folder, where page.html is and page.pdf is wanted; 0 or errno. */
static int pdf_start(const char *program, const char *folder, pid_t *pid)
{
	char profile[FOLDER_MAX + 32], home[FOLDER_MAX + 32], temporary[FOLDER_MAX + 32],
	        path[PROGRAM_MAX + 32];
	const char *const words[] = {program,
	                             "--headless",
	                             "--disable-gpu",
	                             "--disable-dev-shm-usage",
	                             "--disable-background-networking",
	                             "--disable-component-update",
	                             "--no-pdf-header-footer",
	                             "--no-first-run",
	                             "--print-to-pdf=page.pdf",
	                             profile,
	                             geteuid() == 0 ? "--no-sandbox" : "page.html",
	                             geteuid() == 0 ? "page.html" : NULL,
	                             NULL};
	const char *const environment[] = {path, home, temporary, "LANG=C.UTF-8", NULL};

	snprintf(profile, sizeof(profile), "--user-data-dir=%s/profile", folder);
	snprintf(home, sizeof(home), "HOME=%s", folder);
	snprintf(temporary, sizeof(temporary), "TMPDIR=%s", folder);
	snprintf(path, sizeof(path), "PATH=%s", getenv("PATH"));
	return process_start(&(struct process){.words = words,
	                                       .environment = environment,
	                                       .folder = folder,
	                                       .fd = {PROCESS_NOTHING, PROCESS_NOTHING, PROCESS_NOTHING},
	                                       .alone = true}, /* so that all of it can be ended */
	                     pid);
}

static long pdf_now_ms(void)
{
	struct timespec t;

	clock_gettime(CLOCK_MONOTONIC, &t);
	return (long)t.tv_sec * 1000 + t.tv_nsec / 1000000;
}

/* Until it ends by itself, or is ended: 0, DT_E_TIMEOUT, DT_E_CLOSED, DT_E_SYSTEM. */
static int pdf_wait_for(pid_t pid, int (*stop)(void))
{
	struct pollfd end = {.fd = pidfd_open(pid, 0), .events = POLLIN};
	long until_ms = pdf_now_ms() + LIMIT_MS;
	int result = end.fd >= 0 ? 0 : DT_E_SYSTEM;

	while (!result && poll(&end, 1, ASK_MS) <= 0) {
		if (stop && stop())
			result = DT_E_CLOSED;
		else if (pdf_now_ms() >= until_ms)
			result = DT_E_TIMEOUT;
	}
	if (end.fd >= 0)
		close(end.fd);
	kill(-pid, SIGKILL); /* what it left behind, too */
	return process_wait(pid) != 0 && result == 0 ? DT_E_SYSTEM : result;
}

static int pdf_fail(int result, const char *why, char *message, size_t size)
{
	snprintf(message, size, "no PDF: %s", why);
	return result;
}

static int print_in(const char *folder, const char *program, int (*stop)(void), char **pdf,
                    size_t *pdf_length, char *message, size_t size)
{
	char file[FOLDER_MAX + 32];
	pid_t pid;
	int result = pdf_start(program, folder, &pid);

	if (result) {
		snprintf(message, size, "no PDF: %s: %s", program, strerror(result));
		return DT_E_SYSTEM;
	}
	result = pdf_wait_for(pid, stop);
	if (result == DT_E_TIMEOUT)
		return pdf_fail(result, "the browser did not end within a minute", message, size);
	if (result == DT_E_CLOSED)
		return pdf_fail(result, "interrupted", message, size);
	snprintf(file, sizeof(file), "%s/page.pdf", folder);
	*pdf = result ? NULL : durable_read(file, pdf_length);
	if (!*pdf || *pdf_length < 5 || memcmp(*pdf, "%PDF-", 5) != 0) {
		free(*pdf);
		return pdf_fail(DT_E_SYSTEM, "the browser failed", message, size);
	}
	return 0;
}

int pdf_print(const char *page, size_t length, int (*stop)(void), char **pdf, size_t *pdf_length,
              char *message, size_t size)
{
	struct temporary folder;
	char file[FOLDER_MAX + 32], program[PROGRAM_MAX], *made = NULL;
	size_t made_length = 0;
	int result;

	if (!find_browser(program))
		return pdf_fail(DT_E_UNKNOWN,
		                "neither chromium, chromium-browser nor google-chrome is on PATH", message,
		                size);
	if (temporary_make(&folder, "pdf") != 0)
		return pdf_fail(DT_E_SYSTEM, "no temporary folder", message, size);
	snprintf(file, sizeof(file), "%s/page.html", folder.path);
	result = atomic_file_write(file, page, length, message, size);
	if (!result)
		result = print_in(folder.path, program, stop, &made, &made_length, message, size);
	temporary_remove(&folder);
	if (result)
		return result;
	*pdf = made;
	*pdf_length = made_length;
	return 0;
}
