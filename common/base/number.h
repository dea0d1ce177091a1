/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_COMMON_BASE_NUMBER_H
#define DT_COMMON_BASE_NUMBER_H
/*
 * Numbers in text: all of it is the number, or it is none, and *value stays as it was. Any context, no state;
 * the C locale is taken for granted.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
	NUMBER_CHARS = 25,       /* "-1.2345678901234567e-308" */
	NUMBER_SCAN_DIGITS = 19, /* that a uint64_t holds whatever they are */
};

/* A number in [min, max], as strtod(3) has it; an infinity only where a limit is one. */
bool number_read(const char *text, double min, double max, double *value);

/* A whole number in [min, max]: decimal digits only. */
bool number_whole(const char *text, uint64_t min, uint64_t max, uint64_t *value);

/* Reads text of length characters as one finite decimal number; decimal is '.' or ','. No blanks, no
 * hexadecimal, no words. */
bool number_parse(const char *text, size_t length, char decimal, double *value);

/* A number as it is written. */
struct number_scan {
	double value;
	uint64_t digits; /* without sign, decimal sign and the zeros before them */
	int exponent;    /* the power of ten that the last one counts */
};

/* The characters of the number that a text begins with; 0, and *number undefined, where there is none or it
 * is an unusual one, of more than 19 digits or of such powers of ten that only number_parse tells it. */
size_t number_scan(const char *text, const char *end, char decimal, struct number_scan *number);

/* Writes a finite value with the fewest digits, `least` (15 for all that a file should keep) or more, that
 * read back equal. */
void number_format(char text[NUMBER_CHARS], double value, int least);

#endif
