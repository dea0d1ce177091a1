/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "common/base/number.h"

#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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

/* ---- what strtod would say of what is usual, without it ---- */

enum { HELD = 19 }; /* digits that a uint64_t holds */

static const uint64_t power_of_ten[HELD + 1] = {1,
                                                10,
                                                100,
                                                1000,
                                                10000,
                                                100000,
                                                1000000,
                                                10000000,
                                                100000000,
                                                1000000000,
                                                10000000000,
                                                100000000000,
                                                1000000000000,
                                                10000000000000,
                                                100000000000000,
                                                1000000000000000,
                                                10000000000000000,
                                                100000000000000000,
                                                1000000000000000000,
                                                10000000000000000000u};

/* digits / divisor, rounded once: 63 or 64 bits of the quotient with all that is below them in the last. */
static double quotient(uint64_t digits, uint64_t divisor)
{
	const int up = __builtin_clzll(digits), divisor_up = __builtin_clzll(divisor);
	const unsigned __int128 dividend = (unsigned __int128)(digits << up) << 63;
	const uint64_t whole = (uint64_t)(dividend / (divisor << divisor_up));
	const bool rest = dividend != (unsigned __int128)whole * (divisor << divisor_up);

	return ldexp((double)(whole | rest), divisor_up - up - 63);
}

/* digits times 10^exponent; false where one rounding does not do. */
static bool scaled(uint64_t digits, int exponent, double *value)
{
	const uint64_t exact = UINT64_C(1) << DBL_MANT_DIG;

	if (digits == 0)
		*value = 0;
	else if (exponent < -HELD || exponent > HELD || (exponent > 0 && digits > exact))
		return false;
	else if (exponent >= 0)
		*value = (double)digits * (double)power_of_ten[exponent];
	else if (digits <= exact)
		*value = (double)digits / (double)power_of_ten[-exponent];
	else
		*value = quotient(digits, power_of_ten[-exponent]);
	return true;
}

static bool read_exponent(const char *text, size_t length, int *exponent)
{
	size_t at = length > 0 && (text[0] == '+' || text[0] == '-');
	int size = 0;

	if ((length - at) - 1 > 2) /* 1 to 3 digits */
		return false;
	for (size_t i = at; i < length; i++) {
		if (text[i] < '0' || text[i] > '9')
			return false;
		size = 10 * size + (text[i] - '0');
	}
	*exponent += at > 0 && text[0] == '-' ? -size : size;
	return true;
}

/* Sign, up to HELD digits with a decimal sign among them, exponent. False: strtod has to say what it is. */
static bool parse_usual(const char *text, size_t length, char decimal, double *value)
{
	const bool sign = text[0] == '-' || text[0] == '+';
	unsigned held = 0, point = 0, seen = 0;
	uint64_t digits = 0;
	int exponent = 0;
	size_t at = sign;

	for (; at < length; at++) {
		const unsigned digit = (unsigned)(unsigned char)text[at] - '0';

		if (digit < 10) {
			digits = 10 * digits + digit;
			held += held > 0 || digit != 0;
			exponent -= (int)point;
			seen = 1;
			if (held > HELD)
				return false;
		} else if (text[at] == decimal && point == 0) {
			point = 1;
		} else {
			break;
		}
	}
	if (seen == 0 ||
	    (at < length &&
	     ((text[at] | 0x20) != 'e' || !read_exponent(text + at + 1, length - at - 1, &exponent))) ||
	    !scaled(digits, exponent, value))
		return false;
	if (text[0] == '-')
		*value = -*value;
	return true;
}

bool number_parse(const char *text, size_t length, char decimal, double *value)
{
	char copy[LENGTH_MAX + 1];
	double parsed;
	char *end;

	if (length == 0 || length > LENGTH_MAX)
		return false;
	if (parse_usual(text, length, decimal, &parsed)) {
		*value = parsed;
		return true;
	}
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

/* ---- the shortest form ---- */

enum { ENOUGH = 17 }; /* digits that read back equal whatever the value */

/* d.ddd times 10^exponent, the last of the HELD digits rounded. */
struct decimal {
	uint64_t digits;
	int exponent;
};

static struct decimal decimal_of(double size)
{
	char text[HELD + 8]; /* d.ddd and e-308 */
	struct decimal decimal;

	snprintf(text, sizeof(text), "%.*e", HELD - 1, size);
	decimal.digits = (uint64_t)(text[0] - '0');
	for (unsigned i = 2; i <= HELD; i++)
		decimal.digits = 10 * decimal.digits + (uint64_t)(text[i] - '0');
	decimal.exponent = atoi(text + HELD + 2);
	return decimal;
}

/* As "%.*g" lays it out, from the digits without the zeros at their end. */
static void lay_out(char *at, struct decimal decimal, int digits)
{
	char digit[HELD];
	int count = HELD, exponent = decimal.exponent;

	for (int i = HELD; i > 0; decimal.digits /= 10)
		digit[--i] = (char)('0' + decimal.digits % 10);
	while (count > 1 && digit[count - 1] == '0')
		count--;
	if (exponent < -4 || exponent >= digits) {
		*at++ = digit[0];
		if (count > 1)
			*at++ = '.';
		memcpy(at, digit + 1, (size_t)count - 1);
		at += count - 1;
		snprintf(at, 6, "e%c%02u", exponent < 0 ? '-' : '+', (unsigned)abs(exponent) % 1000);
		return;
	}
	if (exponent < 0)
		*at++ = '0';
	for (int i = 0; i <= exponent; i++)
		*at++ = i < count ? digit[i] : '0';
	if (count > exponent + 1)
		*at++ = '.';
	for (int i = exponent + 1; i < 0; i++)
		*at++ = '0';
	for (int i = exponent < 0 ? 0 : exponent + 1; i < count; i++)
		*at++ = digit[i];
	*at = '\0';
}

/* Without asking strtod whether it reads back equal: it does where it lies by less than half a place of the
 * value's from it. False where that is too near to say, and where places are not even to both sides. */
static bool shorten_decimal(char *text, double value, int least)
{
	const double size = fabs(value);
	struct decimal decimal;
	uint64_t scale = 100; /* of HELD and ENOUGH digits */
	double half;
	int power;

	if (!(size > DBL_MIN / DBL_EPSILON && size < DBL_MAX) || frexp(size, &power) == 0.5)
		return false;
	decimal = decimal_of(size);
	half = (double)decimal.digits * (ldexp(0.5, power - DBL_MANT_DIG) / size);
	for (int digits = ENOUGH; digits > least; digits--)
		scale *= 10;
	for (int digits = least; digits <= ENOUGH; digits++, scale /= 10) {
		uint64_t below = decimal.digits % scale, above = scale - below;
		double off = (double)(below < above ? below : above);

		if (below == above)
			return false; /* which way it is rounded hangs on what is not held */
		if (digits < ENOUGH && off - 1 > half)
			continue;
		if (digits < ENOUGH && off + 1 > half)
			return false;
		decimal.digits = below < above ? decimal.digits - below : decimal.digits + above;
		if (decimal.digits >= 10000000000000000000u) {
			decimal.digits /= 10;
			decimal.exponent++;
		}
		if (signbit(value))
			*text++ = '-';
		lay_out(text, decimal, digits);
		return true;
	}
	return false;
}

void number_format(char text[NUMBER_CHARS], double value, int least)
{
	if (shorten_decimal(text, value, least))
		return;
	for (int digits = least; digits <= ENOUGH; digits++) {
		snprintf(text, NUMBER_CHARS, "%.*g", digits, value);
		if (strtod(text, NULL) == value)
			return;
	}
}
