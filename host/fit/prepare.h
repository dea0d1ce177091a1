/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_FIT_PREPARE_H
#define DT_HOST_FIT_PREPARE_H
/* Drops as given to drops as solve.h wants them. Used within host/fit. */
#include "host/fit/solve.h"

#define PREPARE_BEFORE_S 5e-3
#define PREPARE_AFTER_S 36e-3

/* 0, or DT_E_* with why it cannot be used in message. Frees with prepare_free. */
DT_MUST_USE int prepare_drop(const struct scene *scene, const struct fit_drop *in,
                             const struct fit_options *options, struct solve_drop *d,
                             char message[FIT_MESSAGE_MAX]);
void prepare_free(struct solve_drop *d);

#endif
