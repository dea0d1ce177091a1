/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/session/journal.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <pwd.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

enum { LINE_MAX_BYTES = 512, WORD_MAX_BYTES = 64 };

static bool journal_find(char path[PATH_MAX])
{
	const char *named = getenv("DROPTOWER_JOURNAL"), *state = getenv("XDG_STATE_HOME"),
	           *home = getenv("HOME");
	int length = -1;

	if (named != NULL && named[0] != '\0')
		length = snprintf(path, PATH_MAX, "%s", named);
	else if (state != NULL && state[0] == '/')
		length = snprintf(path, PATH_MAX, "%s/droptower/journal.log", state);
	else if (home != NULL && home[0] == '/')
		length = snprintf(path, PATH_MAX, "%s/.local/state/droptower/journal.log", home);
	return length > 0 && length < PATH_MAX;
}

static void make_folders(const char *path)
{
	char folder[PATH_MAX];

	snprintf(folder, sizeof(folder), "%s", path);
	for (char *slash = strchr(folder + 1, '/'); slash != NULL; slash = strchr(slash + 1, '/')) {
		*slash = '\0';
		(void)mkdir(folder, 0700); /* what fails is told by the open that follows */
		*slash = '/';
	}
}

static int open_journal(const char *path)
{
	const int flags = O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC | O_NOCTTY | O_NONBLOCK;
	int fd = open(path, flags, 0600);

	if (fd >= 0 || errno != ENOENT)
		return fd;
	make_folders(path);
	return open(path, flags, 0600);
}

static void user_name(char *text, size_t size)
{
	const struct passwd *user = getpwuid(geteuid());

	if (user != NULL && user->pw_name[0] != '\0')
		snprintf(text, size, "%s", user->pw_name);
	else
		snprintf(text, size, "uid%u", (unsigned)geteuid());
}

void journal_sender(const char *program, char *text, size_t size)
{
	char user[64];

	user_name(user, sizeof(user));
	snprintf(text, size, "%.12s/%s[%d]", user, program, (int)getpid());
}

/* A name or a text of others must not make a line of its own, nor a column where it is to be one. */
static void journal_put(char *line, size_t size, const char *text, bool word)
{
	size_t at = strlen(line);

	if (word && size > at + 2 + WORD_MAX_BYTES)
		size = at + 2 + WORD_MAX_BYTES;
	for (; *text != '\0' && at + 2 < size; text++) {
		unsigned char c = (unsigned char)*text;

		line[at++] = (char)(c < ' ' || c == 0x7F ? '?' : word && c == ' ' ? '_' : c);
	}
	line[at] = '\0';
}

static void journal_compose(const struct journal_line *entry, char *line, size_t size)
{
	char user[64];
	struct timespec now;
	struct tm utc;

	clock_gettime(CLOCK_REALTIME, &now);
	gmtime_r(&now.tv_sec, &utc);
	user_name(user, sizeof(user));
	snprintf(line, size, "%04d-%02d-%02dT%02d:%02d:%02d.%03ldZ %s[%d] ", utc.tm_year + 1900,
	         utc.tm_mon + 1, utc.tm_mday, utc.tm_hour, utc.tm_min, utc.tm_sec, now.tv_nsec / 1000000,
	         entry->program, (int)getpid());
	journal_put(line, size, entry->who != NULL && entry->who[0] != '\0' ? entry->who : user, true);
	snprintf(line + strlen(line), size - strlen(line), " session %08x ", entry->session);
	journal_put(line, size, entry->verb, true);
	journal_put(line, size, entry->refusal != NULL ? " refused: " : " taken", false);
	if (entry->refusal != NULL)
		journal_put(line, size, entry->refusal, false);
}

void journal_write(const struct journal_line *entry)
{
	static bool told;
	char path[PATH_MAX] = "$DROPTOWER_JOURNAL, $XDG_STATE_HOME, $HOME", line[LINE_MAX_BYTES];
	int fd = -1;
	ssize_t written = -1;
	size_t length;

	journal_compose(entry, line, sizeof(line) - 1);
	length = strlen(line);
	line[length++] = '\n';
	errno = ENOENT;
	if (journal_find(path))
		fd = open_journal(path);
	if (fd >= 0)
		written = write(fd, line, length);
	if (written != (ssize_t)length && !told) {
		told = true;
		fprintf(stderr, "droptower: %s: cannot write the journal: %s\n", path,
		        written >= 0 ? "no room" : strerror(errno));
	}
	if (fd >= 0)
		close(fd);
}
