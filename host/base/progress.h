/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_BASE_PROGRESS_H
#define DT_HOST_BASE_PROGRESS_H
/*
 * How far something is that takes long: one line on standard error, written over again, with when it will end
 * at the speed so far. Only where standard error is a terminal; otherwise nothing at all. One thread.
 */
#include <stdbool.h>

struct progress {
	double begun_s, after_s, told_s; /* told from after_s on */
	bool terminal, shown;
};

void progress_begin(struct progress *progress, double after_s);

/* part: what is done of what was to do when it began, 0 to 1; NAN or 0: not known. Called as often as one
 * likes. */
__attribute__((format(printf, 3, 4))) void progress_tell(struct progress *progress, double part,
                                                         const char *format, ...);

/* The line is gone. */
void progress_end(struct progress *progress);

/* Since it began. */
double progress_seconds(const struct progress *progress);

#endif
