/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "common/base/number.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

bool number_read(const char *text, double min, double max, double *value)
{
	char *end;
	double number = strtod(text, &end);

	if (end == text || *end != '\0' || !isfinite(number) || !(number >= min && number <= max))
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
