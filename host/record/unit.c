/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/unit.h"

#include <ctype.h>
#include <math.h>
#include <string.h>
#include <strings.h>

#include "common/units.h"

enum { CHARS_MAX = 24 };

#define G UNITS_G_M_S2

/* Without what does not count. A kg beside accelerations is a kilo-g. */
static const struct {
	const char *spelling;
	struct unit unit;
} table[] = {
        {"s", {"s", UNIT_TIME, 1, 0}},
        {"sec", {"s", UNIT_TIME, 1, 0}},
        {"secs", {"s", UNIT_TIME, 1, 0}},
        {"second", {"s", UNIT_TIME, 1, 0}},
        {"seconds", {"s", UNIT_TIME, 1, 0}},
        {"ms", {"ms", UNIT_TIME, 1e3, 0}},
        {"msec", {"ms", UNIT_TIME, 1e3, 0}},
        {"millisecond", {"ms", UNIT_TIME, 1e3, 0}},
        {"milliseconds", {"ms", UNIT_TIME, 1e3, 0}},
        {"us", {"us", UNIT_TIME, 1e6, 0}},
        {"usec", {"us", UNIT_TIME, 1e6, 0}},
        {"microsecond", {"us", UNIT_TIME, 1e6, 0}},
        {"microseconds", {"us", UNIT_TIME, 1e6, 0}},
        {"ns", {"ns", UNIT_TIME, 1e9, 0}},
        {"nsec", {"ns", UNIT_TIME, 1e9, 0}},
        {"nanoseconds", {"ns", UNIT_TIME, 1e9, 0}},
        {"clock", {"clock", UNIT_TIME, 1, 0}},
        {"min", {"min", UNIT_TIME, 1 / 60.0, 0}},
        {"minute", {"min", UNIT_TIME, 1 / 60.0, 0}},
        {"minutes", {"min", UNIT_TIME, 1 / 60.0, 0}},
        {"h", {"h", UNIT_TIME, 1 / 3600.0, 0}},
        {"hr", {"h", UNIT_TIME, 1 / 3600.0, 0}},
        {"hrs", {"h", UNIT_TIME, 1 / 3600.0, 0}},
        {"hour", {"h", UNIT_TIME, 1 / 3600.0, 0}},
        {"hours", {"h", UNIT_TIME, 1 / 3600.0, 0}},
        {"g", {"g", UNIT_ACCELERATION, 1, 0}},
        {"gs", {"g", UNIT_ACCELERATION, 1, 0}},
        {"gn", {"g", UNIT_ACCELERATION, 1, 0}},
        {"g_n", {"g", UNIT_ACCELERATION, 1, 0}},
        {"gee", {"g", UNIT_ACCELERATION, 1, 0}},
        {"gees", {"g", UNIT_ACCELERATION, 1, 0}},
        {"gpk", {"g", UNIT_ACCELERATION, 1, 0}},
        {"mg", {"mg", UNIT_ACCELERATION, 1e3, 0}},
        {"mgn", {"mg", UNIT_ACCELERATION, 1e3, 0}},
        {"ug", {"ug", UNIT_ACCELERATION, 1e6, 0}},
        {"kg", {"kilo-g", UNIT_ACCELERATION, 1e-3, 0}},
        {"kilo-g", {"kilo-g", UNIT_ACCELERATION, 1e-3, 0}},
        {"kgn", {"kilo-g", UNIT_ACCELERATION, 1e-3, 0}},
        {"m/s2", {"m/s2", UNIT_ACCELERATION, G, 0}},
        {"ms-2", {"m/s2", UNIT_ACCELERATION, G, 0}},
        {"mps2", {"m/s2", UNIT_ACCELERATION, G, 0}},
        {"mm/s2", {"mm/s2", UNIT_ACCELERATION, G * 1e3, 0}},
        {"cm/s2", {"cm/s2", UNIT_ACCELERATION, G * 1e2, 0}},
        {"gal", {"cm/s2", UNIT_ACCELERATION, G * 1e2, 0}},
        {"ft/s2", {"ft/s2", UNIT_ACCELERATION, G / 0.3048, 0}},
        {"in/s2", {"in/s2", UNIT_ACCELERATION, G / 0.0254, 0}},
        {"v", {"V", UNIT_OTHER, 0, 1}},
        {"volt", {"V", UNIT_OTHER, 0, 1}},
        {"volts", {"V", UNIT_OTHER, 0, 1}},
        {"mv", {"mV", UNIT_OTHER, 0, 1e-3}},
        {"uv", {"uV", UNIT_OTHER, 0, 1e-6}},
        {"ma", {"mA", UNIT_OTHER, 0, 0}},
        {"pc", {"pC", UNIT_OTHER, 0, 1e-12}},
        {"newton", {"N", UNIT_OTHER, 0, 0}},
        {"kn", {"kN", UNIT_OTHER, 0, 0}},
        {"lbf", {"lbf", UNIT_OTHER, 0, 0}},
        {"pa", {"Pa", UNIT_OTHER, 0, 0}},
        {"kpa", {"kPa", UNIT_OTHER, 0, 0}},
        {"mpa", {"MPa", UNIT_OTHER, 0, 0}},
        {"psi", {"psi", UNIT_OTHER, 0, 0}},
        {"hz", {"Hz", UNIT_OTHER, 0, 0}},
        {"khz", {"kHz", UNIT_OTHER, 0, 0}},
        {"mhz", {"MHz", UNIT_OTHER, 0, 0}},
        {"hertz", {"Hz", UNIT_OTHER, 0, 0}},
        {"1/s", {"Hz", UNIT_OTHER, 0, 0}},
        {"s/s", {"Hz", UNIT_OTHER, 0, 0}}, /* samples in a second */
        {"sa/s", {"Hz", UNIT_OTHER, 0, 0}},
        {"samples/s", {"Hz", UNIT_OTHER, 0, 0}},
        {"sps", {"Hz", UNIT_OTHER, 0, 0}},
        {"deg", {"deg", UNIT_OTHER, 0, 0}},
        {"rad", {"rad", UNIT_OTHER, 0, 0}},
        {"deg/s", {"deg/s", UNIT_OTHER, 0, 0}},
        {"rad/s", {"rad/s", UNIT_OTHER, 0, 0}},
        {"mm", {"mm", UNIT_OTHER, 0, 0}},
        {"um", {"um", UNIT_OTHER, 0, 0}},
        {"m/s", {"m/s", UNIT_OTHER, 0, 0}},
        {"mm/s", {"mm/s", UNIT_OTHER, 0, 0}},
        {"ft/s", {"ft/s", UNIT_OTHER, 0, 0}},
        {"in/s", {"in/s", UNIT_OTHER, 0, 0}},
        {"km/h", {"km/h", UNIT_OTHER, 0, 0}},
        {"strain", {"strain", UNIT_OTHER, 0, 0}},
        {"ustrain", {"ustrain", UNIT_OTHER, 0, 0}},
        {"degc", {"degC", UNIT_OTHER, 0, 0}},
        {"lsb", {"LSB", UNIT_OTHER, 0, 0}},
        {"count", {"counts", UNIT_OTHER, 0, 0}},
        {"counts", {"counts", UNIT_OTHER, 0, 0}},
};

