/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_COMMON_PLAIN_H
#define DT_COMMON_PLAIN_H
/*
 * Whether a text may stand in a name, a note or a title: on a terminal, a page and in a file it must read as
 * what it is. Pure functions, any context.
 */
#include <stdbool.h>
#include <stddef.h>

/* The length bytes are UTF-8 (RFC 3629: shortest forms, no surrogates). */
bool plain_is_utf8(const char *text, size_t length);

/* They are one line of it: without control characters (C0, DEL, C1), line and paragraph separators, and
 * what turns the direction of writing round (U+202A to U+202E, U+2066 to U+2069) or is not seen (U+FEFF). */
bool plain_is_line(const char *text, size_t length);

#endif
