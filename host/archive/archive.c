/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/archive/archive.h"

#include <ctype.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "common/plain.h"
#include "host/base/durable.h"
#include "host/archive/private.h"
#include "common/base/number.h"

enum { FOLDER_MAX = 4000, WAIT_MS = 10000 };

int archive_refuse(struct archive *archive, int code, const char *format, ...)
{
	va_list arguments;

	va_start(arguments, format);
	vsnprintf(archive->message, sizeof(archive->message), format, arguments);
	va_end(arguments);
	return code;
}

const char *archive_message(const struct archive *archive)
{
	return archive->message;
}

const char *archive_unread(const struct archive *archive)
{
	return archive->unread;
}

const char *archive_folder(const struct archive *archive)
{
	return archive->folder;
}

void archive_time(char text[ARCHIVE_TIME_CHARS], int64_t time_s)
{
	time_t seconds = (time_t)time_s;
	struct tm utc;

	if (gmtime_r(&seconds, &utc) == NULL ||
	    strftime(text, ARCHIVE_TIME_CHARS, "%Y-%m-%dT%H:%M:%SZ", &utc) == 0)
		strcpy(text, "1970-01-01T00:00:00Z");
}

int archive_check_name(struct archive *archive, const char *what, const char *name)
{
	size_t length = strlen(name), i = 0;

	while (i < length && (isalnum((unsigned char)name[i]) || (i > 0 && strchr("._-+", name[i]) != NULL)))
		i++;
	if (i == length && length >= 1 && length <= ARCHIVE_NAME_MAX)
		return 0;
	return archive_refuse(archive, DT_E_ARGUMENT,
	                      "%s '%.80s', expected 1 to %d letters and digits, and . _ + - within", what,
	                      name, ARCHIVE_NAME_MAX);
}

int archive_check_names(struct archive *archive, const char *series, const char *campaign)
{
	int result = archive_check_name(archive, "series", series);

	return result != 0 ? result : archive_check_name(archive, "campaign", campaign);
}

int archive_check_text(struct archive *archive, const char *what, const char *text)
{
	size_t length = strlen(text);

	if (!plain_is_line(text, length))
		return archive_refuse(
		        archive, DT_E_ARGUMENT,
		        "the %s has a control character or is no UTF-8, expected one line of text", what);
	if (length > ARCHIVE_TEXT_MAX)
		return archive_refuse(archive, DT_E_ARGUMENT, "the %s is longer than %d bytes", what,
		                      ARCHIVE_TEXT_MAX);
	return 0;
}

int archive_check_operator(struct archive *archive, const char *name)
{
	if (name[strspn(name, " ")] == '\0')
		return archive_refuse(
		        archive, DT_E_ARGUMENT,
		        "nobody is known to decide: expected the operator's name (--operator NAME)");
	return archive_check_text(archive, "operator's name", name);
}

/* ---- opening ---- */

int archive_lock(struct archive *archive, bool exclusive)
{
	char path[ARCHIVE_PATH_MAX];

	snprintf(path, sizeof(path), "%s/lock", archive->folder);
	archive->lock = open(path, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);
	if (archive->lock < 0)
		return archive_refuse(archive, DT_E_SYSTEM,
		                      "%.400s: %s, expected a folder that can be written", archive->folder,
		                      strerror(errno));
	if (flock(archive->lock, (exclusive ? LOCK_EX : LOCK_SH) | LOCK_NB) == 0)
		return 0;
	return archive_refuse(archive, DT_E_STATE, "%.400s: %s", archive->folder,
	                      exclusive ? "another program writes here, expected nobody else"
	                                : "its index is being rebuilt, expected nobody at it");
}

static bool archive_is_there(const struct archive *archive, const char *name)
{
	char path[ARCHIVE_PATH_MAX];

	snprintf(path, sizeof(path), "%s/%s", archive->folder, name);
	return access(path, F_OK) == 0;
}

static int connect_index(struct archive *archive, const char *name, int flags, const char *more)
{
	char *uri = sqlite3_mprintf("file:%w/%s?%s", archive->folder, name, more);
	char *plain = sqlite3_mprintf("%s/%s", archive->folder, name);
	int result = DT_E_MEMORY;

	if (uri == NULL || plain == NULL) {
		archive_refuse(archive, result, "%s", error_text(result));
	} else {
		/* a folder's name may hold what a URI gives a meaning: only the read-only copy needs one */
		result = sqlite3_open_v2(
		        more[0] != '\0' ? uri : plain, &archive->index,
		        flags | SQLITE_OPEN_NOMUTEX | (more[0] != '\0' ? SQLITE_OPEN_URI : 0), NULL);
		result = result == SQLITE_OK ? 0 : sql_refuse(archive);
	}
	sqlite3_free(uri);
	sqlite3_free(plain);
	if (archive->index != NULL)
		sqlite3_busy_timeout(archive->index, WAIT_MS);
	return result;
}

