/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "common/base/number.h"

#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

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

enum { HELD = NUMBER_SCAN_DIGITS };

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

/* 2^(63 + up) / 10^n, cut, of which the first bit is one. */
static const struct {
	uint64_t bits;
	int up;
} tenth[HELD + 1] = {
        {0x8000000000000000u, 0},  {0xccccccccccccccccu, 4},  {0xa3d70a3d70a3d70au, 7},
        {0x83126e978d4fdf3bu, 10}, {0xd1b71758e219652bu, 14}, {0xa7c5ac471b478423u, 17},
        {0x8637bd05af6c69b5u, 20}, {0xd6bf94d5e57a42bcu, 24}, {0xabcc77118461cefcu, 27},
        {0x89705f4136b4a597u, 30}, {0xdbe6fecebdedd5beu, 34}, {0xafebff0bcb24aafeu, 37},
        {0x8cbccc096f5088cbu, 40}, {0xe12e13424bb40e13u, 44}, {0xb424dc35095cd80fu, 47},
        {0x901d7cf73ab0acd9u, 50}, {0xe69594bec44de15bu, 54}, {0xb877aa3236a4b449u, 57},
        {0x9392ee8e921d5d07u, 60}, {0xec1e4a7db69561a5u, 64},
};

/* 2^power. */
static double two_to(int power)
{
	const uint64_t bits = (uint64_t)(DBL_MAX_EXP - 1 + power) << (DBL_MANT_DIG - 1);
	double value;

	memcpy(&value, &bits, sizeof(value));
	return value;
}

/* digits / 10^n, rounded once: 63 or 64 bits of the quotient with all that is below them in the last. */
static double quotient(uint64_t digits, int n)
{
	const int up = __builtin_clzll(digits), divisor_up = __builtin_clzll(power_of_ten[n]);
	const unsigned __int128 dividend = (unsigned __int128)(digits << up) << 63;
	const uint64_t divisor = power_of_ten[n] << divisor_up, whole = (uint64_t)(dividend / divisor);
	const bool rest = dividend != (unsigned __int128)whole * divisor;

	return (double)(whole | rest) * two_to(divisor_up - up - 63);
}

/* The same by multiplying, which is at most two too small in the last of 64 bits: where that may round it
 * another way, the division has to say. */
static double over_ten(uint64_t digits, int n)
{
	enum { BELOW = 11 }; /* bits that a double has no room for */
	const int up = __builtin_clzll(digits);
	uint64_t high = (uint64_t)(((unsigned __int128)(digits << up) * tenth[n].bits) >> 64), below;
	const int lifted = !(high >> 63);

	high <<= lifted;
	below = high & ((1u << BELOW) - 1);
	if (below + 4 >= 1u << (BELOW - 1) && below <= 1u << (BELOW - 1))
		return quotient(digits, n);
	return (double)high * two_to(1 - lifted - up - tenth[n].up);
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
		*value = over_ten(digits, -exponent);
	return true;
}

/* Decimal digits from `at` on onto *digits, as long as they fit; where they end. */
static const char *take_digits(const char *at, const char *end, uint64_t *digits)
{
#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
	/* up to eight at once: those before the first that is none, as if zeros were before them */
	while (end - at >= 8) {
		uint64_t c, other;
		unsigned count;

		memcpy(&c, at, sizeof(c));
		c ^= 0x3030303030303030u;
		other = ((c + 0x7676767676767676u) | c) & 0x8080808080808080u;
		count = other != 0 ? (unsigned)__builtin_ctzll(other) / 8 : 8;
		if (count == 0)
			return at;
		c <<= 64 - 8 * count;
		c = (c * 10 + (c >> 8)) & 0x00FF00FF00FF00FFu;
		c = (c * 100 + (c >> 16)) & 0x0000FFFF0000FFFFu;
		c = (c * 10000 + (c >> 32)) & 0xFFFFFFFFu;
		*digits = *digits * power_of_ten[count] + c;
		at += count;
		if (count < 8)
			return at;
	}
#endif
	for (; at < end && (unsigned char)(*at - '0') < 10; at++)
		*digits = 10 * *digits + (uint64_t)(*at - '0');
	return at;
}

static const char *skip_zeros(const char *at, const char *end)
{
	while (at < end && *at == '0')
		at++;
	return at;
}

/* 1 to 3 digits behind an e; NULL for others. */
static const char *take_exponent(const char *at, const char *end, int *exponent)
{
	const bool sign = at < end && (*at == '+' || *at == '-'), down = sign && *at == '-';
	const char *start = at + sign;
	uint64_t size = 0;

	at = take_digits(start, end, &size);
	if (at == start || at - start > 3)
		return NULL;
	*exponent += down ? -(int)size : (int)size;
	return at;
}

