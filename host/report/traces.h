/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_REPORT_TRACES_H
#define DT_HOST_REPORT_TRACES_H
/*
 * The pictures of a report as gnuplot scripts, data inline. Baselines are taken off; times in ms after the
 * report's zero; a lost or bad sample breaks the line and is shaded, a clipped one is marked. Where there
 * are more samples than a picture can show, each column keeps its smallest and largest.
 *
 * No text of the user's enters a script. Each function writes one script to out and returns true, or
 * returns false, having written nothing of use, when there is nothing to draw.
 */
#include <stdbool.h>
#include <stdio.h>

#include "host/report/facts.h"

/* Whether the scene's model has that channel. */
bool traces_has_model(const struct report *report, const struct channel *channel);

/* One channel with its peak and the model. */
bool traces_channel(FILE *out, const struct report *report, const struct report_zero *zero, size_t channel);

/* hypot(X, Y) of every sensor that has a resultant; X is read between its samples at Y's instants. */
bool traces_resultant(FILE *out, const struct report *report, const struct report_zero *zero);

/* The whole record: S1 and S2 along X, or the channel with the largest peak. */
bool traces_overview(FILE *out, const struct report *report, const struct report_zero *zero);

/* The plate's free decay along one axis ('X' or 'Y') of S1, and a damped cosine of the analysis' frequency
 * and damping whose amplitude, phase and offset are fitted here. */
bool traces_ringdown(FILE *out, const struct report *report, const struct report_zero *zero, char axis);

#endif
