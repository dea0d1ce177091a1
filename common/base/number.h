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

enum { NUMBER_CHARS = 25 }; /* "-1.2345678901234567e-308" */

/* A number in [min, max], as strtod(3) has it; an infinity only where a limit is one. */
bool number_read(const char *text, double min, double max, double *value);

/* A whole number in [min, max]: decimal digits only. */
bool number_whole(const char *text, uint64_t min, uint64_t max, uint64_t *value);

/* Reads text of length characters as one finite decimal number; decimal is '.' or ','. No blanks, no
 * hexadecimal, no words. */
bool number_parse(const char *text, size_t length, char decimal, double *value);

/* Writes a finite value with the fewest digits, `least` (15 for all that a file should keep) or more, that
 * read back equal. */
void number_format(char text[NUMBER_CHARS], double value, int least);

#endif
