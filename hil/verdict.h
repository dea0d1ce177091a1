/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HIL_VERDICT_H
#define DT_HIL_VERDICT_H
/*
 * Compares what a run did with what its scenario expects, and prints both.
 */
#include <stdbool.h>
#include <stdio.h>

#include "hil/monitor.h"
#include "hil/scenario.h"

/* One line for each expectation, "  ok" or "  FAIL", its name, what was measured, what was expected.
 * Returns how many failed; the names of the first of them, with a space between, are in failed. */
unsigned verdict_print(const struct scenario *scenario, const struct monitor *monitor,
                       const double results[SCENARIO_RESULTS], FILE *out, char *failed, size_t size);

#endif
