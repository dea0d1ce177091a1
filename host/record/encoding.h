/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_ENCODING_H
#define DT_HOST_RECORD_ENCODING_H
/*
 * How the characters of a text are kept: UTF-8, UTF-16 of either order, else the one-byte characters of
 * Windows (CP1252). Readers see UTF-8.
 */
#include "host/record/source.h"

/* Turns the bytes into UTF-8; *name tells what they were, "utf-8", "utf-16le", "utf-16be" or "cp1252". A file
 * with other zero bytes is no text: refused. Nothing is freed on an error. */
DT_MUST_USE int encoding_settle(struct source *source, const char **name, char message[READ_MESSAGE_MAX]);

#endif
