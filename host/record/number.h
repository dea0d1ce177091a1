/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_NUMBER_H
#define DT_HOST_RECORD_NUMBER_H
/*
 * Numbers in text files. Any context, no state; the C locale is taken for granted.
 */
#include <stdbool.h>
#include <stddef.h>

enum { NUMBER_CHARS = 25 }; /* "-1.2345678901234567e-308" */

/* Reads text of length characters, all of it, as one finite decimal number; decimal is '.' or ','. No
 * blanks, no hexadecimal, no words: false, and *value unchanged. */
bool number_parse(const char *text, size_t length, char decimal, double *value);

/* Writes a finite value with the fewest digits, 15 at least, that read back equal. */
void number_format(char text[NUMBER_CHARS], double value);

#endif
