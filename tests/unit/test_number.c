/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The shortest form of a number against printf and strtod asked for one digit more each time, and the reading
 * of one against strtod.
 */
#include <math.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <setjmp.h>
#include <cmocka.h>

#include "common/base/number.h"
#include "tests/unit/synth.h"

static void check(double value, int least)
{
	char text[NUMBER_CHARS], expected[NUMBER_CHARS];

	for (int digits = least; digits <= 17; digits++) {
		snprintf(expected, sizeof(expected), "%.*g", digits, value);
		if (strtod(expected, NULL) == value)
			break;
	}
	memset(text, '#', sizeof(text));
	number_format(text, value, least);
	if (strcmp(text, expected) != 0)
		fail_msg("%a from %d digits: %s, expected %s", value, least, text, expected);
}

static void check_around(double value)
{
	static const int least[] = {1, 6, 15, 16, 17};

	for (size_t i = 0; i < sizeof(least) / sizeof(least[0]); i++) {
		check(value, least[i]);
		check(-value, least[i]);
		check(nextafter(value, INFINITY), least[i]);
		check(nextafter(value, 0), least[i]);
	}
}

static void edges(void **state)
{
	static const double value[] = {
	        0,         1,        9.5,   0.1,  0.3,  1e-4,   9.9999e-5, 99999.95,       123456,
	        999999.5,  1e15,     1e16,  1e17, 1e22, 5e-324, 1e-308,    2.2250739e-308, 1.7e308,
	        0x1p-1022, 0x1p1023, 0x1p53};

	(void)state;
	for (size_t i = 0; i < sizeof(value) / sizeof(value[0]); i++)
		check_around(value[i]);
	for (int power = -1070; power < 1023; power += 3)
		check_around(ldexp(1, power));
	for (int power = -320; power < 309; power++)
		check_around(pow(10, power));
}

/* Any bits; few digits, whose neighbours are the hard ones; halves of the last place asked for. */
static void any(void **state)
{
	struct synth_random random = {1};

	(void)state;
	for (int i = 0; i < 20000; i++) {
		double value = ldexp(synth_uniform(&random), (int)(2000 * synth_uniform(&random)) - 1000);

		check(value, 15);
		check(value, 6);
		check((double)(int64_t)(1e6 * synth_uniform(&random)) / 64, 6);
		check((double)(int64_t)(1e6 * synth_uniform(&random)) / 1e3, 15);
		check(synth_uniform(&random) * 1e3, 15);
	}
}

/* A number or none, as strtod says, to the bit. */
static void check_read(const char *text)
{
	double value = 7, expected;
	bool read = number_parse(text, strlen(text), '.', &value), is;
	char *end;

	expected = strtod(text, &end);
	is = end != text && *end == '\0' && isfinite(expected) &&
	     text[strspn(text, "0123456789+-.eE")] == '\0';
	if (read != is || (is && memcmp(&value, &expected, sizeof(value)) != 0))
		fail_msg("'%s' is read as %d %a, expected %d %a", text, read, value, is, expected);
}

/* What stands behind a number, far or near, changes nothing of it: sixteen characters are looked at where
 * there are as many, and one after the other where there are not. */
static void check_beside(const char *number, const char *behind, char decimal)
{
	char text[80];
	struct number_scan near = {.value = 7}, far = {.value = 7};
	size_t size = (size_t)snprintf(text, sizeof(text), "%s%s", number, behind), length;

	length = number_scan(text, text + size, decimal, &near);
	memset(text + size, '7', sizeof(text) - size);
	text[size] = ';'; /* which ends any */
	assert_int_equal(number_scan(text, text + sizeof(text), decimal, &far), length);
	if (length == 0)
		return;
	assert_int_equal(near.digits, far.digits);
	assert_int_equal(near.exponent, far.exponent);
	assert_memory_equal(&near.value, &far.value, sizeof(near.value));
}

static void beside_others(void **state)
{
	static const char *const behind[] = {"",   ",", "\n", "e", "e5",   "E-3", ".",
	                                     "..", "-", "/",  ":", "\200", " "};
	static const char letters[] = "0123456789.,-+e";
	struct synth_random random = {5};

	(void)state;
	for (int i = 0; i < 200000; i++) {
		char number[24];
		unsigned size = (unsigned)(22 * synth_uniform(&random));

		/* mostly digits, with the sign anywhere */
		for (unsigned k = 0; k < size; k++)
			number[k] = letters[(unsigned)((synth_uniform(&random) < 0.9 ? 10 : 15) *
			                               synth_uniform(&random))];
		if (size > 2 && i % 2 == 0)
			number[(unsigned)((size - 1) * synth_uniform(&random))] = i % 4 == 0 ? '.' : ',';
		number[size] = '\0';
		check_beside(number, behind[i % 13], i % 3 == 0 ? ',' : '.');
	}
}

static void reads(void **state)
{
	static const char *const text[] = {"0",
	                                   "-0",
	                                   "+5",
	                                   ".5",
	                                   "5.",
	                                   ".",
	                                   "-",
	                                   "+",
	                                   "e5",
	                                   "1e",
	                                   "1e+",
	                                   "1e-5",
	                                   "1E05",
	                                   "1e0005",
	                                   "1e22",
	                                   "1e23",
	                                   "9007199254740993",
	                                   "9007199254740992.5",
	                                   "9007199254740993e1",
	                                   "18446744073709551615",
	                                   "18446744073709551616",
	                                   "184467440737095516160",
	                                   "9999999999999999999",
	                                   "0.9999999999999999999",
	                                   "99999999999999999999",
	                                   "0.000142857142857143",
	                                   "1e400",
	                                   "1e-400",
	                                   "1.2.3",
	                                   "1 ",
	                                   " 1",
	                                   "0x10",
	                                   "inf",
	                                   "nan",
	                                   "--1",
	                                   "1-",
	                                   "1e5.0",
	                                   "00000000000000000000000001.5",
	                                   "1e999",
	                                   "-0.0e-7",
	                                   "4.35",
	                                   "1.7976931348623157e308",
	                                   "8.5e-19",
	                                   "0.0000000000000000001"};
	struct synth_random random = {2};

	(void)state;
	for (size_t i = 0; i < sizeof(text) / sizeof(text[0]); i++)
		check_read(text[i]);
	for (int i = 0; i < 200000; i++) {
		uint64_t digits = (uint64_t)(ldexp(synth_uniform(&random), 32)) << 32 |
		                  (uint64_t)(ldexp(synth_uniform(&random), 32));
		char line[64], whole[24];
		int used, point;

		digits >>= (int)(64 * synth_uniform(&random));
		used = snprintf(whole, sizeof(whole), "%llu", (unsigned long long)digits);
		point = (int)((used + 1) * synth_uniform(&random));
		snprintf(line, sizeof(line), "%s%.*s.%s", i % 2 ? "-" : "", point, whole, whole + point);
		check_read(line);
		snprintf(line, sizeof(line), "0.%0*d%s", 1 + i % 4, 0, whole);
		check_read(line);
		snprintf(line, sizeof(line), "%.*s.%se%d", point, whole, whole + point, i % 61 - 30);
		check_read(line);
		/* halfway between two doubles, and a last digit beside it */
		snprintf(line, sizeof(line), "%.*f", i % 9, (double)(digits >> 11) + 0.5);
		check_read(line);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(edges),
	        cmocka_unit_test(any),
	        cmocka_unit_test(beside_others),
	        cmocka_unit_test(reads),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
