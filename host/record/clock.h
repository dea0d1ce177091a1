/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_CLOCK_H
#define DT_HOST_RECORD_CLOCK_H
/*
 * Times of day and dates as text: "13:04:05.123", "2026-11-24T13:04:05.123Z", "24.11.2026 13:04:05,1",
 * "11/24/2026 1:04:05.123 PM", "04:05.123". Whole nanoseconds, since a double of this century's seconds ends
 * at a quarter of a microsecond. Any context.
 */
#include <stdbool.h>
#include <stdint.h>

#include "host/record/cells.h"

/* All of the text. *ns since midnight, or since 1970 with a date; *digits behind the seconds, at most 9. A
 * zone is taken off. */
bool clock_parse(struct piece text, int64_t *ns, int *digits);

/* A date alone: day, month and year in any usual order, with '-', '.' or '/' between them. */
bool clock_is_date(struct piece text);

#endif
