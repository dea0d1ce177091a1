/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_REPORT_SERIES_PRIVATE_H
#define DT_HOST_REPORT_SERIES_PRIVATE_H
/*
 * A series while it is reported: what series*.c share.
 */
#include "host/archive/table.h"
#include "host/report/page.h"
#include "host/report/script.h"
#include "host/report/series.h"

enum { SERIES_TEXTS = 12 };

struct series_drop {
	struct archive_drop a; /* its texts stand in text */
	char text[SERIES_TEXTS][ARCHIVE_TEXT_MAX + 1];
	bool counts;              /* goes into the means */
	bool has_result;          /* analysis is filled */
	char no_log[320];         /* why there is no trace to draw; "": there is one */
	bool as_read;             /* record is not what the result is of: its sensors' files were others */
	bool quoted;              /* no_log is what verify says, in its words */
	struct record record;     /* from the log; without it, what the result knows of it, without samples */
	struct analysis analysis; /* from the result: what pictures and remarks need */
	struct estimate_options options; /* of the result: the high-pass that was undone */
	struct report report;            /* of these */
	struct report_zero zero;
	cJSON *said;            /* its result, as JSON */
	struct verdict verdict; /* of said */
	bool judged;
	double model_s; /* the model's first touch, after zero; NAN: no model to lay over it */
};

/* A sensor's file, and the drops that it was applied to. */
struct series_sensor {
	char name[8], serial[TRANSDUCER_TEXT_MAX], model[TRANSDUCER_TEXT_MAX],
	        certificate[TRANSDUCER_TEXT_MAX], laboratory[TRANSDUCER_TEXT_MAX], date[12], due[12],
	        file_sha256[DIGEST_CHARS];
	char drops[120], checks[2][ARCHIVE_NAME_MAX + 32]; /* before and after */
	size_t count;                                      /* of them */
	bool overdue;                                      /* at one of them */
	bool suspect;                                      /* a check before or after the series failed */
};

enum { SERIES_SENSORS_MAX = 32 };

struct series_page {
	struct page page;
	const struct series_report *request;
	struct archive_series series; /* its texts stand in text */
	struct archive_seal seal;
	char text[6][ARCHIVE_TEXT_MAX + 1];
	struct scene scene;
	bool has_model, has_below;
	struct model_prediction prediction, below;
	struct series_drop **drop;
	size_t count, room;
	struct series_sensor sensor[SERIES_SENSORS_MAX]; /* of drops that count */
	size_t sensors;
	struct archive_cell cell;                        /* means of those that count */
	struct script_window window;                     /* of every picture, after zero */
	double curve_g[SCRIPT_CURVE_POINTS][MODEL_AXES]; /* the model, from curve.from_s to curve.to_s */
	struct script_window curve;                      /* after its first touch */
};

/* Gnuplot scripts as those of traces.h: one sensor (0: S1) along an axis ('X', 'Y') of all drops that count,
 * with the model; and both sensors of one drop. The same axes for all drops. */
bool series_traces_over(FILE *out, const struct series_page *page, size_t sensor, char axis);
bool series_traces_drop(FILE *out, const struct series_page *page, const struct series_drop *drop, char axis);

/* Whether its log and its result are there. */
bool series_is_whole(const struct series_drop *drop);

/* Whether there is a trace to draw of it. */
bool series_is_drawn(const struct series_drop *drop);

/* A sensor's channel along an axis; NULL where it has none, or there is no trace. */
const struct channel *series_channel(const struct series_drop *drop, size_t sensor, char axis);

/* How many drops go into the means. */
size_t series_counted(const struct series_page *page);

/* "2026-11-21 19:07" of a time as the archive has it; a dash for none. */
void series_time(FILE *out, const char *time);

/* "accepted", "rejected", "undecided", or the state of what was never finished. */
const char *series_decision(const struct series_drop *drop);

/* Sections, in the order of the page. */
void series_head(struct series_page *page);
void series_laboratory(struct series_page *page);
void series_sensors(struct series_page *page);
void series_limits(struct series_page *page);
void series_subject(struct series_page *page);
void series_results(struct series_page *page);
void series_remarks(struct series_page *page);
void series_pictures(struct series_page *page);
void series_spectra(struct series_page *page);
void series_excluded(struct series_page *page);
void series_model(struct series_page *page);
void series_records(struct series_page *page);

/* Bytes in base64. 0 or DT_E_MEMORY. */
DT_MUST_USE int series_base64(FILE *out, const void *bytes, size_t size);

/* Photos of a drop, and how many there are in all of a series. */
void series_photos(struct series_page *page, const struct series_drop *drop);
size_t series_photos_count(struct series_page *page);

/* Adds a sensor of a drop; context: of the drop, with its page. */
struct series_drop_of_page {
	struct series_page *page;
	const struct series_drop *drop;
};
int series_take_sensor(void *context, const struct sensor_used *used);

/* Whether a sensor was overdue at a drop that counts, and whether a check of one failed. */
bool series_is_overdue(const struct series_page *page);
bool series_is_suspect(const struct series_page *page);

/* The checks of the sensors. 0 or DT_E_*. */
int series_check_sensors(struct series_page *page);

/* Behind the page. */
void series_evidence(struct series_page *page);

#endif
