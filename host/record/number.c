/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/number.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LENGTH_MAX = 63 }; /* twice the digits of a double */

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

void number_format(char text[NUMBER_CHARS], double value)
{
	for (int digits = 15; digits <= 17; digits++) {
		snprintf(text, NUMBER_CHARS, "%.*g", digits, value);
		if (strtod(text, NULL) == value)
			return;
	}
}
