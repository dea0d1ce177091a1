/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_MODEL_AUTO_H
#define DT_HOST_MODEL_AUTO_H
/*
 * The least rung for a question: sdof, coupled (with the scene's stiffness and the wedge) or planar with all
 * refinements, whichever comes first with a predicted difference from planar below what is asked.
 *
 * The prediction is a function of a few numbers of the scene: in closed form what a rigid corner that holds
 * or slips does to size and direction of the shock, a linear rest in those numbers, and a doubt. Coefficients
 * and doubts were fitted once to planar over 24 000 random drops (README.md tells which), so that the
 * difference stays below the predicted one in nine of ten of them; it holds within the limits of that sample,
 * and outside them planar is taken. Lags are never predicted. sdof is held against coupled besides, which
 * costs little.
 *
 * Pure functions, any thread; no memory kept.
 */
#include "host/model/drop.h"
#include "host/model/model.h"

/* What planar would say otherwise, as a share of it: of the worst of the questions asked (MODEL_ASK_*; 0: all
 * of them). INFINITY where nothing is known. rung: MODEL_SDOF or MODEL_COUPLED. */
double auto_difference(const struct drop *drop, enum model_fidelity rung, unsigned asked);

/* The largest difference between two predictions, as a share of `to`, of what is asked. */
double auto_apart(const struct model_prediction *prediction, const struct model_prediction *to,
                  unsigned asked);

/* model_solve's MODEL_AUTO. 0 or DT_E_* with message, prediction unchanged. */
DT_MUST_USE int auto_solve(const struct drop *drop, const struct model_options *options,
                           struct model_prediction *prediction, char message[MODEL_MESSAGE_MAX]);

#endif
