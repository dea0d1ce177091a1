/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Everything that changes an archive. The sidecar is written within the transaction that it tells of, so that
 * nothing is acknowledged that is not in both; a sidecar may be ahead of the index by what was never
 * acknowledged.
 */
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "host/model/corner.h"
#include "host/model/model.h"
#include "host/result/plan.h"
#include "host/archive/photo.h"
#include "host/archive/proof.h"

enum { SCENE_MAX_BYTES = 65536, NUMBER_MAX = 1000000 };

static int recording_refuse_file(struct archive *archive, const char *file)
{
	return archive_refuse(archive, DT_E_SYSTEM, "%.500s: %s", file, strerror(errno));
}

/* ---- series ---- */

static int read_scene_text(struct archive *archive, const char *file, char **text)
{
	size_t size;

	*text = durable_read(file, &size);
	if (*text == NULL)
		return recording_refuse_file(archive, file);
	if (size <= SCENE_MAX_BYTES && strlen(*text) == size && strstr(*text, SIDECAR_SECTION) == NULL)
		return 0;
	free(*text);
	return archive_refuse(archive, DT_E_FORMAT, "%.400s: expected a scene of at most %d bytes of text",
	                      file, SCENE_MAX_BYTES);
}

/* The line of a scene's text that gives a key; section: whether it stands in one. NULL: there is none. */
static const char *line_of(const char *text, const char *key, bool section)
{
	size_t length = strlen(key);
	bool inside = false;

	for (const char *line = text; *line != '\0'; line += strcspn(line, "\n"), line += *line != '\0') {
		const char *word = line + strspn(line, " \t");

		inside = inside || *word == '[';
		if (inside == section && strcspn(word, " \t=:\n") == length &&
		    strncmp(word, key, length) == 0)
			return line;
	}
	return NULL;
}

/* Puts another line into a scene's text at the place of line, whose own goes. */
static int put_line(struct archive *archive, char **text, const char *line, bool own, const char *with)
{
	char *changed = NULL;

	if (asprintf(&changed, "%.*s%s%s", (int)(line - *text), *text, with,
	             own ? line + strcspn(line, "\n") : line) < 0)
		return archive_refuse(archive, DT_E_MEMORY, "%s", error_text(DT_E_MEMORY));
	free(*text);
	*text = changed;
	return 0;
}

/* In place of the key's line, else before that of another of its section. */
static int set_number(struct archive *archive, const char *key, double value, const char *before, char **text)
{
	const char *line = line_of(*text, key, true);
	bool own = line != NULL;
	char with[64];

	if (!own && (before == NULL || (line = line_of(*text, before, true)) == NULL))
		return archive_refuse(archive, DT_E_FORMAT, "the scene has no line '%s = '",
		                      before != NULL ? before : key);
	snprintf(with, sizeof(with), "%s = %.15g%s", key, value, own ? "" : "\n");
	return put_line(archive, text, line, own, with);
}

/* The contact time stays that of the drop it was measured in. */
static int set_height(struct archive *archive, double height_m, double measured_m, char **text)
{
	int result = set_number(archive, "height_m", height_m, NULL, text);

	return result != 0 ? result
	                   : set_number(archive, "duration_height_m", measured_m, "duration_s", text);
}

/* What a scene leaves to be predicted of its contact, at the series' own angle and height, with the
 * uncertainty where a fit would have put it: a later version may predict otherwise. */
