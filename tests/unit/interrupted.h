/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_UNIT_INTERRUPTED_H
#define DT_TESTS_UNIT_INTERRUPTED_H
/*
 * Waiting on a link while signals come.
 */
#include "common/link/link.h"

/* Fails the test unless receiving from a silent link lasts its whole timeout, however often it is
 * interrupted. */
void interrupted_receive(struct link *link);

#endif
