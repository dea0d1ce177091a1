/* SPDX-License-Identifier: GPL-2.0-or-later */
#ifndef DT_COMMON_ERROR_H
#define DT_COMMON_ERROR_H
/*
 * Error codes: 0 is success, DT_E_* are negative, a positive result is a count. Outputs are unchanged
 * when an error is returned. The codes and their texts stand in error.def.
 */

enum {
#define DT_ERROR(NAME, value, text) DT_E_##NAME = (value),
#include "common/error.def"
#undef DT_ERROR
};

#if defined(__GNUC__)
#define DT_MUST_USE __attribute__((warn_unused_result))
#else
#define DT_MUST_USE
#endif

/* The text of a code, for people; "unknown error" for a number that is none. Any context. */
const char *error_text(int code);

#endif