static int set_contact(struct archive *archive, struct scene *scene, char **text)
{
	char reason[MODEL_MESSAGE_MAX], *with;
	int result;

	if (!isnan(scene->contact_stiffness_n_m15))
		return 0;
	if (corner_fill(scene, reason) != 0)
		return archive_refuse(archive, DT_E_RANGE, "the scene of the series: %s", reason);
	result = set_number(archive, "duration_s", scene->contact_duration_s, NULL, text);
	if (result == 0)
		result = set_number(archive, "stiffness_n_m15", scene->contact_stiffness_n_m15, NULL, text);
	if (result != 0)
		return result;
	if (asprintf(&with, "\n; stiffness_n_m15 was predicted from the materials\n[fit]\n%s = %.6g\n",
	             scene_fitted[0], scene->fitted_u[0]) < 0)
		return archive_refuse(archive, DT_E_MEMORY, "%s", error_text(DT_E_MEMORY));
	result = put_line(archive, text, *text + strlen(*text), false, with);
	free(with);
	return result;
}

/* Names that do not depend on where the scene stood, a line each in place of those that were there. */
static int set_chain(struct archive *archive, const char *chain, char **text)
{
	const char *line;
	size_t at = 0;
	int result = 0;

	while (result == 0 && (line = line_of(*text, "chain", false)) != NULL)
		result = put_line(archive, text, line, true, "");
	for (size_t length; result == 0 && (length = scene_chain_file(&chain)) > 0; chain += length) {
		char with[PATH_MAX + 16];

		snprintf(with, sizeof(with), "chain = %.*s\n", (int)length, chain);
		result = put_line(archive, text, *text + at, false, with);
		at += strlen(with);
	}
	return result;
}

int series_insert(struct archive *archive, const char *name, const char *campaign, const char *text,
                  const struct scene *scene, int64_t planned, const char *created, int64_t *row)
{
	int result = sql_run(archive, "INSERT OR IGNORE INTO campaigns (name, created) VALUES (?, ?)", "ss",
	                     campaign, created);

	if (result == 0)
		result = sql_run(
		        archive,
		        "INSERT INTO series (name, campaign_id, scene_name, scene, angle_deg, height_m,"
		        " plate_mass_kg, planned, created)"
		        " SELECT ?, id, ?, ?, ?, ?, ?, ?, ? FROM campaigns WHERE name = ?",
		        "sssdddiss", name, scene->name, text, scene->drop_angle_deg, scene->drop_height_m,
		        scene->mount_plate_mass_kg, planned, created, campaign);
	*row = sqlite3_last_insert_rowid(archive->index);
	return result;
}

/* With its sidecar; the name must be new. */
static int recording_make_series(struct archive *archive, const char *name, const char *campaign,
                                 const char *text, const struct scene *scene, unsigned planned)
{
	char now[ARCHIVE_TIME_CHARS];
	int64_t known, row = 0;
	int result = sql_number(archive, &known, "SELECT id FROM series WHERE name = ?", "s", name);

	if (result == 0)
		return archive_refuse(archive, DT_E_STATE,
		                      "series '%s' is there already, expected a new name", name);
	if (result != DT_E_EMPTY)
		return result;
	archive_time(now, time(NULL));
	result = series_insert(archive, name, campaign, text, scene, planned, now, &row);
	return result != 0 ? result : sidecar_write_series(archive, row);
}

int archive_new_series(struct archive *archive, const char *name, const char *campaign,
                       const char *scene_file, double angle_deg, double height_m, const char *chain,
                       unsigned planned)
{
	char message[SCENE_MESSAGE_MAX], *text;
	struct scene scene;
	struct plan plan;
	int result = archive_check_names(archive, name, campaign);

	if (result != 0)
		return result;
	if (scene_read(&scene, scene_file, message) != 0 ||
	    plan_read(&plan, scene.limits, scene_file, message) != 0)
		return archive_refuse(archive, DT_E_FORMAT, "%s", message);
	if (chain != NULL && scene_set_chain(&scene, chain, "") != 0)
		return archive_refuse(archive, DT_E_FORMAT,
		                      "chain is '%.60s', expected names of sensor files", chain);
	if (isnan(angle_deg))
		angle_deg = scene.drop_angle_deg;
	result = read_scene_text(archive, scene_file, &text);
	if (result != 0)
		return result;
	if (!isnan(height_m))
		result = set_height(archive, height_m, scene.contact_duration_height_m, &text);
	if (result == 0 && scene.chain[0] != '\0')
		result = set_chain(archive, scene.chain, &text);
	if (result == 0)
		result = scene_of_text(archive, name, text, angle_deg, &scene);
	if (result == 0)
		result = set_contact(archive, &scene, &text);
	if (result == 0)
		result = archive_change(archive);
	if (result == 0)
		result = archive_end(archive,
		                     recording_make_series(archive, name, campaign, text, &scene, planned));
	free(text);
	return result;
}

