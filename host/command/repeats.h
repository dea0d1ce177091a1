/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_COMMAND_REPEATS_H
#define DT_HOST_COMMAND_REPEATS_H
/*
 * What repeats of one thing have in common and how it moves: a table on standard output, or one JSON object.
 */
#include "host/result/repeats.h"

/* Of closed repeats. 0, DT_E_SYSTEM or DT_E_MEMORY. */
DT_MUST_USE int repeats_print(const struct repeats *repeats, bool json);

#endif
