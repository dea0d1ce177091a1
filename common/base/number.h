/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_COMMON_BASE_NUMBER_H
#define DT_COMMON_BASE_NUMBER_H
/*
 * A whole text as a number. What stands behind it, an infinity and a NaN are refused.
 */
#include <stdbool.h>
#include <stdint.h>

/* A finite number in [min, max]. */
bool number_read(const char *text, double min, double max, double *value);

/* A whole number in [min, max]: decimal digits only. */
bool number_whole(const char *text, uint64_t min, uint64_t max, uint64_t *value);

#endif
