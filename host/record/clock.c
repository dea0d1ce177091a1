/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/clock.h"

#include <stddef.h>
#include <string.h>
#include <strings.h>
#include <time.h>

static const int64_t NS = 1000000000;
static const int NS_DIGITS = 9;

struct scan {
	const char *at, *end;
};

static bool clock_is_digit(const struct scan *scan)
{
	return scan->at < scan->end && *scan->at >= '0' && *scan->at <= '9';
}

/* A number of least to most digits up to a limit. */
static bool clock_number(struct scan *scan, int least, int most, int64_t limit, int64_t *value)
{
	int digits = 0;

	*value = 0;
	while (digits < most && clock_is_digit(scan)) {
		*value = *value * 10 + (*scan->at++ - '0');
		digits++;
	}
	return digits >= least && *value <= limit;
}

static bool clock_sign(struct scan *scan, const char *any)
{
	for (; *any != '\0' && scan->at < scan->end; any++)
		if (*scan->at == *any) {
			scan->at++;
			return true;
		}
	return false;
}

static bool clock_fraction(struct scan *scan, int64_t *ns, int *digits)
{
	int64_t part = 0;

	*digits = 0;
	if (!clock_sign(scan, ".,"))
		return true;
	for (; clock_is_digit(scan) && *digits < NS_DIGITS; ++*digits)
		part = part * 10 + (*scan->at++ - '0');
	for (int i = *digits; i < NS_DIGITS; i++)
		part *= 10;
	*ns += part;
	while (scan->at < scan->end && *scan->at == '0')
		scan->at++;
	return *digits > 0;
}

static bool clock_zone(struct scan *scan, int64_t *ns)
{
	int64_t hours, minutes = 0, sign;

	if (scan->at == scan->end || clock_sign(scan, "Z"))
		return true;
	sign = *scan->at == '-' ? 1 : -1;
	if (!clock_sign(scan, "+-") || !clock_number(scan, 2, 2, 14, &hours))
		return false;
	(void)clock_sign(scan, ":");
	if (scan->at < scan->end && !clock_number(scan, 2, 2, 59, &minutes))
		return false;
	*ns += sign * (hours * 60 + minutes) * 60 * NS;
	return true;
}

static bool clock_month_name(struct scan *scan, int64_t *month)
{
	static const char names[] = "JanFebMarAprMayJunJulAugSepOctNovDec";

	for (*month = 1; *month <= 12 && scan->end - scan->at >= 3; ++*month)
		if (strncasecmp(scan->at, names + 3 * (*month - 1), 3) == 0) {
			scan->at += 3;
			return true;
		}
	return false;
}

/* Three parts with one sign between them: "2026-11-24", "24.11.2026", "24-Nov-2026", "11/24/2026". Before a
 * year the day comes first, before a slash the month, unless only the other way there is such a month. */
static bool clock_date(struct scan *scan, struct tm *date)
{
	char sign[] = "?";
	int64_t part[3];
	bool named, swapped;

	if (!clock_number(scan, 1, 4, 9999, &part[0]) || scan->at == scan->end || !strchr("-./", *scan->at))
		return false;
	sign[0] = *scan->at++;
	named = clock_month_name(scan, &part[1]);
	if ((!named && !clock_number(scan, 1, 2, 31, &part[1])) || !clock_sign(scan, sign) ||
	    !clock_number(scan, 1, 4, 9999, &part[2]))
		return false;
	swapped = !named && part[0] <= 31 && (part[1] > 12 || (sign[0] == '/' && part[0] <= 12));
	date->tm_year = (int)(part[0] > 31 ? part[0] : part[2]) - 1900;
	date->tm_mon = (int)(swapped ? part[0] : part[1]) - 1;
	date->tm_mday = (int)(part[0] > 31 ? part[2] : swapped ? part[1] : part[0]);
	return date->tm_year > 0 && date->tm_mon >= 0 && date->tm_mon < 12 && date->tm_mday >= 1 &&
	       date->tm_mday <= 31;
}

/* "PM": *hour of twelve becomes one of 24. */
static bool clock_half(struct scan *scan, int64_t *hour)
{
	struct scan half = *scan;
	bool afternoon;

	(void)clock_sign(&half, " ");
	afternoon = clock_sign(&half, "pP");
	if (!afternoon && !clock_sign(&half, "aA"))
		return true;
	if (!clock_sign(&half, "mM") || *hour < 1 || *hour > 12)
		return false;
	*hour = *hour % 12 + (afternoon ? 12 : 0);
	*scan = half;
	return true;
}

/* "13:04:05.1", "1:04:05.1 PM", and "04:05.1", which has no hour: without a fraction it may be hours and
 * minutes. */
static bool clock_of_day(struct scan *scan, int64_t *ns, int *digits)
{
	int64_t hour, minute, second, part = 0;
	bool whole;

	if (!clock_number(scan, 1, 2, 59, &hour) || !clock_sign(scan, ":") ||
	    !clock_number(scan, 2, 2, 60, &minute))
		return false;
	whole = clock_sign(scan, ":");
	if (!whole) {
		second = minute;
		minute = hour;
		hour = 0;
	} else if (!clock_number(scan, 2, 2, 60, &second)) {
		return false;
	}
	if (!clock_fraction(scan, &part, digits) || (!whole && *digits == 0) ||
	    (whole && !clock_half(scan, &hour)))
		return false;
	*ns = ((hour * 60 + minute) * 60 + second) * NS + part;
	return hour < 24 && minute < 60;
}

bool clock_parse(struct piece text, int64_t *ns, int *digits)
{
	struct scan scan = {text.text, text.text + text.length};
	const char *colon = memchr(text.text, ':', text.length);
	struct tm date = {.tm_year = 0};
	int64_t found;
	bool dated = false;

	for (const char *at = text.text; colon && at < colon; at++)
		dated |= strchr("-./", *at) != NULL;
	if (colon == NULL || (dated && (!clock_date(&scan, &date) || !clock_sign(&scan, "T "))) ||
	    !clock_of_day(&scan, &found, digits) || (dated && !clock_zone(&scan, &found)) ||
	    scan.at != scan.end)
		return false;
	*ns = found + (dated ? timegm(&date) * NS : 0);
	return true;
}

bool clock_is_date(struct piece text)
{
	struct scan scan = {text.text, text.text + text.length};
	struct tm date = {.tm_year = 0};

	return clock_date(&scan, &date) && scan.at == scan.end;
}