/* ---- recording ---- */

static const struct {
	const char *format, *ending;
} logs[] = {{"candump", ".log"}, {"lcm", ".lcm"}, {"csv", ".csv"},
            {"uff58", ".unv"},   {"hdf5", ".h5"}, {"", ".dat"}}; /* .dat: of others */

enum { LOGS = sizeof(logs) / sizeof(logs[0]) };

const char *archive_ending(const char *format)
{
	for (unsigned i = 0; i < LOGS; i++)
		if (strcmp(logs[i].format, format) == 0)
			return logs[i].ending;
	return logs[LOGS - 1].ending;
}

bool archive_is_log(const char *name)
{
	const char *dot = strrchr(name, '.');

	for (unsigned i = 0; i < LOGS; i++)
		if (dot != NULL && dot != name && strcmp(dot, logs[i].ending) == 0)
			return true;
	return false;
}

/* The next number whose log is not there; its log is made, and locked. */
static int recording_take_number(struct archive *archive, const char *year, const char *ending,
                                 struct archive_recording *r)
{
	for (; r->number < NUMBER_MAX; r->number++) {
		snprintf(r->raw, sizeof(r->raw), "raw/%.4s/%s/%04u%.8s", year, r->series, r->number, ending);
		snprintf(r->log, sizeof(r->log), "%s/%s", archive->folder, r->raw);
		if (durable_folders(r->log) != 0)
			return recording_refuse_file(archive, r->log);
		r->lock = open(r->log, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
		if (r->lock >= 0 && flock(r->lock, LOCK_EX | LOCK_NB) == 0)
			return 0;
		if (r->lock >= 0 || errno != EEXIST)
			return recording_refuse_file(archive, r->log);
	}
	return archive_refuse(archive, DT_E_FULL, "series '%s' has %d drops already", r->series, NUMBER_MAX);
}

static int insert_drop(struct archive *archive, const char *operator_name, const char *ending, bool simulated,
                       struct archive_recording *r)
{
	char now[ARCHIVE_TIME_CHARS];
	int64_t series = 0, last = 0;
	int result = sql_number(archive, &series, "SELECT id FROM series WHERE name = ?", "s", r->series);

