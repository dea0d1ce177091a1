/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ARCHIVE_ARCHIVE_H
#define DT_HOST_ARCHIVE_ARCHIVE_H
/*
 * An archive of drops: a folder with an SQLite index and the raw files it speaks of. README.md shows both.
 *
 * A drop is either fully recorded or visibly partial, whatever moment the power fails:
 *
 *     archive_begin    row "recording" and a sidecar are on disk; the caller writes the log it names
 *     archive_finish   the log and its folder are on disk, then its hash and sidecar, then row "recorded"
 *     archive_result   what an analysis said of it, once for each version of the program
 *
 * Only what archive_finish returned 0 for may be called recorded. A recorder that dies leaves a drop that is
 * listed as interrupted. The index holds nothing that the raw files do not: archive_rebuild makes it again.
 *
 * One thread per archive; any number of processes. Every function returns 0 or DT_E_*, and then
 * archive_message tells why in one line. Texts are UTF-8 of one line. Angles in degrees, accelerations in g.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "common/scenes/scene.h"
#include "host/result/repeats.h"

struct archive;

enum archive_mode {
	ARCHIVE_READ,   /* there must be one; nothing is written, but an old schema is brought up to date */
	ARCHIVE_WRITE,  /* there must be one */
	ARCHIVE_CREATE, /* made when there is none */
};

enum { ARCHIVE_MESSAGE_MAX = 640, ARCHIVE_PATH_MAX = 4300, ARCHIVE_NAME_MAX = 60, ARCHIVE_TEXT_MAX = 400 };

/* NULL, and one line in message. */
struct archive *archive_open(const char *folder, enum archive_mode mode, char message[ARCHIVE_MESSAGE_MAX]);
void archive_close(struct archive *archive);
const char *archive_message(const struct archive *archive);

/* The first file that was there and could not be read while drops were verified, in one line; "" there is
 * none. */
const char *archive_unread(const struct archive *archive);
const char *archive_folder(const struct archive *archive);

/* ---- series ---- */

struct archive_series {
	const char *name, *campaign;
	const char *scene_name;
	const char *scene; /* the whole file */
	double angle_deg, height_m, plate_mass_kg;
	unsigned planned;
	const char *created; /* UTC, ISO 8601 */
	/* of its drops; one that is altered or missing is faulty, whatever was decided on it */
	unsigned recorded, accepted, rejected, partial, faulty;
	const char *last; /* time of the last drop; "" when there is none */
};

/* Name: letters, digits, and . _ - within; its name must be new. The scene is read from scene_file; NAN takes
 * its angle, its height, NULL the files of its sensors, with commas between. Another height is written into
 * the scene that the series keeps, since where the tower's parts stand follows from it; so is the place of
 * its sensors' files. */
DT_MUST_USE int archive_new_series(struct archive *archive, const char *name, const char *campaign,
                                   const char *scene_file, double angle_deg, double height_m,
                                   const char *chain, unsigned planned);

/* The scene of a series, at its angle and height. */
DT_MUST_USE int archive_scene(struct archive *archive, const char *series, struct scene *scene);

/* ---- recording ---- */

struct archive_recording {
	int64_t drop; /* row */
	char series[ARCHIVE_NAME_MAX + 1];
	unsigned number;
	char raw[ARCHIVE_NAME_MAX + 64]; /* the log's place in the archive's folder */
	char log[ARCHIVE_PATH_MAX];      /* the same with the folder in front */
	int lock;                        /* held while it is being recorded */
};

/* What a log of that format, as records name it, ends in: ".log" of "candump", and of one that has no ending
 * of its own here. */
const char *archive_ending(const char *format);

/* Makes the next drop of series, its empty log included. ending: of the log, as above. simulated: on a
 * simulated tower, so that no product falls; false when that is not known. DT_E_UNKNOWN: no such series. */
DT_MUST_USE int archive_begin(struct archive *archive, const char *series, const char *operator_name,
                              const char *ending, bool simulated, struct archive_recording *recording);

/* The log is complete and closed. time_s: of the drop, since the epoch; 0 = when it was begun. note: may be
 * "". On an error the drop stays partial. Ends the recording in any case. */
