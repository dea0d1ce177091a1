/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "common/base/date.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/* What follows the year is in the calendar, and on the clock. */
static bool is_in_calendar(const char *text, size_t length)
{
	static const int days[] = {31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31};
	int year = atoi(text), month = atoi(text + 5), day = length > 7 ? atoi(text + 8) : 1;
	int hour = length > DATE_DAY_CHARS ? atoi(text + 11) : 0,
	    minute = length > DATE_DAY_CHARS ? atoi(text + 14) : 0;
	int leap = month == 2 && (year % 4 == 0 && (year % 100 != 0 || year % 400 == 0));

	return month >= 1 && month <= 12 && day >= 1 && day <= days[month - 1] + leap && hour < 24 &&
	       minute < 60;
}

bool date_is_period(const char *text)
{
	static const char pattern[] = "0000-00-00T00:00";
	size_t length = strlen(text);

	for (size_t i = 0; i < length; i++)
		if (i >= sizeof(pattern) - 1 ||
		    (pattern[i] != '0' ? text[i] != pattern[i] : text[i] < '0' || text[i] > '9'))
			return false;
	return length == 4 || ((length == 7 || length == DATE_DAY_CHARS || length == DATE_MINUTE_CHARS) &&
	                       is_in_calendar(text, length));
}

bool date_is_day(const char *text)
{
	return strlen(text) == DATE_DAY_CHARS && date_is_period(text);
}

bool date_days(const char *text, double *days)
{
	char day[DATE_DAY_CHARS + 1];
	struct tm date = {.tm_mday = 0};

	snprintf(day, sizeof(day), "%s", text);
	if (!date_is_day(day))
		return false;
	strptime(day, "%Y-%m-%d", &date);
	*days = (double)timegm(&date) / 86400.0;
	return true;
}
