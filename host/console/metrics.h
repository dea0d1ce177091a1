/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CONSOLE_METRICS_H
#define DT_HOST_CONSOLE_METRICS_H
/*
 * What the page always shows, for Prometheus: text format 0.0.4. Each number or yes-no of the state's JSON is
 * a metric named after its place, droptower_bus_load_percent; what only counts up ends in _total; a list of
 * named things is one metric with a label, droptower_checks_green{name="LATCH"}; the texts of a thing are the
 * labels of its _info.
 */
#include <cjson/cJSON.h>
#include <stdbool.h>
#include <stddef.h>

/* To be freed; NULL without memory. */
char *metrics_text(const cJSON *state, size_t *size);

#endif
