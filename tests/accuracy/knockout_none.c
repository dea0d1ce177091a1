/* SPDX-License-Identifier: GPL-3.0-or-later */
/* No mechanism to switch off: knockout.c for tests/accuracy/thresholds, which changes numbers instead. */
#include "tests/accuracy/knockout.h"

const struct knockout knockouts[1] = {{"", ""}};
const size_t knockout_count = 0;
const struct knockout *knocked_out;
