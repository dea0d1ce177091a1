/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_MME_H
#define DT_HOST_RECORD_MME_H
/*
 * A test of ISO/TS 13499 is more than its file.
 */
#include <dirent.h>
#include <limits.h>
#include <stdbool.h>

#include "host/record/read.h"

/* Whether the file is one by its name. */
bool mme_is_test(const char *file);

/* The folder of its channels and their files in order, to be freed one by one as scandir(3) has it when there
 * are some; how many, -1 where there is no folder. */
int mme_channels(const char *file, char folder[PATH_MAX], struct dirent ***entry);

/* A record as one: file is NAME.mme; its channels go into the folder Channel beside it, which has to be new
 * or without any. DT_E_ARGUMENT for samples that are lost or bad. */
DT_MUST_USE int write_mme(const struct record *record, const char *file, char message[READ_MESSAGE_MAX]);

#endif
