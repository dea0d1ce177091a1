/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_REPORT_PICTURE_H
#define DT_HOST_REPORT_PICTURE_H
/*
 * Runs gnuplot: script in, SVG text out. The script stands in memory with its data inline ($name << EOD),
 * sets the svg terminal itself and sets no output. No shell and no start-up file of the user's is involved,
 * but a script can run commands: text that is not ours must never become part of one.
 *
 * *svg is a complete document, malloc'ed, freed by the caller. 0; DT_E_SYSTEM when gnuplot is missing or
 * fails, with a line in message; DT_E_MEMORY.
 */
#include <stddef.h>

#include "common/error.h"

DT_MUST_USE int picture_draw(const char *script, size_t length, char **svg, char *message, size_t size);

#endif
