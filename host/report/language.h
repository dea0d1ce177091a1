/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_REPORT_LANGUAGE_H
#define DT_HOST_REPORT_LANGUAGE_H
/*
 * A finished page in another language. The page is written in English; its texts between tags, the labels of
 * its pictures and the strings of its style are looked up in a table (german.def), and numbers get the
 * language's decimal sign. So a number can only be the same in both, and a text without an entry is known and
 * named.
 *
 * What the user wrote stands between HTML_OWN and HTML_OWN_END (host/base/html.h) and is left as it is; both
 * marks are taken out, of an English page, too.
 */
#include <stddef.h>
#include <stdio.h>

#include "common/error.h"

/* An English text and its counterpart. In both, "#" is a number and "{}" is a part that has an entry of its
 * own, in the same order. The first entry that fits is taken. */
struct language_text {
	const char *english, *other;
};

struct language {
	const char *code; /* as BCP 47 has it */
	char decimal;
	const char *style; /* behind the page's own, for longer words */
	const struct language_text *text;
	size_t count;
};

/* By its code, "en" or "de"; NULL: there is none. */
const struct language *language_find(const char *code);

/* A language, and who is told of a text that has no entry and stays English; tell may be NULL. */
struct translation {
	const struct language *language; /* NULL: English */
	void (*tell)(void *context, const char *text);
	void *context;
};

/* Writes the page of so many bytes to out; translation NULL: English. 0 or DT_E_MEMORY. */
DT_MUST_USE int language_write(const struct translation *translation, const char *page, size_t size,
                               FILE *out);

#endif
