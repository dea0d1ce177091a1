/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_MODEL_AUTO_H
#define DT_HOST_MODEL_AUTO_H
/*
 * The least rung for a question: sdof, coupled (with the scene's stiffness and the wedge) or planar with all
 * refinements, whichever comes first with answers that differ from planar's by no more than is asked. planar
 * is solved each time, with no more digits and no more peaks than the question needs; what its numbers may be
 * off counts as difference.
 *
 * Pure functions, any thread; no memory kept.
 */
#include "host/model/drop.h"
#include "host/model/model.h"

/* The largest difference between two predictions of what is asked, as a share of `to`; of the lag as a share
 * of lag_s, where that is above 0. */
double auto_apart(const struct model_prediction *prediction, const struct model_prediction *to,
                  unsigned asked, double lag_s);

/* model_solve's MODEL_AUTO. 0 or DT_E_* with message, prediction unchanged. */
DT_MUST_USE int auto_solve(const struct drop *drop, const struct model_options *options,
                           struct model_prediction *prediction, char message[MODEL_MESSAGE_MAX]);

#endif
