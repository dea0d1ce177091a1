/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RESULT_VERDICT_PRIVATE_H
#define DT_HOST_RESULT_VERDICT_PRIVATE_H
/*
 * A drop while it is judged: what verdict.c, its values, and verdict_curves.c, its pulse and its spectrum,
 * share.
 */
#include "host/result/verdict.h"

struct judging {
	const struct plan *plan;
	struct result *result;
	size_t channel; /* the plan's; channel_count: there is none */
	struct verdict *verdict;
};

/* One more reason why the item is undecided. */
void verdict_because(struct verdict_item *item, const char *what, const char *word);

/* What the value's flags, and those of the channel and the drop, keep from being decided. */
void verdict_flags(const struct judging *j, struct verdict_item *item, const char *subject, unsigned flags);

/* The decision, unless a reason keeps it undecided. */
void verdict_settle(struct verdict_item *item, enum decision decision);

struct verdict_item *verdict_new(struct judging *j, const char *subject, const char *what);

/* Share of a value that all samples of the plan's channel have in common. */
double verdict_chain(const struct judging *j);

/* The pulse of the plan's channel in the preset's band, and its spectrum between the plan's curves. 0 or
 * DT_E_MEMORY. */
DT_MUST_USE int verdict_band(struct judging *j);
DT_MUST_USE int verdict_spectrum(struct judging *j);

#endif
