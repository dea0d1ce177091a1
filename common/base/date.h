/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_COMMON_BASE_DATE_H
#define DT_COMMON_BASE_DATE_H
/*
 * Dates of the calendar as people write them. Pure functions.
 */
#include <stdbool.h>

enum { DATE_DAY_CHARS = 10, DATE_MINUTE_CHARS = 16 };

/* YYYY-MM-DD. */
bool date_is_day(const char *text);

/* Days after 1970-01-01 of YYYY-MM-DD, whatever follows; false, and unchanged: it is no day of the calendar.
 */
bool date_days(const char *text, double *days);

/* YYYY, YYYY-MM, YYYY-MM-DD or YYYY-MM-DDTHH:MM. */
bool date_is_period(const char *text);

#endif