#if defined(__x86_64__)

enum { REGISTER = 16 };

/* Up to fifteen digits with a decimal sign among them, or sixteen behind "0.", which most numbers are, all at
 * once: the sign is taken out, and pairs become pairs of pairs. A third of the time of eight by eight. 0 for
 * another number.
 */
__attribute__((target("sse4.1"))) static size_t scan_short(const char *text, char decimal,
                                                           struct number_scan *number)
{
	const __m128i place = _mm_setr_epi8(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
	const unsigned left_out = text[0] == '0' && text[1] == decimal ? 2 : 0;
	const char *const at = text + left_out;
	__m128i digit = _mm_xor_si128(_mm_loadu_si128((const __m128i *)(const void *)at), _mm_set1_epi8('0'));
	const __m128i is_digit = _mm_cmpeq_epi8(_mm_min_epu8(digit, _mm_set1_epi8(9)), digit);
	const unsigned others = ~(unsigned)_mm_movemask_epi8(is_digit); /* above the sixteen, too */
	const unsigned before = (unsigned)__builtin_ctz(others);
	unsigned behind = left_out > 0 ? before : 0, count = before, end = before;

	if (left_out == 0 && before < REGISTER && at[before] == decimal) {
		const __m128i whole = _mm_cmpgt_epi8(_mm_set1_epi8((char)before), place);

		behind = (unsigned)__builtin_ctz(others >> (before + 1));
		count += behind;
		end = count + 1;
		digit = _mm_blendv_epi8(_mm_srli_si128(digit, 1), digit, whole);
	}
	if (count == 0 || (unsigned char)(at[end] - '0') < 10 || (at[end] | 0x20) == 'e' ||
	    (left_out == 0 && before == REGISTER))
		return 0;
	/* to the register's end, zeros before them */
	digit = _mm_shuffle_epi8(digit, _mm_add_epi8(place, _mm_set1_epi8((char)(count - REGISTER))));
	digit = _mm_maddubs_epi16(digit, _mm_set1_epi16(1 << 8 | 10));
	digit = _mm_madd_epi16(digit, _mm_set1_epi32(1 << 16 | 100));
	digit = _mm_packus_epi32(digit, digit);
	digit = _mm_madd_epi16(digit, _mm_set1_epi32(1 << 16 | 10000));
	number->digits = (uint64_t)(uint32_t)_mm_cvtsi128_si32(digit) * 100000000 +
	                 (uint32_t)_mm_extract_epi32(digit, 1);
	number->exponent = -(int)behind;
	return scaled(number->digits, number->exponent, &number->value) ? left_out + end : 0;
}

#endif

/* Any that is no longer than a uint64_t. */
static size_t scan_long(const char *start, const char *end, char decimal, struct number_scan *number)
{
	const char *const first = skip_zeros(start, end), *at;
	ptrdiff_t held, seen;

	number->digits = 0;
	number->exponent = 0;
	at = take_digits(first, end, &number->digits);
	held = at - first;
	seen = at - start;
	if (at < end && *at == decimal) {
		const char *point = ++at;

		if (held == 0)
			at = skip_zeros(at, end);
		held -= at - point;
		at = take_digits(at, end, &number->digits);
		held += at - point;
		seen += at - point;
		if (held > HELD)
			return 0;
		number->exponent = (int)(point - at);
	}
	if (seen == 0 || held > HELD)
		return 0;
	if (at < end && (*at | 0x20) == 'e') {
		at = take_exponent(at + 1, end, &number->exponent);
		if (at == NULL)
			return 0;
	}
	return scaled(number->digits, number->exponent, &number->value) ? (size_t)(at - start) : 0;
}

size_t number_scan(const char *text, const char *end, char decimal, struct number_scan *number)
{
	const bool sign = text < end && (*text == '-' || *text == '+');
	size_t length = 0;

#if defined(__x86_64__)
	/* a sign, "0." and the character that ends the number */
	if (end - text >= REGISTER + 4 && __builtin_cpu_supports("sse4.1"))
		length = scan_short(text + sign, decimal, number);
#endif
	if (length == 0)
		length = scan_long(text + sign, end, decimal, number);
	if (length == 0)
		return 0;
	if (*text == '-')
		number->value = -number->value;
	return length + sign;
}

bool number_parse(const char *text, size_t length, char decimal, double *value)
{
	struct number_scan number;
	char copy[LENGTH_MAX + 1];
	double parsed;
	char *end;

	if (length == 0 || length > LENGTH_MAX)
		return false;
	if (number_scan(text, text + length, decimal, &number) == length) {
		*value = number.value;
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

/* Where a power of ten that takes the value to HELD digits is held exactly, from 1e-9 to 1e19, by one
 * product. */
static bool decimal_by_product(double size, struct decimal *decimal)
{
	enum { FIVES = 27 }; /* 5^27 fits 64 bits */
	const uint64_t end = power_of_ten[HELD - 1];
	int power, places;
	uint64_t mantissa = (uint64_t)ldexp(frexp(size, &power), 64), five = 1;

	places = HELD - 1 - ((power - 1) * 1233 >> 12); /* log10(2); one too many, or right */
	if (places > FIVES || places < 0)
		return false;
	for (int i = 0; i < places; i++)
		five *= 5;
	for (;; places--, five /= 5) {
		const unsigned __int128 product = (unsigned __int128)mantissa * five;
		const int down = 64 - power - places;

		if (down < 1 || down > 127)
			return false;
		if (product >> down < (unsigned __int128)end * 10) {
			decimal->digits = (uint64_t)((product >> down) + (product >> (down - 1) & 1));
			decimal->exponent = HELD - 1 - places;
			return decimal->digits >= end && decimal->digits < end * 10;
		}
	}
}

static struct decimal decimal_of(double size)
{
	char text[HELD + 8]; /* d.ddd and e-308 */
	struct decimal decimal;

	if (decimal_by_product(size, &decimal))
		return decimal;
	snprintf(text, sizeof(text), "%.*e", HELD - 1, size);
	decimal.digits = (uint64_t)(text[0] - '0');
	for (unsigned i = 2; i <= HELD; i++)
		decimal.digits = 10 * decimal.digits + (uint64_t)(text[i] - '0');
	decimal.exponent = atoi(text + HELD + 2);
	return decimal;
}

/* e-05, e+123 */
static void lay_out_exponent(char *at, int exponent)
{
	const unsigned size = (unsigned)abs(exponent);

	*at++ = 'e';
	*at++ = exponent < 0 ? '-' : '+';
	if (size >= 100)
		*at++ = (char)('0' + size / 100);
	*at++ = (char)('0' + size / 10 % 10);
	*at++ = (char)('0' + size % 10);
	*at = '\0';
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
		lay_out_exponent(at, exponent);
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

/* How far the nearest multiple is. */
static double to_multiple(uint64_t digits, uint64_t scale)
{
	const uint64_t below = digits % scale, above = scale - below;

	return (double)(below < above ? below : above);
}

/* Without asking strtod whether it reads back equal: it does where it lies by less than half a place of the
 * value's from it. False where that is too near to say, and where places are not even to both sides. */
static bool shorten_decimal(char *text, double value, int least)
{
	const double size = fabs(value);
	struct decimal decimal;
	uint64_t scale = 100, below, above; /* of HELD and ENOUGH digits */
	int digits = ENOUGH, power;
	double half;

	if (!(size > DBL_MIN / DBL_EPSILON && size < DBL_MAX) || frexp(size, &power) == 0.5)
		return false;
	decimal = decimal_of(size);
	half = (double)decimal.digits * (ldexp(0.5, power - DBL_MANT_DIG) / size);
	for (; digits > least; digits--, scale *= 10) {
		const double off = to_multiple(decimal.digits, 10 * scale);

		if (off - 1 > half)
			break; /* fewer read back as another */
		if (off + 1 > half)
			return false;
	}
	below = decimal.digits % scale;
	above = scale - below;
	if (below == above)
		return false; /* which way it is rounded hangs on what is not held */
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

/* A whole number of so many digits at most is written with all it has. */
static bool write_whole(char *text, double value, int most)
{
	const double size = fabs(value);
	char digit[HELD];
	int count = 0;
	uint64_t left;

	if (!(size < (double)power_of_ten[most]) || size != (double)(uint64_t)size)
		return false;
	left = (uint64_t)size;
	do
		digit[count++] = (char)('0' + left % 10);
	while ((left /= 10) > 0);
	if (signbit(value))
		*text++ = '-';
	while (count > 0)
		*text++ = digit[--count];
	*text = '\0';
	return true;
}

void number_format(char text[NUMBER_CHARS], double value, int least)
{
	if (write_whole(text, value, least) || shorten_decimal(text, value, least))
		return;
	for (int digits = least; digits <= ENOUGH; digits++) {
		snprintf(text, NUMBER_CHARS, "%.*g", digits, value);
		if (strtod(text, NULL) == value)
			return;
	}
}