/* The bytes that stand for one plain character, which *as is then; 0 for one that stands for itself. */
static size_t sign_at(const char *text, size_t length, char *as)
{
	static const struct {
		const char *bytes;
		char as;
	} signs[] = {{"\302\265", 'u'},
	             {"\316\274", 'u'},
	             {"\302\262", '2'},
	             {"\302\267", ' '},
	             {"\342\201\273", '-'}};

	for (size_t i = 0; i < sizeof(signs) / sizeof(signs[0]); i++) {
		const size_t bytes = strlen(signs[i].bytes);

		if (length >= bytes && memcmp(text, signs[i].bytes, bytes) == 0) {
			*as = signs[i].as;
			return bytes;
		}
	}
	/* the same signs in one byte, as files without UTF-8 have them */
	if (*text == '\262' || *text == '\265') {
		*as = *text == '\262' ? '2' : 'u';
		return 1;
	}
	*as = *text >= 'A' && *text <= 'Z' ? (char)(*text - 'A' + 'a') : *text;
	return 1;
}

/* Its other spellings to "/s2": m/(s*s), ft/s/s, in/sec2. */
static void per_second_squared(char *plain, size_t used)
{
	static const char *const endings[] = {"/ss", "/s/s", "/sec2", "/secsec", "/sec/sec"};

	for (size_t i = 0; i < sizeof(endings) / sizeof(endings[0]); i++) {
		size_t length = strlen(endings[i]);

		if (used > length && strcmp(plain + used - length, endings[i]) == 0) {
			memcpy(plain + used - length, "/s2", sizeof("/s2"));
			return;
		}
	}
}

const struct unit *unit_find(const char *text, size_t length)
{
	char plain[CHARS_MAX + 1];
	size_t used = 0;

	for (size_t at = 0; at < length;) {
		char c;

		at += sign_at(text + at, length - at, &c);
		if (c == '\0' || strchr(" \t^*()[]'", c))
			continue;
		if (used == CHARS_MAX)
			return NULL;
		plain[used++] = c;
	}
	plain[used] = '\0';
	per_second_squared(plain, used);
	for (size_t i = 0; i < sizeof(table) / sizeof(table[0]); i++)
		if (strcmp(table[i].spelling, plain) == 0)
			return &table[i].unit;
	return NULL;
}

