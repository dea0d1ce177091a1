/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * An archive with one drop: the first byte says whether the rest is its result, its sidecar or the series'.
 * An index takes it in; every 200th time the whole is made again from what is there, opened and verified.
 * What was not used is told in one line.
 */
#include <fcntl.h>
#include <ftw.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "host/archive/private.h"
#include "host/archive/proof.h"
#include "tests/fuzz/fuzz.h"

enum { MAKE_EVERY = 200 };

static struct archive trial = {.lock = -1}; /* its index is in the folder, too */
static char folder[64], series_file[200], drop_file[200], result_file[220], *series_text, *drop_text,
        *with_result;

static int remove_one(const char *path, const struct stat *status, int type, struct FTW *walk)
{
	(void)status;
	(void)type;
	(void)walk;
	return remove(path);
}

static void clean(void)
{
	nftw(folder, remove_one, 8, FTW_DEPTH | FTW_PHYS);
}

static char *load(const char *file)
{
	char *text = calloc(1, 65536);
	int fd = open(file, O_RDONLY);

	if (text == NULL || fd < 0 || read(fd, text, 65535) <= 0)
		fuzz_fail("%s", file);
	close(fd);
	return text;
}

static void store(const char *file, const void *bytes, size_t size)
{
	int fd = open(file, O_WRONLY | O_CREAT | O_TRUNC, 0600);

	if (fd < 0 || write(fd, bytes, size) != (ssize_t)size)
		fuzz_fail("%s", file);
	close(fd);
}

static struct archive *open_archive(void)
{
	char message[ARCHIVE_MESSAGE_MAX];
	struct archive *archive = archive_open(folder, ARCHIVE_CREATE, message);

	if (archive == NULL)
		fuzz_fail("%s", message);
	return archive;
}

static void begin(void)
{
	static const char log[] = "(1.000000) can0 701#05\n";
	struct archive *archive;
	struct archive_recording r;

	snprintf(folder, sizeof(folder), "/dev/shm/droptower-fuzz-XXXXXX");
	if (mkdtemp(folder) == NULL)
		fuzz_fail("no folder");
	atexit(clean);
	archive = open_archive();
	if (archive_new_series(archive, "one", "default", "common/scenes/geometry-2A.ini", 25, 0.894, NULL,
	                       5) != 0 ||
	    archive_begin(archive, "one", "Ann", ".log", false, &r) != 0)
		fuzz_fail("%s", archive_message(archive));
	store(r.log, log, sizeof(log) - 1);
	snprintf(drop_file, sizeof(drop_file), "%.190s", r.log);
	strcpy(strrchr(drop_file, '.'), ".ini");
	snprintf(series_file, sizeof(series_file), "%.*s/series.ini",
	         (int)(strrchr(drop_file, '/') - drop_file), drop_file);
	if (archive_finish(archive, &r, 1, "") != 0)
		fuzz_fail("%s", archive_message(archive));
	archive_close(archive);
	series_text = load(series_file);
	drop_text = load(drop_file);
	snprintf(result_file, sizeof(result_file), "%.*s.fuzz.json", (int)(strlen(drop_file) - 4), drop_file);
	with_result = load(drop_file); /* as before there were hashes: whatever the file holds is taken */
	strcat(with_result, "result = 2026-11-02T08:00:00Z\tfuzz\n");
}

static void told(void *context, const char *text)
{
	(void)context;
	if (text[0] == '\0' || strchr(text, '\n') != NULL)
		fuzz_fail("no line: \"%s\"", text);
}

/* The index made again, and verified, as a user does. */
static void make_again(void)
{
	char message[ARCHIVE_MESSAGE_MAX];
	struct archive *archive;

	if (archive_rebuild(folder, true, told, NULL, message) != 0)
		return;
	archive = open_archive();
	(void)!archive_verify(archive, NULL, 0, told, NULL);
	archive_close(archive);
}

/* The heart of it: an index without drops takes in what one file says, which is then proven. Nothing stays.
 */
static void take_in(const char *file)
{
	struct proof proof;
	int64_t drop;
	int taken;

	trial.folder = folder;
	if (trial.index == NULL && (index_open(&trial, "trial.sqlite", ARCHIVE_CREATE) != 0 ||
	                            sql_script(&trial, "PRAGMA synchronous = OFF") != 0))
		fuzz_fail("%s", trial.message);
	if (sql_script(&trial, "BEGIN") != 0)
		fuzz_fail("%s", trial.message);
	trial.message[0] = '\0';
	taken = sidecar_read(&trial, file + strlen(folder) + 1, &drop);
	if (taken != 0)
		told(NULL, trial.message);
	if (taken >= 0 && proof_open(&trial, &proof) == 0) {
		proof.wrong = told;
		(void)!proof_of_all(&proof, NULL, 0);
		proof_close(&proof);
	}
	if (sql_script(&trial, "ROLLBACK") != 0)
		fuzz_fail("%s", trial.message);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
	static unsigned times;
	const char *file = drop_file;

	if (folder[0] == '\0')
		begin();
	if (size < 1 || size > 4096)
		return 0;
	if (bytes[0] % 3 == 0) {
		store(result_file, bytes + 1, size - 1);
		store(drop_file, with_result, strlen(with_result));
	} else {
		file = bytes[0] % 3 == 1 ? drop_file : series_file;
		store(file, bytes + 1, size - 1);
	}
	take_in(file);
	if (++times % MAKE_EVERY == 0)
		make_again();
	store(drop_file, drop_text, strlen(drop_text));
	store(series_file, series_text, strlen(series_text));
	if (times % (50 * MAKE_EVERY) == 0) { /* rebuilding keeps what it replaces */
		sqlite3_close(trial.index);
		trial.index = NULL;
		clean();
		free(series_text);
		free(drop_text);
		free(with_result);
		begin();
	}
	return 0;
}
