/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_REPORT_DESIGN_H
#define DT_HOST_REPORT_DESIGN_H
/*
 * Which values of some keys of a scene keep limits on what a drop does: a grid over the keys, logarithmic,
 * and three finer ones about the best; the designs that no other one is better than in everything limited;
 * how often each keeps its limits when what [fit] leaves open of the scene is drawn at random.
 *
 * The best is the one with the largest margin: the quantity that is nearest to its limit, or furthest above
 * it, decides.
 */
#include <stdio.h>

#include "host/base/table.h"
#include "host/model/ensemble.h"

enum { DESIGN_KEYS_MAX = 3, DESIGN_LIMITS_MAX = 4, DESIGN_DRAWS = 400 };

struct design_limit {
	struct ensemble_output quantity;
	double value; /* of its magnitude, above 0 */
};

/* The ensemble's axes are the keys: count is set here, from and to are the range's ends. */
struct design {
	struct ensemble ensemble;
	struct design_limit limit[DESIGN_LIMITS_MAX];
	size_t limits;
};

/* One that can be limited, of the ensemble's outputs or travel and dent. DT_E_UNKNOWN. */
DT_MUST_USE int design_quantity(const char *name, struct ensemble_output *quantity);

/* Adds an axis: from a quarter to four times the scene's value, within what the key may be. DT_E_RANGE: too
 * many; DT_E_ARGUMENT: that value is 0 or below; DT_E_STATE: it is an axis. */
DT_MUST_USE int design_add_key(struct design *design, const struct vary_key *key);

/* Writes the table. 0; DT_E_EMPTY: no design makes a drop that tells what is limited; DT_E_MEMORY. */
DT_MUST_USE int design_write(struct design *design, enum table_format format, FILE *out);

#endif
