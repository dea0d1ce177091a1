/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * `droptower series add`: the drops of logs and the recordings of others into a series, each once, and none
 * that fell another way.
 */
#include <cjson/cJSON.h>
#include <errno.h>
#include <fcntl.h>
#include <ini.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/base/number.h"
#include "common/wire_table.h"
#include "host/command/archived.h"
#include "host/command/command.h"
#include "host/command/series_private.h"
#include "host/session/tower_setup.h"
#include "host/record/log_capture.h"
#include "host/record/drop.h"
#include "host/record/read.h"

_Static_assert((int)ARCHIVE_KEY_MAX >= (int)LOG_CAPTURE_KEY_CHARS, "a key fits");

struct adding {
	struct archive *archive;
	const struct series_arguments *a;
	struct scene scene; /* of the series */
	const char *file;
	struct stat status;         /* of the file */
	double angle_deg, height_m; /* as a file beside the log tells them; NAN: none does */
	const char *beside;         /* which */
	int code;
};

/* ---- what disagrees ---- */

/* How exactly an angle is set, and how far friction and the gates leave a frame from free fall. */
static const double ANGLE_DEG = 0.01, HEIGHT_M = 0.0005, SPEED_SHARE = 0.1;

static bool series_add_refuse(struct adding *adding)
{
	adding->code = COMMAND_INPUT;
	return false;
}

/* "LOG" or "LOG, drop 3". */
static void name_drop(const struct adding *adding, const struct log_capture *capture, char *name, size_t size)
{
	if (capture == NULL || capture->alone)
		snprintf(name, size, "%.400s", adding->file);
	else
		snprintf(name, size, "%.400s, drop %u", adding->file, capture->number);
}

static char *name_beside(const char *file, const char *ending)
{
	const char *dot = strrchr(file, '.'), *slash = strrchr(file, '/');
	int stem = (int)(dot != NULL && (slash == NULL || dot > slash) ? (size_t)(dot - file) : strlen(file));
	char *name;

	return asprintf(&name, "%.*s%s", stem, file, ending) < 0 ? NULL : name;
}

static double series_add_number_of(const cJSON *object, const char *key)
{
	const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, key);

	return cJSON_IsNumber(item) ? item->valuedouble : (double)NAN;
}

/* `run --out` leaves the scene of a drop in the JSON beside its log. */
static void read_json_beside(struct adding *adding)
{
	enum { JSON_MAX_BYTES = 1 << 20 };
	char *name = name_beside(adding->file, ".json"), *text = calloc(1, JSON_MAX_BYTES + 1);
	FILE *file = name != NULL && text != NULL ? fopen(name, "re") : NULL;
	const cJSON *scene;
	cJSON *json = NULL;

	if (file != NULL) {
		if (fread(text, 1, JSON_MAX_BYTES, file) < JSON_MAX_BYTES)
			json = cJSON_Parse(text);
		fclose(file);
	}
	scene = cJSON_GetObjectItemCaseSensitive(json, "scene");
	if (scene != NULL) {
		adding->angle_deg = series_add_number_of(scene, "angle_deg");
		adding->height_m = series_add_number_of(scene, "height_m");
		adding->beside = "in the JSON beside it";
	}
	cJSON_Delete(json);
	free(text);
	free(name);
}

static int take_key(void *context, const char *section, const char *key, const char *value)
{
	struct adding *adding = context;

	if (strcmp(section, "archive") == 0 && strcmp(key, "angle_deg") == 0)
		number_read(value, -1e6, 1e6, &adding->angle_deg);
	if (strcmp(section, "archive") == 0 && strcmp(key, "height_m") == 0)
		number_read(value, -1e6, 1e6, &adding->height_m);
	return 1;
}

/* The log of another archive has its sidecar beside it. */
static void read_sidecar_beside(struct adding *adding)
{
	char *name = name_beside(adding->file, ".ini");

	adding->beside = "in the sidecar beside it";
	if (name != NULL)
		(void)ini_parse(name, take_key, adding); /* what it does not tell is not known */
	free(name);
}