DT_MUST_USE int archive_finish(struct archive *archive, struct archive_recording *recording, int64_t time_s,
                               const char *note);

/* Nothing came of it: takes drop and files away again. */
void archive_discard(struct archive *archive, struct archive_recording *recording);

/* Leaves it as it is, partial. */
void archive_abandon(struct archive_recording *recording);

/* Takes an interrupted drop up again, because its log may be whole after all. DT_E_STATE: it is recorded, or
 * being recorded. */
DT_MUST_USE int archive_resume(struct archive *archive, const char *drop,
                               struct archive_recording *recording);

/* ---- results, decisions ---- */

/* The log of a drop, open and proven: the one way to read it. What file holds are the bytes that were
 * verified, whatever becomes of the archive's. */
struct archive_log {
	char series[ARCHIVE_NAME_MAX + 1];
	unsigned number;
	char raw[ARCHIVE_NAME_MAX + 64]; /* its place in the archive's folder */
	char file[32];                   /* to read it by, until it is closed */
	int64_t time_s;                  /* of the drop */
	char operator_name[ARCHIVE_NAME_MAX + 1];
	bool simulated;
	int copy;
	char fault[ARCHIVE_MESSAGE_MAX]; /* one line on a result that is not what was recorded; "" */
};

/* Verifies log, sidecar and results of SERIES/NUMBER and marks the drop in the index. DT_E_STATE: not
 * recorded. DT_E_CORRUPT: log or sidecar is missing or not what was recorded. Results can be made again:
 * what is wrong with them stands in fault. */
DT_MUST_USE int archive_open_log(struct archive *archive, const char *drop, struct archive_log *log);
void archive_close_log(struct archive_log *log);

/* What an analysis said, and the same as `analyze --json` gives it, which is kept beside the log. The result
 * of the same version is replaced, others stay. Drops are named SERIES/NUMBER. */
DT_MUST_USE int archive_result(struct archive *archive, const char *drop, const char *version,
                               struct result *said, const char *json);

enum archive_decision { ARCHIVE_OPEN, ARCHIVE_ACCEPTED, ARCHIVE_REJECTED };

/* text: the reason; may be "" for ACCEPTED only. Logged with its time, and so is what is wrong with the
 * drop's files. DT_E_STATE: not recorded. DT_E_CORRUPT: cannot be ACCEPTED, since a file is missing or not
 * what was recorded. */
DT_MUST_USE int archive_decide(struct archive *archive, const char *drop, enum archive_decision decision,
                               const char *operator_name, const char *text);
DT_MUST_USE int archive_note(struct archive *archive, const char *drop, const char *operator_name,
                             const char *text);

/* ---- photos ---- */

/* Of a drop: so many bytes each, so many before it and after it. */
enum { ARCHIVE_PHOTO_BYTES = 8 * 1024 * 1024, ARCHIVE_PHOTOS_MAX = 8, ARCHIVE_PHOTO_FILE_MAX = 128 };

/* Keeps a photo of SERIES/NUMBER beside the drop's log, JPEG or PNG by its content, without what is no
 * picture (host/base/image.h). SERIES alone is its next drop: such a photo, before it, waits for the drop
 * and is of it once that is recorded, but for one that is added from a log of earlier (archive_finish with a
 * time). DT_E_STATE: the drop was never completely recorded, or has not fallen and the photo is after it.
 * DT_E_FORMAT: no whole picture. DT_E_RANGE: too large. DT_E_FULL: it has its photos. */
DT_MUST_USE int archive_photo(struct archive *archive, const char *drop, bool after,
                              const char *operator_name, const void *bytes, size_t size);

/* Takes away those that wait for the next drop of a series. */
DT_MUST_USE int archive_discard_photos(struct archive *archive, const char *series);

struct archive_photo {
	bool after, waits;
	const char *file, *type, *sha256; /* in the folder; "image/jpeg" */
	int64_t bytes;
};

/* The photos of a drop, or those that wait for the next one; names as for archive_photo. */
DT_MUST_USE int archive_each_photo(struct archive *archive, const char *drop,
                                   int (*each)(void *context, const struct archive_photo *photo),
                                   void *context);

