/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ARCHIVE_PHOTO_H
#define DT_HOST_ARCHIVE_PHOTO_H
/*
 * Photos of a drop: files in the folder of its series, and an event of the drop for each,
 *
 *     photo   before raw/2026/box/0003.before-1.jpg 381224 SHA-256
 *
 * so that the drop's sidecar, and through it the chain, stands for every byte. One before a drop that is not
 * there yet waits: its file has the number that the drop will have, and the event comes when that is
 * recorded.
 */
#include "host/archive/chain.h"

struct photo {
	bool after;
	char file[ARCHIVE_PHOTO_FILE_MAX]; /* in the archive's folder */
	int64_t bytes;
	char hash[DIGEST_CHARS];
};

/* What an event says; false: of a photo it says nothing that can be used. */
bool photo_parse(const char *text, struct photo *photo);

/* Within the transaction that records the drop: those that wait for it are of it. */
DT_MUST_USE int photo_bind(struct archive *archive, const struct archive_recording *r);

#endif