static bool one_agrees(struct adding *adding, const char *name, const char *what, double found, double wanted,
                       double tolerance, const char *unit, const char *source)
{
	if (isnan(found) || fabs(found - wanted) <= tolerance)
		return true;
	command_error("%s: %s %g %s %s, expected %g %s of series %s", name, what, found, unit, source, wanted,
	              unit, adding->a->word[0]);
	return series_add_refuse(adding);
}

/* Mean speed of a frame in free fall between the gates. */
static double gate_speed(const struct scene *scene)
{
	double upper_m = scene->tower_gate_upper_m, lower_m = scene->tower_gate_lower_m;
	double g_m_s2 = scene->drop_gravity_m_s2;

	return (lower_m - upper_m) / (sqrt(2 * lower_m / g_m_s2) - sqrt(2 * upper_m / g_m_s2));
}

static bool speed_agrees(struct adding *adding, const char *name, const struct record *record)
{
	const struct scene *scene = &adding->scene;
	double wanted = gate_speed(scene);

	if (!(record->frame_speed_m_s > 0))
		return true;
	if (!(wanted > 0)) /* no gates: no faster than it can be */
		wanted = fmin(record->frame_speed_m_s,
		              sqrt(2 * scene->drop_gravity_m_s2 * scene->drop_height_m));
	return one_agrees(adding, name, "frame at", record->frame_speed_m_s, wanted, SPEED_SHARE * wanted,
	                  "m/s", "between the gates");
}

/* Those that the drop itself tells, else what its log knows of the tower. */
static bool parameters_agree(struct adding *adding, const char *name, const struct log_capture *capture,
                             const struct record *record)
{
	struct tower_setting settings[TOWER_SETTINGS];

	tower_setup_settings(&adding->scene, settings);
	for (unsigned i = 0; i < TOWER_SETTINGS; i++) {
		unsigned number = settings[i].number;
		const struct wire_parameter_info *parameter = &wire_parameters[number];
		double found = NAN;

		if (record->parameters_known)
			found = record->parameters[number];
		else if (capture != NULL && capture->parameters.known[number])
			found = capture->parameters.value[number];
		if (!one_agrees(adding, name, parameter->name, found, round(settings[i].value), 0,
		                parameter->unit, "in the tower"))
			return false;
	}
	return true;
}

static bool series_add_agrees(struct adding *adding, const char *name, const struct log_capture *capture,
                              const struct record *record)
{
	const struct scene *scene = &adding->scene;

	return one_agrees(adding, name, "angle", adding->a->filter.angle_deg, scene->drop_angle_deg,
	                  ANGLE_DEG, "deg", "by --angle") &&
	       one_agrees(adding, name, "angle", adding->angle_deg, scene->drop_angle_deg, ANGLE_DEG, "deg",
	                  adding->beside) &&
	       one_agrees(adding, name, "height", adding->height_m, scene->drop_height_m, HEIGHT_M, "m",
	                  adding->beside) &&
	       parameters_agree(adding, name, capture, record) && speed_agrees(adding, name, record);
}

/* ---- what is there already ---- */

static int series_add_key_of(const char *log, char key[ARCHIVE_KEY_MAX])
{
	char message[READ_MESSAGE_MAX];
	struct record record;
	int error = read_record(&record, log, NULL, message);

	if (error)
		return error;
	key[0] = '\0';
	if (record.is_drop)
		log_capture_key(&record, key);
	record_free(&record);
	return 0;
}

/* 1: it was said where. */
static int series_add_is_there(struct adding *adding, const char *name, const char *key)
{
	char drop[ARCHIVE_NAME_MAX + 16];
	int found = key != NULL ? archive_find_capture(adding->archive, key, drop)
	                        : archive_find(adding->archive, adding->file, drop);

	if (found < 0)
		adding->code = archived_failed(adding->archive);
	if (found > 0)
		command_error("%s: is there already as %s, left out", name, drop);
	return found;
}

