/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/archive/photo.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "host/archive/proof.h"
#include "host/base/image.h"

static const char *const moments[] = {"before", "after"};
static const char *const endings[] = {".jpg", ".png"};

bool photo_parse(const char *text, struct photo *photo)
{
	char moment[8];
	long long bytes;
	int end = 0;

	_Static_assert(ARCHIVE_PHOTO_FILE_MAX == 128, "the width below is one less");
	if (sscanf(text, "%7s %127s %lld %64s%n", moment, photo->file, &bytes, photo->hash, &end) != 4 ||
	    text[end] != '\0' || strlen(photo->hash) != DIGEST_CHARS - 1 || bytes < 1)
		return false;
	photo->bytes = bytes;
	photo->after = strcmp(moment, moments[true]) == 0;
	return (photo->after || strcmp(moment, moments[false]) == 0) &&
	       strncmp(photo->file, "raw/", 4) == 0 && strstr(photo->file, "..") == NULL;
}

/* ---- places ---- */

/* Which drop is meant, by its name or, of the series' next one, by the series' alone. */
struct photo_place {
	char name[ARCHIVE_NAME_MAX + 16], folder[ARCHIVE_NAME_MAX + 16];
	unsigned number;
	bool recorded, next; /* not there yet, or being recorded; neither: it was interrupted */
};

/* With the number of its next drop. */
static int find_series(struct archive *archive, const char *series, struct photo_place *place)
{
	sqlite3_stmt *s;
	int result = sql_query(
	        archive, &s,
	        "SELECT 'raw/' || substr(s.created, 1, 4) || '/' || s.name, d.number, d.state, d.raw"
	        " FROM series s LEFT JOIN drops d ON d.series_id = s.id"
	        " WHERE s.name = ? ORDER BY d.number DESC LIMIT 1",
	        "s", series);

	if (result != 0)
		return result;
	result = sql_step(archive, s);
	if (result > 0) {
		snprintf(place->folder, sizeof(place->folder), "%s", sql_text(s, 0));
		place->number = (unsigned)sqlite3_column_int(s, 1);
		if (strcmp(sql_text(s, 2), "recording") != 0 ||
		    !archive_is_recording(archive, sql_text(s, 3)))
			place->number++;
	}
	sqlite3_finalize(s);
	if (result == 0)
		return archive_refuse(archive, DT_E_UNKNOWN, "no series '%.80s' in %.300s", series,
		                      archive->folder);
	return result < 0 ? result : 0;
}

static int photo_find(struct archive *archive, const char *drop, struct photo_place *place)
{
	char series[ARCHIVE_NAME_MAX + 1];
	const char *slash = strchr(drop, '/');
	size_t length = slash != NULL ? (size_t)(slash - drop) : strlen(drop);
	struct archive_place known;
	int result;

	*place = (struct photo_place){.next = true};
	snprintf(series, sizeof(series), "%.*s", length <= ARCHIVE_NAME_MAX ? (int)length : 0, drop);
	result = archive_check_name(archive, "series", series);
	if (result == 0)
		result = find_series(archive, series, place);
	if (result != 0)
		return result;
	snprintf(place->name, sizeof(place->name), "%s/%u", series, place->number);
	if (slash == NULL || strcmp(drop, place->name) == 0)
		return 0;
	result = archive_locate(archive, drop, &known);
	if (result != 0)
		return result;
	place->number = known.number;
	place->recorded = known.recorded;
	place->next = false;
	snprintf(place->name, sizeof(place->name), "%s/%u", series, place->number);
	return 0;
}

static void photo_file(const struct photo_place *place, bool after, unsigned which, const char *ending,
                       char file[ARCHIVE_PHOTO_FILE_MAX])
{
	snprintf(file, ARCHIVE_PHOTO_FILE_MAX, "%s/%04u.%s-%u%s", place->folder, place->number,
	         moments[after], which, ending);
}

static void full_path(const struct archive *archive, const char *file, char path[ARCHIVE_PATH_MAX])
{
	snprintf(path, ARCHIVE_PATH_MAX, "%s/%.200s", archive->folder, file);
}

