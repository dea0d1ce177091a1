/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_FIT_JUDGE_H
#define DT_HOST_FIT_JUDGE_H
/* What a fit does not explain, and which drop would tell most. Used within host/fit. */
#include "host/fit/solve.h"

/* What the drops leave, given what came out of each. Fills doubt with its chi2 and samples. 0 or DT_E_MEMORY.
 */
DT_MUST_USE int judge(struct solve *s, const struct fit_drop_result *drop, double widened,
                      struct fit_doubt *doubt);

/* Fills next. */
void judge_next(struct solve *s, struct fit *fit);

#endif
