/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_BASE_DURABLE_H
#define DT_HOST_BASE_DURABLE_H
/*
 * Files that stay: on success they are on the disk, and so are the folders that name them. 0 or DT_E_SYSTEM
 * with errno set, DT_E_MEMORY.
 */
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"

/* Makes the folders of path, up to its last slash. */
DT_MUST_USE int durable_folders(const char *path);

/* Replaces path by these bytes, of which there must be some: the old ones or the new ones are there at any
 * moment. In two steps: the new ones are on the disk as PATH.part, then they take their place. */
DT_MUST_USE int durable_write(const char *path, const void *bytes, size_t size);
DT_MUST_USE int durable_stage(const char *path, const void *bytes, size_t size);
DT_MUST_USE int durable_publish(const char *path);

/* Renames a file that is on the disk; the folder that holds `to` is, too, behind it. */
DT_MUST_USE int durable_replace(const char *from, const char *to);

/* Writes bytes into path from byte `at` on, and nothing is behind them; path is made when it is not there. */
DT_MUST_USE int durable_append(const char *path, int64_t at, const void *bytes, size_t size);

/* Somebody else wrote path: file and folder to the disk. */
DT_MUST_USE int durable_sync(const char *path);

/* The folder that holds path to the disk. */
DT_MUST_USE int durable_sync_folder(const char *path);

/* The whole file with a NUL behind, to be freed; NULL with errno set. size may be NULL. */
char *durable_read(const char *path, size_t *size);

#endif