/* ---- taken in ---- */

static int copy_bytes(int from, int to, uint64_t at, uint64_t end)
{
	char block[65536];

	while (at < end) {
		size_t want = end - at < sizeof(block) ? (size_t)(end - at) : sizeof(block);
		ssize_t n = pread(from, block, want, (off_t)at), done;

		if (n <= 0) {
			errno = n == 0 ? ENODATA : errno;
			return -1;
		}
		at += (uint64_t)n;
		for (ssize_t k = 0; k < n; k += done) {
			done = write(to, block + k, (size_t)(n - k));
			if (done < 0)
				return -1;
		}
	}
	return 0;
}

/* Of a log of one drop all of it, else the part that holds the drop. */
static int copy_log(const struct adding *adding, const struct log_capture *capture,
                    const struct archive_recording *r)
{
	bool all = capture == NULL || capture->alone;
	int from = open(adding->file, O_RDONLY | O_CLOEXEC), to = open(r->log, O_WRONLY | O_CLOEXEC);
	int result = -1;

	if (from >= 0 && to >= 0)
		result = copy_bytes(from, to, all ? 0 : capture->from,
		                    all ? (uint64_t)adding->status.st_size : capture->to);
	if (result != 0)
		command_error("%s to %s: %s", adding->file, r->log, strerror(errno));
	if (from >= 0)
		close(from);
	if (to >= 0 && close(to) != 0 && result == 0) {
		command_error("%s: %s", r->log, strerror(errno));
		result = -1;
	}
	return result;
}

static bool same_samples(const struct record *a, const struct record *b)
{
	bool same = a->channel_count == b->channel_count;

	for (size_t i = 0; i < a->channel_count && same; i++) {
		const struct channel *x = &a->channels[i], *y = &b->channels[i];

		same = strcmp(x->name, y->name) == 0 && x->count == y->count && x->flags == y->flags &&
		       !(fabs(x->rate_hz - y->rate_hz) > 0) && !(fabs(x->start_s - y->start_s) > 0) &&
		       memcmp(x->value_g, y->value_g, x->count * sizeof(*x->value_g)) == 0;
	}
	return same;
}

/* A recording of others may be read by what stands beside it: a profile, the channels of a test. */
static int check_foreign_copy(const char *name, const struct record *record,
                              const struct archive_recording *r)
{
	char message[READ_MESSAGE_MAX];
	struct record copied;
	bool same;

	if (read_record(&copied, r->log, NULL, message) == 0) {
		same = same_samples(record, &copied);
		record_free(&copied);
		if (same)
			return 0;
	}
	command_error(
	        "%s: is not read by itself alone, and an archive keeps no more of it: 'droptower convert' "
	        "it to .csv, and add that",
	        name);
	return -1;
}

/* What was copied reads as what was to be. */
static int check_copy(const char *name, const struct log_capture *capture, const struct record *original,
                      const struct archive_recording *r)
{
	char message[READ_MESSAGE_MAX];
	struct log_capture copied = {0};
	struct record record;

	if (!original->is_drop)
		return check_foreign_copy(name, original, r);
	if (capture == NULL || capture->alone)
		return 0;
	if (read_record(&record, r->log, NULL, message) != 0) {
		command_error("%s: cannot be taken out of its log: %s", name, message);
		return -1;
	}
	log_capture_of_record(&record, &copied);
	record_free(&record);
	if (log_capture_equal(&copied, capture))
		return 0;
	command_error(
	        "%s: cannot be taken out of its log, whose drops overlap; 'droptower convert --drop' can",
	        name);
	return -1;
}

