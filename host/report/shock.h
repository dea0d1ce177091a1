/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_REPORT_SHOCK_H
#define DT_HOST_REPORT_SHOCK_H
/*
 * What host/shock found, as parts of JSON and text: shocks, free falls, and a pulse against its band.
 */
#include "host/base/put.h"
#include "host/report/report.h"

/* "events", "free_falls" (always there) and "band" (null without one). */
void shock_put(struct builder *b, cJSON *root, const struct report *report);

/* The band's verdict in one line, without its end. */
void shock_write_band(const struct band *band, FILE *out);

/* The same after an empty line; the lists when the report is to show them. Times from zero_s. */
void shock_write(const struct report *report, double zero_s, FILE *out);

#endif
