/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_HDF5_FOREIGN_H
#define DT_HOST_HDF5_FOREIGN_H
/*
 * What an HDF5 file of others holds, as a tree (host/record/tree.h) on standard output.
 */
#include <hdf5.h>

#include "common/error.h"

/* 0, or -1 with a line on standard error. */
DT_MUST_USE int foreign_put(hid_t file);

#endif
