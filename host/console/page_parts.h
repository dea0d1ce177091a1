/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CONSOLE_PAGE_PARTS_H
#define DT_HOST_CONSOLE_PAGE_PARTS_H
/*
 * The page and what it needs, in the program: `embed` makes the table from page/ and from npm's uPlot.
 */
#include <stddef.h>

struct page_part {
	const char *name; /* "index.html" is also "/" */
	const char *type;
	const unsigned char *bytes;
	size_t size;
};

extern const struct page_part page_parts[];
extern const size_t page_part_count;

#endif
