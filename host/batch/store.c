/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/batch/store.h"

#include <errno.h>
#include <fcntl.h>
#include <nettle/sha2.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/base/process.h"
#include "common/base/text.h"
#include "host/base/atomic_file.h"
#include "host/base/durable.h"
#include "host/record/digest.h"

void store_path(const struct store *store, const char *name, char path[PATH_MAX])
{
	snprintf(path, PATH_MAX, "%.*s/%.200s", (int)sizeof(store->folder), store->folder, name);
}

static int line_chars(const char *text)
{
	size_t length = strcspn(text, "\n");

	return length < 100 ? (int)length : 100;
}

static int refuse_settings(const char *path, const char *there, const char *settings, char *message)
{
	size_t same = 0, line;

	while (there[same] != '\0' && there[same] == settings[same])
		same++;
	for (line = same; line > 0 && there[line - 1] != '\n';)
		line--;
	there += line;
	settings += line;
	snprintf(message, STORE_MESSAGE_MAX,
	         "%.200s: results by other settings are there: '%.*s', now '%.*s'; expected another --out",
	         path, line_chars(there), there, line_chars(settings), settings);
	return DT_E_ARGUMENT;
}

static int open_settings(const struct store *store, const char *settings, char *message)
{
	char path[PATH_MAX], *there;
	int result = 0;

	store_path(store, "settings", path);
	there = durable_read(path, NULL);
	if (there == NULL && errno == ENOENT)
		return atomic_file_write(path, settings, strlen(settings), message, STORE_MESSAGE_MAX);
	if (there == NULL) {
		snprintf(message, STORE_MESSAGE_MAX, "%.200s: %s", path, strerror(errno));
		return DT_E_SYSTEM;
	}
	if (strcmp(there, settings) != 0)
		result = refuse_settings(path, there, settings, message);
	free(there);
	return result;
}

int store_open(struct store *store, const char *folder, const char *settings, char message[STORE_MESSAGE_MAX])
{
	static const char *const folders[] = {"parts/", "known/"};
	char path[PATH_MAX];
	int result = 0;

	if (snprintf(store->folder, sizeof(store->folder), "%s", folder) >= (int)sizeof(store->folder)) {
		snprintf(message, STORE_MESSAGE_MAX, "--out is too long a name");
		return DT_E_ARGUMENT;
	}
	for (size_t i = 0; i < sizeof(folders) / sizeof(folders[0]) && result == 0; i++) {
		store_path(store, folders[i], path);
		result = durable_folders(path);
	}
	if (result != 0) {
		snprintf(message, STORE_MESSAGE_MAX, "%.200s: %s", folder, strerror(errno));
		return result;
	}
	return open_settings(store, settings, message);
}

static void part_path(const struct store *store, const char *key, char path[PATH_MAX])
{
	char name[160];

	snprintf(name, sizeof(name), "parts/%.2s/%.120s", key, key);
	store_path(store, name, path);
}

/* ---- reading ---- */

/* The line that a part ends with. */
static void put_end(char line[160], const char *bytes, size_t size, unsigned long results, int code)
{
	char digest[DIGEST_CHARS];

	digest_of(bytes, size, digest);
	snprintf(line, 160, "end %lu %d %s\n", results, code, digest);
}

static bool part_is_whole(struct part *part, size_t size)
{
	char wanted[160], *end = size > 0 ? memrchr(part->bytes, '\n', size - 1) : NULL;

	end = end != NULL ? end + 1 : part->bytes;
	if (sscanf(end, "end %lu %d ", &part->results, &part->code) != 2)
		return false;
	put_end(wanted, part->bytes, (size_t)(end - part->bytes), part->results, part->code);
	part->said_size = (size_t)(end - part->bytes);
	return strcmp(end, wanted) == 0;
}

/* Unlike durable_read, of any size. */
static char *part_read(const char *path, size_t *size)
{
	int fd = open(path, O_RDONLY | O_CLOEXEC);
	char *bytes = fd >= 0 ? process_read(fd, size) : NULL;

	if (fd >= 0)
		close(fd);
	return bytes;
}

bool store_get(const struct store *store, const char *key, struct part *part)
{
	char path[PATH_MAX];
	size_t size, at = 0;

	part_path(store, key, path);
	part->bytes = part_read(path, &size);
	if (part->bytes == NULL)
		return false;
	if (!part_is_whole(part, size)) {
		part_free(part);
		return false;
	}
	for (unsigned long i = 0; i < part->results && at < part->said_size; i++)
		at += strcspn(part->bytes + at, "\n") + 1;
	part->said = part->bytes + at;
	part->size = at;
	part->said_size -= at;
	return true;
}

void part_free(struct part *part)
{
	free(part->bytes);
	part->bytes = NULL;
}

/* ---- writing ---- */

static int write_beside(const char *path, const char *bytes, size_t size)
{
	int fd = open(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666), error;

	if (fd < 0)
		return errno;
	error = process_write(fd, bytes, size);
	return close(fd) != 0 && error == 0 ? errno : error;
}

/* No program on this machine or another has this name for the same part. */
static bool name_beside(const char *path, char beside[PATH_MAX])
{
	char host[64] = "";

	gethostname(host, sizeof(host) - 1);
	return snprintf(beside, PATH_MAX, "%s.%s.%ld.part", path, host, (long)getpid()) < PATH_MAX;
}

int store_put(const struct store *store, const char *key, const struct part *part)
{
	char path[PATH_MAX], beside[PATH_MAX], end[160], *bytes;
	size_t size = part->size + part->said_size, length;
	int error;

	part_path(store, key, path);
	if (!name_beside(path, beside)) {
		errno = ENAMETOOLONG;
		return DT_E_SYSTEM;
	}
	bytes = malloc(size + sizeof(end));
	if (bytes == NULL)
		return DT_E_SYSTEM;
	memcpy(bytes, part->bytes, part->size);
	memcpy(bytes + part->size, part->said, part->said_size);
	put_end(end, bytes, size, part->results, part->code);
	length = strlen(end);
	memcpy(bytes + size, end, length);
	error = write_beside(beside, bytes, size + length);
	if (error == ENOENT) { /* the first of its two letters */
		error = durable_folders(path) == 0 ? write_beside(beside, bytes, size + length) : errno;
	}
	free(bytes);
	if (error == 0 && rename(beside, path) != 0)
		error = errno;
	if (error != 0)
		unlink(beside);
	errno = error;
	return error == 0 ? 0 : DT_E_SYSTEM;
}
