/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_FIT_FIT_PRIVATE_H
#define DT_HOST_FIT_FIT_PRIVATE_H
/* What the fit of several drops and that of a later one share. Used within host/fit. */
#include "host/fit/solve.h"

/* The parameters of a scene, and weak priors about them. */
void fit_start_common(const struct scene *scene, const struct fit_options *o, struct solve *s);

/* A drop's onset: of the model that reaches a quarter of S2X's peak when the record does. */
void fit_align(struct solve *s, struct solve_drop *d);

/* What came out of a drop; after solve_histories with slopes. */
void fit_conclude_drop(const struct solve *s, const struct solve_drop *d, struct fit_drop_result *r);

#endif
