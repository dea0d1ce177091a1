/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/clock.h"

#include <stddef.h>
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

/* "2026-11-24" or "24.11.2026", and what parts it from the time of day. */
static bool clock_date(struct scan *scan, int64_t *year, int64_t *month, int64_t *day)
{
	bool found = scan->at[4] == '-'
	                     ? clock_number(scan, 4, 4, 9999, year) && clock_sign(scan, "-") &&
	                               clock_number(scan, 2, 2, 12, month) && clock_sign(scan, "-") &&
	                               clock_number(scan, 2, 2, 31, day)
	                     : clock_number(scan, 2, 2, 31, day) && clock_sign(scan, ".") &&
	                               clock_number(scan, 2, 2, 12, month) && clock_sign(scan, ".") &&
	                               clock_number(scan, 4, 4, 9999, year);

	return found && clock_sign(scan, "T ") && *month >= 1 && *day >= 1;
}

bool clock_parse(struct piece text, int64_t *ns, int *digits)
{
	struct scan scan = {text.text, text.text + text.length};
	int64_t year, month, day, hour, minute, second, found = 0;
	bool dated = text.length > 10 && (text.text[4] == '-' || text.text[2] == '.');

	if (dated) {
		if (!clock_date(&scan, &year, &month, &day))
			return false;
		found = timegm(&(struct tm){
		                .tm_year = (int)year - 1900, .tm_mon = (int)month - 1, .tm_mday = (int)day}) *
		        NS;
	}
	if (!clock_number(&scan, 1, 2, 23, &hour) || !clock_sign(&scan, ":") ||
	    !clock_number(&scan, 2, 2, 59, &minute) || !clock_sign(&scan, ":") ||
	    !clock_number(&scan, 2, 2, 60, &second))
		return false;
	found += ((hour * 60 + minute) * 60 + second) * NS;
	if (!clock_fraction(&scan, &found, digits) || (dated && !clock_zone(&scan, &found)) ||
	    scan.at != scan.end)
		return false;
	*ns = found;
	return true;
}

bool clock_is_date(struct piece text)
{
	struct scan scan = {text.text, text.text + text.length};
	int64_t part[3];
	bool year;

	for (int i = 0; i < 3; i++)
		if ((i > 0 && !clock_sign(&scan, "-./")) || !clock_number(&scan, 1, 4, 9999, &part[i]))
			return false;
	year = part[0] > 1900 || part[2] > 1900;
	return year && scan.at == scan.end;
}
