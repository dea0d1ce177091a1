/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "common/base/number.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { LENGTH_MAX = 63 }; /* twice the digits of a double */

bool number_read(const char *text, double min, double max, double *value)
{
	char *end;
	double number = strtod(text, &end);

	if (end == text || *end != '\0' || !(number >= min && number <= max))
		return false;
	*value = number;
	return true;
}

bool number_whole(const char *text, uint64_t min, uint64_t max, uint64_t *value)
{
	char *end;
	uint64_t number;

	errno = 0;
	number = strtoull(text, &end, 10);
	if (*text < '0' || *text > '9' || *end != '\0' || errno != 0 || number < min || number > max)
		return false;
	*value = number;
	return true;
}

bool number_parse(const char *text, size_t length, char decimal, double *value)
{
	char copy[LENGTH_MAX + 1];
	double parsed;
	char *end;

	if (length == 0 || length > LENGTH_MAX)
		return false;
	for (size_t i = 0; i < length; i++) {
		char c = text[i];

		if ((c < '0' || c > '9') && c != '+' && c != '-' && c != 'e' && c != 'E' && c != decimal)
			return false;
		copy[i] = c == decimal ? '.' : c;
	}
	copy[length] = '\0';
	parsed = strtod(copy, &end);
	if (*end || end == copy || !isfinite(parsed))
		return false;
	*value = parsed;
	return true;
}

void number_format(char text[NUMBER_CHARS], double value, int least)
{
	for (int digits = least; digits <= 17; digits++) {
		snprintf(text, NUMBER_CHARS, "%.*g", digits, value);
		if (strtod(text, NULL) == value)
			return;
	}
}