	if (result == DT_E_EMPTY)
		return archive_refuse(archive, DT_E_UNKNOWN,
		                      "no series '%.80s' in %.300s; 'droptower series new' makes one",
		                      r->series, archive->folder);
	if (result == 0)
		result = sql_number(archive, &last,
		                    "SELECT COALESCE(MAX(number), 0) FROM drops WHERE series_id = ?", "i",
		                    series);
	if (result != 0)
		return result;
	archive_time(now, time(NULL));
	r->number = (unsigned)last + 1;
	result = recording_take_number(archive, now, ending, r);
	if (result == 0)
		result = sql_run(
		        archive,
		        "INSERT INTO drops (series_id, number, state, operator, raw, time, simulated)"
		        " VALUES (?, ?, 'recording', ?, ?, ?, ?)",
		        "iisssi", series, (int64_t)r->number, operator_name, r->raw, now, (int64_t)simulated);
	r->drop = sqlite3_last_insert_rowid(archive->index);
	return result != 0 ? result : sidecar_write_drop(archive, r->drop);
}

/* The chain says that the sidecar goes. */
static int enter_removal(struct archive *archive, const char *raw)
{
	char file[ARCHIVE_NAME_MAX + 64];
	struct chain_place place;
	int result = chain_next(archive, &place);

	sidecar_name(raw, file);
	return result != 0 ? result : chain_enter(archive, &place, file, 0, CHAIN_REMOVED);
}

static int remove_drop(struct archive *archive, const struct archive_recording *r)
{
	int result = sql_run(archive, "DELETE FROM drops WHERE id = ?", "i", r->drop);

	return result != 0 ? result : enter_removal(archive, r->raw);
}

static void remove_files(const struct archive *archive, const char *raw)
{
	char path[ARCHIVE_PATH_MAX];

	snprintf(path, sizeof(path), "%s/%s", archive->folder, raw);
	unlink(path);
	strcpy(strrchr(path, '.'), ".ini");
	unlink(path);
}

/* Files of a drop that did not come to be, as far as it goes; what went wrong before stays told. */
static void take_back(struct archive *archive, const char *raw)
{
	char message[ARCHIVE_MESSAGE_MAX];

	memcpy(message, archive->message, sizeof(message));
	if (archive_change(archive) != 0 || archive_end(archive, enter_removal(archive, raw)) != 0)
		archive->message[0] = '\0'; /* 'verify' names it as missing */
	remove_files(archive, raw);
	memcpy(archive->message, message, sizeof(message));
}

int archive_begin(struct archive *archive, const char *series, const char *operator_name, const char *ending,
                  bool simulated, struct archive_recording *recording)
{
	struct archive_recording r = {.lock = -1};
	int result = archive_check_name(archive, "series", series);

	if (result == 0)
		result = archive_check_operator(archive, operator_name);
	if (result != 0)
		return result;
	strcpy(r.series, series);
	result = archive_change(archive);
	if (result != 0)
		return result;
	result = archive_end(archive, insert_drop(archive, operator_name, ending, simulated, &r));
	if (result == 0) {
		*recording = r;
		return 0;
	}
	if (r.lock >= 0) {
		take_back(archive, r.raw);
		archive_abandon(&r);
	}
	return result;
}

void archive_abandon(struct archive_recording *recording)
{
	close(recording->lock);
	recording->lock = -1;
}

void archive_discard(struct archive *archive, struct archive_recording *recording)
{
	if (archive_change(archive) == 0 && archive_end(archive, remove_drop(archive, recording)) == 0)
		remove_files(archive, recording->raw);
	archive_abandon(recording);
}

int archive_resume(struct archive *archive, const char *drop, struct archive_recording *recording)
{
	struct archive_recording r = {.lock = -1};
	struct archive_place place;
	int result = archive_locate(archive, drop, &place);

	if (result != 0)
		return result;
	r.drop = place.drop;
	r.number = place.number;
	strcpy(r.series, place.name);
	strcpy(r.raw, place.raw);
	snprintf(r.log, sizeof(r.log), "%s/%s", archive->folder, r.raw);
	if (!place.recorded) {
		r.lock = open(r.log, O_RDWR | O_CLOEXEC);
		if (r.lock < 0)
			return recording_refuse_file(archive, r.log);
		if (flock(r.lock, LOCK_EX | LOCK_NB) == 0) {
			*recording = r;
			return 0;
		}
		archive_abandon(&r);
	}
	return archive_refuse(archive, DT_E_STATE, "%s is %s, expected an interrupted drop", drop,
	                      place.recorded ? "recorded" : "being recorded");
}

/* when NULL: it fell just now, so that the photos that wait are of it. */
static int recording_acknowledge(struct archive *archive, const struct archive_recording *r, const char *when,
                                 const char *note, const char *hash, int64_t bytes)
{
	int result = sql_run(archive,
	                     "UPDATE drops SET state = 'recorded', bytes = ?, sha256 = ?, note = ?,"
	                     " time = COALESCE(?, time) WHERE id = ?",
	                     "isssi", bytes, hash, note, when, r->drop);

	if (result == 0 && when == NULL)
		result = photo_bind(archive, r);
	return result != 0 ? result : sidecar_write_drop(archive, r->drop);
}

int archive_finish(struct archive *archive, struct archive_recording *recording, int64_t time_s,
                   const char *note)
{
	char hash[DIGEST_CHARS], when[ARCHIVE_TIME_CHARS];
	int64_t bytes;
	int result = archive_check_text(archive, "note", note);

	archive_time(when, time_s);
	if (result == 0 &&
	    (durable_sync(recording->log) != 0 || digest_file(recording->log, hash, &bytes, -1) != 0))
		result = recording_refuse_file(archive, recording->log);
	if (result == 0)
		result = archive_change(archive);
	if (result == 0)
		result = archive_end(archive,
		                     recording_acknowledge(archive, recording, time_s != 0 ? when : NULL,
		                                           note, hash, bytes));
	archive_abandon(recording);
	return result;
}

/* ---- decisions and notes ---- */

/* What is asked for comes before the drop's files, which are read from end to end. */
int change_look(struct archive *archive, const char *drop, const char *operator_name, const char *text,
                char fault[ARCHIVE_MESSAGE_MAX])
{
	int result = archive_check_text(archive, "text", text);

	if (result == 0)
		result = archive_check_operator(archive, operator_name);
	return result == 0 ? proof_look(archive, drop, fault) : result;
}

int change_start(struct archive *archive, const char *drop, struct archive_place *place)
{
	int result = archive_change(archive);

	if (result != 0)
		return result;
	result = archive_locate(archive, drop, place);
	return result == 0 ? 0 : archive_end(archive, result);
}

int change_end(struct archive *archive, const struct archive_place *place, int result)
{
	if (result == 0)
		result = sidecar_write_drop(archive, place->drop);
	return archive_end(archive, result);
}

int archive_decide(struct archive *archive, const char *drop, enum archive_decision decision,
                   const char *operator_name, const char *text)
{
	static const char *const names[] = {"open", "accepted", "rejected"};
	char fault[ARCHIVE_MESSAGE_MAX];
	struct archive_place place;
	int result;

	if (decision != ARCHIVE_ACCEPTED && strspn(text, " ") == strlen(text))
		return archive_refuse(archive, DT_E_ARGUMENT, "%s: expected a reason", drop);
	result = change_look(archive, drop, operator_name, text, fault);
	if (result != 0)
		return result;
	if (fault[0] != '\0' && decision == ARCHIVE_ACCEPTED)
		return archive_refuse(archive, DT_E_CORRUPT, "%s cannot be accepted: %.500s", drop, fault);
	result = change_start(archive, drop, &place);
	if (result != 0)
		return result;
	if (!place.recorded)
		result = archive_refuse(archive, DT_E_STATE,
		                        "%s was never completely recorded: it counts nowhere", drop);
	if (result == 0)
		result = proof_log(archive, place.drop, fault);
	if (result == 0)
		result = sql_run(archive, "UPDATE drops SET decision = ?, reason = ? WHERE id = ?", "ssi",
		                 names[decision], text, place.drop);
	if (result == 0)
		result = event_insert(archive, place.drop, names[decision], operator_name, text);
	return change_end(archive, &place, result);
}

int archive_note(struct archive *archive, const char *drop, const char *operator_name, const char *text)
{
	char fault[ARCHIVE_MESSAGE_MAX];
	struct archive_place place;
	int result = change_look(archive, drop, operator_name, text, fault);

	if (result == 0)
		result = change_start(archive, drop, &place);
	if (result != 0)
		return result;
	result = proof_log(archive, place.drop, fault);
	if (result == 0)
		result = sql_run(archive, "UPDATE drops SET note = ? WHERE id = ?", "si", text, place.drop);
	if (result == 0)
		result = event_insert(archive, place.drop, "note", operator_name, text);
	return change_end(archive, &place, result);
}
