/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_FIT_FIT_PRIVATE_H
#define DT_HOST_FIT_FIT_PRIVATE_H
/* What the parts of a fit share. */
#include "host/fit/solve.h"

/* ---- fit.c ---- */

/* The parameters of a scene, and weak priors about them. */
void fit_start_common(const struct scene *scene, const struct fit_options *o, struct solve *s);

/* A drop's onset: of the model that reaches a quarter of S2X's peak when the record does. */
void fit_align(struct solve *s, struct solve_drop *d);

/* What came out of a drop; after solve_histories with slopes. */
void fit_conclude_drop(const struct solve *s, const struct solve_drop *d, struct fit_drop_result *r);

/* ---- prepare.c: drops as given to drops as solve.h wants them ---- */

#define PREPARE_BEFORE_S 5e-3
#define PREPARE_AFTER_S 36e-3

/* 0, or DT_E_* with why it cannot be used in message. Frees with prepare_free. */
DT_MUST_USE int prepare_drop(const struct scene *scene, const struct fit_drop *in,
                             const struct fit_options *options, struct solve_drop *d,
                             char message[FIT_MESSAGE_MAX]);
void prepare_free(struct solve_drop *d);

/* ---- judge.c: what a fit does not explain, and which drop would tell most ---- */

/* What the drops leave, given what came out of each. Fills doubt with its chi2 and samples. 0 or DT_E_MEMORY.
 */
DT_MUST_USE int judge(struct solve *s, const struct fit_drop_result *drop, double widened,
                      struct fit_doubt *doubt);

/* Fills next. */
void judge_next(struct solve *s, struct fit *fit);

#endif