/* The file of that place and number, JPEG or PNG; false: there is none. */
static bool is_there(const struct archive *archive, const struct photo_place *place, bool after,
                     unsigned which, char file[ARCHIVE_PHOTO_FILE_MAX])
{
	char path[ARCHIVE_PATH_MAX];

	for (size_t i = 0; i < sizeof(endings) / sizeof(endings[0]); i++) {
		photo_file(place, after, which, endings[i], file);
		full_path(archive, file, path);
		if (access(path, F_OK) == 0)
			return true;
	}
	return false;
}

static int refuse_photo(struct archive *archive, const char *path)
{
	return archive_refuse(archive, DT_E_SYSTEM, "%.500s: %s", path, strerror(errno));
}

/* ---- kept ---- */

static int enter_photo(struct archive *archive, int64_t drop, const char *operator_name, bool after,
                       const char *file, int64_t bytes, const char *hash)
{
	char text[ARCHIVE_PHOTO_FILE_MAX + 128];

	snprintf(text, sizeof(text), "%s %s %lld %s", moments[after], file, (long long)bytes, hash);
	return event_insert(archive, drop, "photo", operator_name, text);
}

/* The drop is recorded; its event, in a transaction of its own. */
static int photo_enter(struct archive *archive, const struct photo_place *place, bool after,
                       const char *operator_name, const char *file, const void *bytes, size_t size)
{
	char fault[ARCHIVE_MESSAGE_MAX], hash[DIGEST_CHARS];
	struct archive_place drop;
	int result = change_look(archive, place->name, operator_name, "", fault);

	if (result == 0)
		result = change_start(archive, place->name, &drop);
	if (result != 0)
		return result;
	digest_of(bytes, size, hash);
	result = proof_log(archive, drop.drop, fault);
	if (result == 0)
		result = enter_photo(archive, drop.drop, operator_name, after, file, (int64_t)size, hash);
	return change_end(archive, &drop, result);
}

static int photo_put(struct archive *archive, const struct photo_place *place, bool after,
                     const char *operator_name, const char *ending, const void *bytes, size_t size)
{
	char file[ARCHIVE_PHOTO_FILE_MAX], path[ARCHIVE_PATH_MAX];
	unsigned which = 1;
	int result = 0;

	while (which <= ARCHIVE_PHOTOS_MAX && is_there(archive, place, after, which, file))
		which++;
	if (which > ARCHIVE_PHOTOS_MAX)
		return archive_refuse(archive, DT_E_FULL, "%s has %d photos %s it, which is all it may have",
		                      place->name, ARCHIVE_PHOTOS_MAX, moments[after]);
	photo_file(place, after, which, ending, file);
	full_path(archive, file, path);
	if (durable_folders(path) != 0 || durable_write(path, bytes, size) != 0)
		return refuse_photo(archive, path);
	if (place->recorded)
		result = photo_enter(archive, place, after, operator_name, file, bytes, size);
	if (result != 0)
		unlink(path);
	return result;
}

int archive_photo(struct archive *archive, const char *drop, bool after, const char *operator_name,
                  const void *bytes, size_t size)
{
	struct photo_place place;
	struct image image;
	const char *why;
	uint8_t *kept;
	int result = archive_check_operator(archive, operator_name);

	if (result == 0)
		result = photo_find(archive, drop, &place);
	if (result != 0)
		return result;
	if (!place.recorded && (after || !place.next))
		return archive_refuse(archive, DT_E_STATE,
		                      place.next ? "%s has not fallen yet: expected a photo before it"
		                                 : "%s was never completely recorded",
		                      place.name);
	if (size == 0 || size > ARCHIVE_PHOTO_BYTES)
		return archive_refuse(archive, DT_E_RANGE, "a photo of %zu bytes, expected 1 to %d", size,
		                      ARCHIVE_PHOTO_BYTES);
	kept = malloc(size);
	if (kept == NULL)
		return archive_refuse(archive, DT_E_MEMORY, "%s", error_text(DT_E_MEMORY));
	memcpy(kept, bytes, size);
	if (image_strip(kept, &size, &image, &why) != 0)
		result = archive_refuse(archive, DT_E_FORMAT, "the photo is %s, expected a whole JPEG or PNG",
		                        why);
	else
		result = photo_put(archive, &place, after, operator_name, image.ending, kept, size);
	free(kept);
	return result;
}