/* A folder that cannot be written, or a full disk, has no place for what the readers of a log of SQLite
 * share. Without a log left behind the file is all there is; with one, who reads alone needs nothing shared.
 */
static int open_for_reading(struct archive *archive, const char *name)
{
	int64_t version;
	char log[64];
	int result = connect_index(archive, name, SQLITE_OPEN_READWRITE, "");

	if (result == 0)
		result = sql_number(archive, &version, "PRAGMA user_version", "");
	if (result == 0 || result == DT_E_CORRUPT)
		return result;
	snprintf(log, sizeof(log), "%.40s-wal", name);
	sqlite3_close(archive->index);
	archive->index = NULL;
	if (!archive_is_there(archive, log))
		return connect_index(archive, name, SQLITE_OPEN_READONLY, "immutable=1");
	result = connect_index(archive, name, SQLITE_OPEN_READWRITE, "");
	return result != 0 ? result : sql_script(archive, "PRAGMA locking_mode = EXCLUSIVE");
}

static int64_t archive_now_ms(void)
{
	struct timespec now;

	clock_gettime(CLOCK_MONOTONIC, &now);
	return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

/* SQLite does not always wait by itself for who changes the mode at the same time. */
static int write_ahead(struct archive *archive)
{
	const struct timespec step = {.tv_nsec = 10000000};
	int64_t start_ms = archive_now_ms();
	int result;

	for (;;) {
		result = sql_script(archive, "PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL");
		if (result != DT_E_TIMEOUT || archive_now_ms() - start_ms > WAIT_MS)
			return result;
		nanosleep(&step, NULL);
	}
}

int index_open(struct archive *archive, const char *name, enum archive_mode mode)
{
	int result;

	if (mode == ARCHIVE_READ)
		result = open_for_reading(archive, name);
	else
		result = connect_index(archive, name, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE, "");
	if (result == 0 && mode != ARCHIVE_READ)
		result = write_ahead(archive);
	if (result == 0)
		result = sql_script(archive, "PRAGMA foreign_keys = ON");
	return result != 0 ? result : schema_upgrade(archive);
}

/* Bytes of FOLDER/NAME, 0 when it is not there, -1 when it is no file. */
static int64_t bytes_of(const struct archive *archive, const char *name)
{
	char path[ARCHIVE_PATH_MAX];
	struct stat status;

	snprintf(path, sizeof(path), "%s/%s", archive->folder, name);
	if (stat(path, &status) != 0)
		return 0;
	return S_ISREG(status.st_mode) ? status.st_size : -1;
}

int index_look(struct archive *archive)
{
	int64_t bytes = bytes_of(archive, "index.sqlite");

	if (bytes < 0)
		return archive_refuse(archive, DT_E_FORMAT, "%.400s/index.sqlite: expected a regular file",
		                      archive->folder);
	/* who makes an archive has no raw files yet */
	if (bytes == 0 && archive_is_there(archive, "raw") && bytes_of(archive, "index.sqlite-wal") <= 0)
		return archive_refuse(archive, DT_E_CORRUPT,
		                      "%.250s/index.sqlite: emptied; 'droptower series --archive %.250s "
		                      "--rebuild' makes it again",
		                      archive->folder, archive->folder);
	return 0;
}

static int open_in(struct archive *archive, enum archive_mode mode)
{
	char inside[ARCHIVE_PATH_MAX];
	bool made = false, raw;
	int result;

	snprintf(inside, sizeof(inside), "%s/", archive->folder);
	if (mode == ARCHIVE_CREATE && durable_folders(inside) != 0)
		return archive_refuse(archive, DT_E_SYSTEM, "%.400s: %s", archive->folder, strerror(errno));
	raw = archive_is_there(archive, "raw"); /* asked first: who makes an archive makes its index first */
	if (!archive_is_there(archive, "index.sqlite")) {
		if (raw)
			return archive_refuse(archive, DT_E_CORRUPT,
			                      "%.250s: raw files, but no index; 'droptower series --archive "
			                      "%.250s --rebuild' makes it again",
			                      archive->folder, archive->folder);
		if (errno != ENOENT && errno != ENOTDIR)
			return archive_refuse(archive, DT_E_SYSTEM, "%.400s: %s", archive->folder,
			                      strerror(errno));
		if (mode != ARCHIVE_CREATE)
			return archive_refuse(archive, DT_E_EMPTY,
			                      "%.400s: no archive there; 'droptower series new' makes one",
			                      archive->folder);
		made = true;
	}
	result = made ? 0 : index_look(archive);
	if (result == 0 && mode != ARCHIVE_READ)
		result = archive_lock(archive, false);
	if (result == 0)
		result = index_open(archive, "index.sqlite", mode);
	snprintf(inside, sizeof(inside), "%s/index.sqlite", archive->folder);
	if (result == 0 && made && durable_sync_folder(inside) != 0)
		result = archive_refuse(archive, DT_E_SYSTEM, "%.400s: %s", archive->folder, strerror(errno));
	return result;
}

struct archive *archive_open(const char *folder, enum archive_mode mode, char message[ARCHIVE_MESSAGE_MAX])
{
	struct archive *archive = calloc(1, sizeof(*archive));
	size_t length = strlen(folder);

	while (length > 1 && folder[length - 1] == '/')
		length--;
	if (archive != NULL)
		archive->folder = strndup(folder, length);
	if (archive == NULL || archive->folder == NULL) {
		snprintf(message, ARCHIVE_MESSAGE_MAX, "%s", error_text(DT_E_MEMORY));
		free(archive);
		return NULL;
	}
	archive->lock = -1;
	if (length >= 1 && length <= FOLDER_MAX && open_in(archive, mode) == 0)
		return archive;
	if (length < 1 || length > FOLDER_MAX)
		archive_refuse(archive, DT_E_ARGUMENT, "the archive's name is empty or too long");
	memcpy(message, archive->message, ARCHIVE_MESSAGE_MAX);
	archive_close(archive);
	return NULL;
}

void archive_close(struct archive *archive)
{
	if (archive == NULL)
		return;
	sqlite3_close(archive->index);
	if (archive->lock >= 0)
		close(archive->lock);
	free(archive->mark);
	free(archive->folder);
	free(archive);
}

/* ---- scenes and places ---- */

int scene_of_text(struct archive *archive, const char *name, const char *text, double angle_deg,
                  struct scene *scene)
{
	char path[48], message[SCENE_MESSAGE_MAX] = "";
	size_t length = strlen(text);
	int fd = memfd_create("scene", MFD_CLOEXEC), result = DT_E_SYSTEM;

	if (fd >= 0 && write(fd, text, length) == (ssize_t)length) {
		snprintf(path, sizeof(path), "/proc/self/fd/%d", fd);
		result = scene_read(scene, path, message);
	}
	if (fd >= 0)
		close(fd);
	if (result == 0) {
		scene->drop_angle_deg = angle_deg;
		result = scene_check(scene, name, message);
	}
	if (result != 0)
		archive_refuse(archive, result, "the scene of %.80s: %.400s", name,
		               message[0] != '\0' ? message : strerror(errno));
	return result;
}

int archive_scene(struct archive *archive, const char *series, struct scene *scene)
{
	sqlite3_stmt *s;
	int result =
	        sql_query(archive, &s, "SELECT scene, angle_deg FROM series WHERE name = ?", "s", series);

	if (result != 0)
		return result;
	result = sql_step(archive, s);
	if (result > 0)
		result = scene_of_text(archive, series, sql_text(s, 0), sqlite3_column_double(s, 1), scene);
	else if (result == 0)
		result = archive_refuse(archive, DT_E_UNKNOWN, "no series '%.80s' in %.400s", series,
		                        archive->folder);
	sqlite3_finalize(s);
	return result;
}

static int parse_drop(struct archive *archive, const char *drop, struct archive_place *place)
{
	const char *slash = strrchr(drop, '/');
	uint64_t number;

	if (slash == NULL || (size_t)(slash - drop) >= sizeof(place->name) ||
	    !number_whole(slash + 1, 1, 1000000, &number))
		return archive_refuse(archive, DT_E_ARGUMENT, "'%.100s' is no drop, expected SERIES/NUMBER",
		                      drop);
	memcpy(place->name, drop, (size_t)(slash - drop));
	place->name[slash - drop] = '\0';
	place->number = (unsigned)number;
	return 0;
}

int archive_locate(struct archive *archive, const char *drop, struct archive_place *place)
{
	sqlite3_stmt *s;
	int result = parse_drop(archive, drop, place);

	if (result == 0)
		result = sql_query(archive, &s,
		                   "SELECT d.id, d.series_id, d.raw, d.state = 'recorded' FROM drops d"
		                   " JOIN series s ON s.id = d.series_id WHERE s.name = ? AND d.number = ?",
		                   "si", place->name, (int64_t)place->number);
	if (result != 0)
		return result;
	result = sql_step(archive, s);
	if (result > 0) {
		place->drop = sqlite3_column_int64(s, 0);
		place->series = sqlite3_column_int64(s, 1);
		snprintf(place->raw, sizeof(place->raw), "%s", sql_text(s, 2));
		place->recorded = sqlite3_column_int(s, 3) != 0;
	}
	sqlite3_finalize(s);
	if (result == 0)
		return archive_refuse(archive, DT_E_UNKNOWN, "no drop '%.100s' in %.400s", drop,
		                      archive->folder);
	return result < 0 ? result : 0;
}