/* When the capture ended, where the log has the time of day and several drops; else when it was written. */
static int64_t time_of(const struct adding *adding, const struct log_capture *capture)
{
	int64_t time_s = capture != NULL && !capture->alone ? log_capture_time_s(capture) : 0;

	return time_s > 0 ? time_s : adding->status.st_mtime;
}

static void take_in(struct adding *adding, const char *name, const struct log_capture *capture,
                    const struct record *record, const char *key)
{
	const struct series_arguments *a = adding->a;
	bool told = !isnan(a->filter.angle_deg) || !isnan(adding->angle_deg);
	const char *note = a->note != NULL ? a->note
	                   : told          ? ""
	                                   : "angle as the series: the log does not tell it";
	struct archive_recording r;
	int code;

	if (archive_begin(adding->archive, a->word[0], a->operator_name, archive_ending(record->format),
	                  a->simulated, &r) != 0) {
		adding->code = archived_failed(adding->archive);
		return;
	}
	if (copy_log(adding, capture, &r) != 0 || check_copy(name, capture, record, &r) != 0) {
		archive_discard(adding->archive, &r);
		adding->code = COMMAND_INPUT;
		return;
	}
	if (archive_finish(adding->archive, &r, time_of(adding, capture), note) != 0 ||
	    (key[0] != '\0' && archive_know_capture(adding->archive, r.drop, key) != 0)) {
		adding->code = archived_failed(adding->archive);
		return;
	}
	printf("%s/%u  %s\n", r.series, r.number, name);
	fflush(stdout);
	code = archived_analyse(adding->archive, r.series, r.number, a->chain);
	if (code != COMMAND_DONE)
		adding->code = code;
}

static void add_record(struct adding *adding, const struct log_capture *capture, const struct record *record)
{
	char name[512], key[LOG_CAPTURE_KEY_CHARS] = "";

	name_drop(adding, capture, name, sizeof(name));
	if (record->is_drop)
		log_capture_key(record, key);
	if (key[0] != '\0' && series_add_is_there(adding, name, key) != 0)
		return;
	if (series_add_agrees(adding, name, capture, record))
		take_in(adding, name, capture, record, key);
}

static int series_add_drop(void *context, const struct log_capture *capture, struct record *record)
{
	struct adding *adding = context;

	if (record == NULL) {
		command_error("%s, drop %u: no block of it", adding->file, capture->number);
		series_add_refuse(adding);
		return 0;
	}
	add_record(adding, capture, record);
	record_free(record);
	return interrupt_came();
}

static void add_log(struct adding *adding, const char *file)
{
	char message[READ_MESSAGE_MAX] = "";

	adding->file = file;
	if (stat(file, &adding->status) != 0 || !S_ISREG(adding->status.st_mode)) {
		command_error("%s: %s", file,
		              stat(file, &adding->status) != 0 ? strerror(errno) : "expected a regular file");
		series_add_refuse(adding);
		return;
	}
	if (series_add_is_there(adding, file, NULL) != 0)
		return;
	adding->angle_deg = adding->height_m = NAN;
	read_json_beside(adding);
	if (isnan(adding->angle_deg))
		read_sidecar_beside(adding);
	if (read_each(file, NULL, series_add_drop, adding, message) < 0) {
		command_error("%s", message);
		series_add_refuse(adding);
	}
}

int series_verb_add(struct archive *archive, struct series_arguments *a)
{
	struct adding adding = {.archive = archive, .a = a};
	int code = series_must_be(archive, a->word[0]);

	if (code == COMMAND_DONE)
		code = series_check_chain(a);
	if (code != COMMAND_DONE)
		return code;
	if (archive_scene(archive, a->word[0], &adding.scene) != 0 ||
	    archive_ask_captures(archive, series_add_key_of) != 0)
		return archived_failed(archive);
	interrupt_catch();
	for (int i = 1; i < a->count && !interrupt_came(); i++)
		add_log(&adding, a->word[i]);
	return interrupt_came() ? COMMAND_REFUSED : adding.code;
}
