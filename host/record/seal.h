/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_SEAL_H
#define DT_HOST_RECORD_SEAL_H
/*
 * A file of ours says its own SHA-256: SEAL_WORD and 64 digits somewhere in it, computed with 64 times '0' in
 * their place. Where a format has room for such a text is its writer's business.
 */
#include "host/record/source.h"

#define SEAL_WORD "sha256 "
#define SEAL_BLANK SEAL_WORD "0000000000000000000000000000000000000000000000000000000000000000"

/* Puts the digits into the last SEAL_BLANK. DT_E_FORMAT: there is none. */
DT_MUST_USE int seal_fill(char *bytes, size_t size);

/* 1 when the file is what was sealed; 0 when it has no seal, or several as files have that were put one
 * behind the other; DT_E_CORRUPT with "FILE: altered: ..." in message. */
DT_MUST_USE int seal_check(const struct source *source, char message[READ_MESSAGE_MAX]);

#endif
