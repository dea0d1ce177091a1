/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HIL_STUDY_HOLDOUT_H
#define DT_HIL_STUDY_HOLDOUT_H
/*
 * The planar model held against what it was not fitted to: its numbers fitted again to the study's printed
 * means without one angle or without one box, and what is left out predicted; and what each refinement is
 * worth. No drop of the simulated tower, whose equations are the model's, is in it.
 *
 * Residuals are over the reading's error: a mean's SD/sqrt(5) and 3 % of its resultant, which no model of the
 * ladder beats; the features' are judged.
 */
#include <stdbool.h>

#include "hil/study/sheet.h"
#include "hil/study/study.h"

/* Tells it; whether every refinement pays and what is left out is predicted within its limits. */
bool holdout_tell(const struct study *study, struct sheet *sheet);

#endif