/* What it is, to be freed. DT_E_CORRUPT: it is not what was recorded. */
DT_MUST_USE int archive_photo_bytes(struct archive *archive, const struct archive_photo *photo, char **bytes,
                                    size_t *size);

/* ---- looking ---- */

/* What a result says in numbers: the columns of quantity.def. NAN where there is none. */
enum archive_value {
#define QUANTITY_COLUMN(NAME, ...) ARCHIVE_##NAME,
#include "host/result/quantity.def"
	ARCHIVE_VALUE_COUNT
};
const char *archive_value_name(enum archive_value value); /* "s1_x" */

struct archive_drop {
	struct archive_series series; /* without the counts */
	unsigned number;
	const char *state;    /* "recording" "interrupted" "recorded"; of a file: "altered" "missing" */
	const char *decision; /* "open" "accepted" "rejected" */
	const char *reason, *operator_name, *note;
	const char *raw, *sha256, *time;
	int64_t bytes;
	bool sealed;                       /* its sidecar is in the chain */
	const char *fault;                 /* one line on the file that is missing or altered; "" */
	bool simulated;                    /* known to be from a simulated tower; false: not known */
	const char *version;               /* of the result; NULL: there is none */
	const char *quantities;            /* quantity_version of it; "": from before there was one */
	const char *verdict;               /* of the test plan: "pass", ...; "" without limits */
	double value[ARCHIVE_VALUE_COUNT]; /* NAN: none */
	double sigma[ARCHIVE_VALUE_COUNT];
	struct budget_item budget[ARCHIVE_VALUE_COUNT]; /* what "": that one has none; largest_parts unused */
	unsigned not_ok;                                /* bit for each value whose status is not ok */
	const char *flags;                              /* "clipped incomplete", sorted; "" */
};

/* NULL, NAN and 0 take anything. */
struct archive_filter {
	const char *series, *campaign, *scene_name;
	const char *text; /* words: each in a name of series, campaign or operator, a note or a reason; of a
	                     series, all in one of its drops. Of ASCII letters, small and capital are one */
	double angle_deg;
	const char *from, *to; /* times of drops, or the beginnings of them: "2026-11" */
	const char *version;   /* of the results; NULL: the newest of each drop */
	unsigned number;       /* within the series */
	unsigned limit;        /* no more than so many, and the newest first */
};
struct archive_filter archive_filter_none(void);

/* A minute, a day, a month or a year of UTC, or two of them with .. between, into from and to, which point
 * into dates. False when text is none of these. */
struct archive_dates {
	char from[18], to[18];
};
bool archive_parse_dates(const char *text, struct archive_dates *dates, struct archive_filter *filter);

/* Calls each for what passes, in the order of names and numbers, until it returns other than 0, which is
 * then returned. Texts are valid during the call. from and to take series that have a drop in between. With
 * a limit the newest come first: of a series its last drop counts, else when it was made. */
DT_MUST_USE int archive_each_series(struct archive *archive, const struct archive_filter *filter,
                                    int (*each)(void *context, const struct archive_series *series),
                                    void *context);
DT_MUST_USE int archive_each_drop(struct archive *archive, const struct archive_filter *filter,
                                  int (*each)(void *context, const struct archive_drop *drop), void *context);

struct archive_event {
	const char *time, *what, *operator_name, *text;
};

/* What was decided and noted of a drop, in its order. */
DT_MUST_USE int archive_each_event(struct archive *archive, const char *drop,
                                   int (*each)(void *context, const struct archive_event *event),
                                   void *context);

/* The check of a sensor, by its serial number, in a drop that was not rejected: the last one before a time,
 * or the first one after it. e_n NAN: there is none. */
struct archive_check {
	char drop[ARCHIVE_NAME_MAX + 16];
	double e_n;
};
DT_MUST_USE int archive_check(struct archive *archive, const char *serial, const char *time, bool after,
                              struct archive_check *check);

/* The sensors whose files went into a drop's result of that version (NULL: the newest), without transducer.
 */
