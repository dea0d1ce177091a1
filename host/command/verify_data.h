/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_COMMAND_VERIFY_DATA_H
#define DT_HOST_COMMAND_VERIFY_DATA_H
/*
 * The table of drops that a report carries along, against the one that its archive gives now. Rows are told
 * apart by the column "number". A column that only one of them has is not compared, nor is "note": notes may
 * be added later.
 *
 * was, is: CSV by the same writer (host/base/table.h), ended by NUL. tell gets one line for each cell that
 * differs and each drop that is no more. Returns how many; -1 when one of them is no such table.
 */
#include "common/error.h"

DT_MUST_USE int verify_data(const char *was, const char *is, void (*tell)(void *context, const char *text),
                            void *context);

#endif
