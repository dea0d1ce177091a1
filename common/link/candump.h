/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_COMMON_LINK_CANDUMP_H
#define DT_COMMON_LINK_CANDUMP_H
/*
 * One line of candump -L text to a frame and back:
 *
 *     (1436509052.249713) vcan0 044#2A366C2BBA
 *     (1436509052.449847) can0 181##1<128 hex digits>
 *
 * ID of 3 hex digits: 11 bits; 8 digits: 29 bits, or an error frame when bit 0x20000000 is set. '#'
 * classic, '##' FD with one flag digit (bit 0 BRS, bit 1 ESI, bit 2 FDF, ignored), '#R' or '#Rn' remote.
 * 0 to 9 decimals of time are read, a trailing ' R' or ' T' is ignored. (can-utils, candump.c, lib.h)
 * Any context; no state.
 */
#include <stddef.h>
#include <stdbool.h>

#include "common/error.h"
#include "common/frame.h"

/* Long enough for the longest line, its newline and its NUL. */
#define CANDUMP_LINE_MAX 256

/* Reads a line of length bytes (no newline needed). 1 = a frame, 0 = a line to skip (does not start with
 * '(', or is blank), DT_E_FORMAT with *column (from 1) where it stopped making sense; *frame unchanged. */
DT_MUST_USE int candump_parse(const char *line, size_t length, struct frame *frame, unsigned *column);

/* Writes the line with its newline and a NUL; returns its length without the NUL. */
size_t candump_format(char line[CANDUMP_LINE_MAX], const struct frame *frame, const char *interface);

#endif
