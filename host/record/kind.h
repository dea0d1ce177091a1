/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_KIND_H
#define DT_HOST_RECORD_KIND_H
/*
 * Files that are known by their first bytes and not read here: each is refused by its name and with what
 * helps.
 */
#include "host/record/source.h"

/* 0, or DT_E_UNKNOWN with a message. */
DT_MUST_USE int kind_refuse(const struct source *source, char message[READ_MESSAGE_MAX]);

#endif
