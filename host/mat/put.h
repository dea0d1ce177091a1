/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_MAT_PUT_H
#define DT_HOST_MAT_PUT_H
/*
 * A record as a MAT file of version 5 on standard output: a struct for each channel, with its name, units,
 * rate_hz, start_s and data, which is not a number where there is no sample; of a drop the struct "drop" with
 * its numbers under the names of our CSV. 0, or -1 with one line on standard error.
 */
#include "host/record/record.h"

int put_record(const struct record *record);

#endif
