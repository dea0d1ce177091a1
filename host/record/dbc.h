/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_DBC_H
#define DT_HOST_RECORD_DBC_H
/*
 * wire.def as a DBC file, so that other CAN tools decode our frames. One signal per field; arrays give
 * one signal per element (x0 ... x6).
 */
#include <stdio.h>

#include "common/error.h"

/* 0 or DT_E_SYSTEM if out did not take it all. */
DT_MUST_USE int dbc_write(FILE *out);

#endif
