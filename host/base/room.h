/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_BASE_ROOM_H
#define DT_HOST_BASE_ROOM_H
/*
 * Room on the disk for a drop: `run` and the console look before they arm.
 */

/* A drop is under 1 MB; an archive on a full disk cannot even be tidied. */
enum { ROOM_RESERVE_BYTES = 16000000 };

/* Bytes free for us where folder is; NAN when it cannot be told. Any thread. */
double room_bytes(const char *folder);

#endif