int photo_bind(struct archive *archive, const struct archive_recording *r)
{
	struct photo_place place = {0};
	int64_t bytes;
	sqlite3_stmt *s;
	char who[ARCHIVE_TEXT_MAX + 1], file[ARCHIVE_PHOTO_FILE_MAX], path[ARCHIVE_PATH_MAX],
	        hash[DIGEST_CHARS];
	int result = find_series(archive, r->series, &place);

	if (result == 0)
		result = sql_query(archive, &s, "SELECT operator FROM drops WHERE id = ?", "i", r->drop);
	if (result != 0)
		return result;
	place.number = r->number;
	result = sql_step(archive, s);
	snprintf(who, sizeof(who), "%s", sql_text(s, 0));
	sqlite3_finalize(s);
	for (unsigned which = 1; which <= ARCHIVE_PHOTOS_MAX && result >= 0; which++) {
		if (!is_there(archive, &place, false, which, file))
			continue;
		full_path(archive, file, path);
		if (digest_file(path, hash, &bytes, -1) == 0) /* else the drop is worth more than its photo */
			result = enter_photo(archive, r->drop, who, false, file, bytes, hash);
	}
	return result < 0 ? result : 0;
}

int archive_discard_photos(struct archive *archive, const char *series)
{
	char file[ARCHIVE_PHOTO_FILE_MAX], path[ARCHIVE_PATH_MAX];
	struct photo_place place;
	int result = photo_find(archive, series, &place);

	if (result == 0 && !place.next)
		result = archive_refuse(archive, DT_E_STATE, "the photos of %s stay", place.name);
	for (unsigned which = 1; result == 0 && which <= ARCHIVE_PHOTOS_MAX; which++) {
		if (!is_there(archive, &place, false, which, file))
			continue;
		full_path(archive, file, path);
		if (unlink(path) != 0)
			result = refuse_photo(archive, path);
	}
	return result;
}

/* ---- looked at ---- */

struct photo_look {
	int (*each)(void *context, const struct archive_photo *photo);
	void *context;
};

static const char *type_of(const char *file)
{
	const char *dot = strrchr(file, '.');

	return dot != NULL && strcmp(dot, endings[1]) == 0 ? "image/png" : "image/jpeg";
}

static int look_event(void *context, const struct archive_event *event)
{
	const struct photo_look *look = context;
	struct photo photo;

	if (strcmp(event->what, "photo") != 0 || !photo_parse(event->text, &photo))
		return 0;
	return look->each(look->context, &(struct archive_photo){.after = photo.after,
	                                                         .file = photo.file,
	                                                         .type = type_of(photo.file),
	                                                         .sha256 = photo.hash,
	                                                         .bytes = photo.bytes});
}

int archive_each_photo(struct archive *archive, const char *drop,
                       int (*each)(void *context, const struct archive_photo *photo), void *context)
{
	char file[ARCHIVE_PHOTO_FILE_MAX], path[ARCHIVE_PATH_MAX], hash[DIGEST_CHARS];
	struct photo_look look = {each, context};
	struct photo_place place;
	int result = photo_find(archive, drop, &place);

	if (result == 0 && place.recorded)
		return archive_each_event(archive, place.name, look_event, &look);
	for (unsigned which = 1; result == 0 && which <= ARCHIVE_PHOTOS_MAX; which++) {
		struct archive_photo photo = {.file = file, .waits = true, .sha256 = hash};

		if (!is_there(archive, &place, false, which, file))
			continue;
		full_path(archive, file, path);
		photo.type = type_of(file);
		if (digest_file(path, hash, &photo.bytes, -1) == 0)
			result = each(context, &photo);
	}
	return result;
}

int archive_photo_bytes(struct archive *archive, const struct archive_photo *photo, char **bytes,
                        size_t *size)
{
	char path[ARCHIVE_PATH_MAX], hash[DIGEST_CHARS];

	full_path(archive, photo->file, path);
	*bytes = durable_read(path, size);
	if (*bytes == NULL)
		return refuse_photo(archive, path);
	digest_of(*bytes, *size, hash);
	if (strcmp(hash, photo->sha256) == 0)
		return 0;
	free(*bytes);
	return archive_refuse(archive, DT_E_CORRUPT, "%.200s: not what was recorded", photo->file);
}
