/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_REPORT_FACTS_H
#define DT_HOST_REPORT_FACTS_H
/*
 * What the text, the JSON and the page say alike: the verdict, what was done to the samples, where their
 * time 0 lies, flags in plain words, and the model beside the measurement. Functions of the report alone, no
 * memory kept.
 */
#include "host/report/report.h"

/* The instant that text and page count times from. JSON counts from the record's first instant. */
struct report_zero {
	double time_s;  /* after the record's first instant */
	double width_s; /* of S2's pulse, or the longest of the record; NAN when there is none */
	char name[80];  /* "S2X leaves 10 % of its peak" */
};

struct report_zero report_zero(const struct report *report);

/* One line: is all of it there? Returns whether nothing is missing. */
bool report_verdict(const struct report *report, char *line, size_t size);

/* "CFC180", "lowpass 1650 Hz" or both; "" when nothing was filtered. */
void report_filter(const struct report *report, char *name, size_t size);

/* What was done to the samples beyond taking the baseline off: "filter CFC180; sensor high-pass of 0.3 s
 * undone". Of the tower's sensors also that their high-pass was left. False and an empty line when there is
 * nothing to say. */
bool report_processing(const struct report *report, char *line, size_t size);

/* "" for one, "s" for any other number: "1 gap", "2 gaps". */
const char *report_plural(uint64_t count);

/* RECORD_FLAG_* of the record and of every channel as analysed. */
unsigned report_flags(const struct report *report);

/* A sentence for one RECORD_FLAG_*. */
const char *report_flag_words(unsigned flag);

/* The frame of the 1 000 Hz video that an instant, s after the record's first, falls into: frame n begins
 * with its tick. False when nothing says so. */
bool report_video_frame(const struct report *report, double time_s, long *frame);

/* "1 000 Hz video: time 0 is in frame 441, S2 X peaks in 442"; false and an empty line when nothing says so.
 */
bool report_video(const struct report *report, const struct report_zero *zero, char *line, size_t size);

enum { REPORT_NOTES_MAX = 64 };

/* An ESTIMATE_FLAG_* and the value that carries it. */
struct report_note {
	unsigned flag; /* one bit */
	char of[48];   /* "S1X peak" */
};

/* Fills notes, those of one flag together; returns how many. What says nothing worth knowing is left out:
 * the flags of a value that is not there. */
size_t report_notes(const struct report *report, struct report_note notes[REPORT_NOTES_MAX]);

/* A sentence for one ESTIMATE_FLAG_*. */
const char *report_note_words(unsigned flag);

/* The estimate of an axis of the tower's, "S1X" to "S2Z"; NULL where the record has none (record_axis). */
const struct estimate_channel *report_axis(const struct report *report, const char *which);

/* The baseline that is taken off for pictures, g. */
double report_offset(const struct estimate_channel *estimate);

/* What of a channel's result is not ok, in a word or two: "ok", "clipped", "width short", "tail". */
const char *report_channel_status(const struct estimate_channel *estimate, char *text, size_t size);

/* Whether S1 follows S2 as an oscillator does: its lag is then the one to be shown first. */
bool report_driven(const struct report *report);

enum { REPORT_ROWS_MAX = 10 };

/* One line of the comparison. Measured is NAN where it is not known well enough to compare: its status is
 * not ok. */
struct report_row {
	const char *key;   /* "s1x_peak_g" */
	const char *label; /* "S1 X peak"; "plate, 3 cycles" where they could be counted */
	const char *unit;  /* "g" */
	double scale;      /* value times scale is in unit */
	int decimals;      /* in unit */
	double predicted, measured;
	double rungs_apart; /* the rung below from predicted: how much the model itself may be off; or NAN */
	double predicted_u; /* standard uncertainty of what one drop may show of it, of a scene with [fit]; or
	                       NAN */
	const char *verdict; /* "agrees", "2 sigma", "not possible": beyond 2 and beyond 4 of both together;
	                        or "" */
	double sigma;        /* standard uncertainty of measured; NAN where there is none */
	double difference_percent; /* (predicted - measured)/measured */
};

/* Fills rows, returns how many; 0 without a prediction. */
size_t report_compare(const struct report *report, struct report_row rows[REPORT_ROWS_MAX]);

#endif
