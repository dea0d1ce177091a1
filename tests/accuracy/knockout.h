/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_ACCURACY_KNOCKOUT_H
#define DT_TESTS_ACCURACY_KNOCKOUT_H
/*
 * The mechanisms of host/estimate that can be switched off, and the switch. The linker leads every call of
 * such a function from another file here (--wrap, knockout.mk): the product is built without any of it.
 */
#include <stddef.h>

struct knockout {
	const char *name;
	const char *lines; /* "a.c a.h b.c:function": of host/estimate, what it is written in */
};

extern const struct knockout knockouts[];
extern const size_t knockout_count;

/* The one that is off; NULL: none. */
extern const struct knockout *knocked_out;

#endif