static const struct unit multiple = {"a multiple of a unit", UNIT_MULTIPLE, 0, 0};

const struct unit *unit_in_bracket(const char *text, size_t length)
{
	const struct unit *unit = unit_find(text, length);
	bool number = false;

	for (; length > 0 && !unit_find(text, length); text++, length--) {
		if (!isdigit((unsigned char)*text) && !strchr(" \t([+-.,*^eEx", *text))
			return NULL;
		number |= isdigit((unsigned char)*text) != 0;
	}
	return unit ? unit : number && length > 0 ? &multiple : NULL;
}

double unit_seconds(const char *text)
{
	const struct unit *unit = unit_in_bracket(text, strlen(text));

	if (unit == NULL)
		return 1;
	return unit->kind == UNIT_TIME ? 1 / unit->divisor : 0;
}

/* The last bracket of that kind that holds a unit. */
static const struct unit *in_brackets(const char *name, size_t length, char open, char close)
{
	const struct unit *found = NULL;

	for (size_t from = 0; from < length; from++) {
		size_t to = from + 1, deep = 1;

		if (name[from] != open)
			continue;
		for (; to < length; to++) {
			deep += name[to] == open;
			deep -= name[to] == close;
			if (deep == 0)
				break;
		}
		if (to < length) {
			const struct unit *unit = unit_in_bracket(name + from + 1, to - from - 1);

			found = unit ? unit : found;
			from = to;
		}
	}
	return found;
}

/* Past the bracket that opens there, if it holds a unit; else the same. */
static size_t past_unit(const char *name, size_t from, size_t length)
{
	char close = name[from] == '[' ? ']' : name[from] == '(' ? ')' : '\0';
	const char *end = close ? memchr(name + from, close, length - from) : NULL;

	return end && unit_find(name + from, (size_t)(end - name) - from) ? (size_t)(end - name) + 1 : from;
}

/* "Acc*10 [g]"; behind the unit, where it is no axis or place, also "[g] x100", "[g] (x 2)" and "[s]/10". */
static bool has_factor(const char *name, size_t length)
{
	bool behind = false;

	for (size_t i = 0; i < length; i++) {
		size_t past = past_unit(name, i, length), next = i + 1;
		bool word = i > 0 && isalnum((unsigned char)name[i - 1]);
		bool factor = name[i] == '*' || (behind && (name[i] == '/' || (name[i] == 'x' && !word)));

		if (past > i) {
			behind = true;
			i = past - 1;
			continue;
		}
		if (length - i >= 2 && memcmp(name + i, "\303\227", 2) == 0) { /* a multiplication sign */
			factor = true;
			next++;
		}
		while (next < length && name[next] == ' ')
			next++;
		if (factor && next < length && isdigit((unsigned char)name[next]))
			return true;
	}
	return false;
}

/* Whether the word from there on ends a bracket that says more of it: "[dB re 1 g]", "(rms of 8, g)". */
static bool is_of_other(const char *name, size_t from, size_t length)
{
	bool other = false;

	if (memchr(name + from, ']', length - from) == NULL &&
	    memchr(name + from, ')', length - from) == NULL)
		return false;
	while (from > 0 && name[from - 1] != '[' && name[from - 1] != '(') {
		from--;
		other |= isdigit((unsigned char)name[from]) != 0 || strncasecmp(name + from, "db", 2) == 0;
	}
	return other && from > 0;
}

const struct unit *unit_of_name(const char *name, size_t length, enum unit_kind wanted)
{
	const struct unit *unit = in_brackets(name, length, '[', ']');
	size_t from = length;

	if (!unit)
		unit = in_brackets(name, length, '(', ')');
	if (unit)
		return has_factor(name, length) ? &multiple : unit;
	while (from > 0 && !strchr(" \t,_", name[from - 1]))
		from--;
	if (is_of_other(name, from, length))
		return NULL;
	unit = unit_find(name + from, length - from);
	return unit && unit->kind == wanted ? unit : NULL;
}

bool unit_same(const struct unit *a, const struct unit *b)
{
	return a->kind == b->kind && fabs(a->divisor - b->divisor) <= 1e-9 * fabs(a->divisor);
}

double unit_hertz(const struct unit *unit)
{
	return strcmp(unit->name, "Hz") == 0    ? 1
	       : strcmp(unit->name, "kHz") == 0 ? 1e3
	       : strcmp(unit->name, "MHz") == 0 ? 1e6
	                                        : 0;
}