DT_MUST_USE int archive_each_sensor(struct archive *archive, const char *drop, const char *version,
                                    int (*each)(void *context, const struct sensor_used *sensor),
                                    void *context);

/* A drop's result back, by version or the newest (NULL). said->record: empty, or from the drop's log, and
 * then it keeps all but its flags. Methods and paths stay empty. DT_E_EMPTY: there is none. The channels of
 * said->analysis are to be freed. */
DT_MUST_USE int archive_analysis(struct archive *archive, const char *drop, const char *version,
                                 struct result *said);

/* The JSON of a drop's result, to be freed; version NULL: the newest. DT_E_EMPTY: there is none. */
DT_MUST_USE int archive_json(struct archive *archive, const char *drop, const char *version, char **json);

/* Where a log with these bytes is: 1 and "SERIES/NUMBER" in drop, 0 when there is none, or DT_E_*. */
DT_MUST_USE int archive_find(struct archive *archive, const char *file, char drop[ARCHIVE_NAME_MAX + 16]);

/* Captures, by what tells one from every other (record/log_capture.h), in whatever file they came. The index
 * keeps the keys of those it was told of; after a rebuild they are asked for again. archive_find_capture as
 * archive_find. archive_ask_captures calls key_of for the log of each recorded drop whose key is not known;
 * what it returns 0 for is kept. */
enum { ARCHIVE_KEY_MAX = 80 };
DT_MUST_USE int archive_find_capture(struct archive *archive, const char *key,
                                     char drop[ARCHIVE_NAME_MAX + 16]);
DT_MUST_USE int archive_know_capture(struct archive *archive, int64_t drop, const char *key);
DT_MUST_USE int archive_ask_captures(struct archive *archive,
                                     int (*key_of)(const char *log, char key[ARCHIVE_KEY_MAX]));

/* A number that is another one once somebody else, not this archive, has changed what there is, or a drop has
 * been found altered, missing or whole again. */
DT_MUST_USE int archive_changes(struct archive *archive, int64_t *number);

/* ---- care ---- */

/* Calls wrong with one line for each file that is missing or not what was recorded, and marks the drops in
 * the index as far as it can be written. series NULL: all of it; number 0: all drops of the series and its
 * own sidecar. wrong may be NULL. Returns how many lines, or DT_E_*. */
DT_MUST_USE int archive_verify(struct archive *archive, const char *series, unsigned number,
                               void (*wrong)(void *context, const char *text), void *context);

/* The same of the series' own sidecar alone; what is wrong with the chain is told, and not counted. */
DT_MUST_USE int archive_verify_series(struct archive *archive, const char *series,
                                      void (*wrong)(void *context, const char *text), void *context);

/* The chain's last entry, which stands for all that the archive holds, and how many recorded drops it does
 * not know. */
struct archive_seal {
	int64_t entry; /* 0: there is no chain yet */
	char head[65];
	int64_t drops, not_sealed;
};
DT_MUST_USE int archive_seal(struct archive *archive, struct archive_seal *seal);

/* Whether the chain has this entry with this head: 1 or 0, or DT_E_*. */
DT_MUST_USE int archive_reaches(struct archive *archive, int64_t entry, const char *head);

/* Whether a drop's files are missing or altered, so that it counts nowhere. */
bool archive_is_faulty(const struct archive_drop *drop);

/* Makes the index again from the raw files, and verifies them; what is there of it stays beside it, under
 * another name. wrong is called for each file that could not be used or is not what was recorded. Needs no
 * open archive, and that nobody else writes. DT_E_STATE: it would know fewer drops than before; fewer: it
 * may. */
DT_MUST_USE int archive_rebuild(const char *folder, bool fewer,
                                void (*wrong)(void *context, const char *text), void *context,
                                char message[ARCHIVE_MESSAGE_MAX]);

/* ---- how a series went ---- */

/* A row for each value of the drops that count, and for what they measured of their tower, of three and more:
 * closed, to be freed by repeats_free after 0. */
DT_MUST_USE int archive_trends(struct archive *archive, const char *series, bool undecided,
                               struct repeats *repeats);

#endif
