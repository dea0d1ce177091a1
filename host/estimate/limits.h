/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_LIMITS_H
#define DT_HOST_ESTIMATE_LIMITS_H
/*
 * Numbers that more than one estimator goes by. METHODS.md says what each does at half and at twice.
 */

/* In standard deviations of what is compared. Two results, or one result and zero: chance makes more once in
 * 370. A peak, a swing, an outlier or one more unknown that is there, and a residual that is refused where
 * what is tried then costs little. One sample among the thousands of a record. A statistic that is looked for
 * all over a record. */
#define LIMIT_AGREE 3.0
#define LIMIT_SIGNIFICANT 5.0
#define LIMIT_NOISE 6.0
#define LIMIT_SURE 8.0

/* Chi-square of a residual, in its standard deviations: a right model is beyond the first once in a thousand
 * fits, beyond the second hardly ever. So many times further off, or with such a chi-square, nothing of a
 * model is believed. The F of one more unknown in a baseline: once in a million records. */
#define LIMIT_CHI 3.3
#define LIMIT_CHI_REFUSED 6.0
#define LIMIT_GROSS 3.0
#define LIMIT_F 26.0

/* A value that only widens a bar, or is asked twice, may lie so far off in standard deviations: chance makes
 * more once in twenty. So many times as large is more: an axis than another, a swing than its case's, a block
 * than the quietest, what a fit leaves than the one before, a spike than its neighbours' bends. What explains
 * less than this part explains nothing. */
#define LIMIT_HINT 2.0
#define LIMIT_OVER 2.0
#define LIMIT_EXPLAINS 0.5

/* Parts of a peak. Where its pulse begins and ends: the width's definition. What counts as a second contact.
 * About as high. What may be neglected beside it. What no model of a shock is better than. What a model may
 * be off before its residual shows. */
#define LIMIT_EDGE 0.1
#define LIMIT_AGAIN 0.3
#define LIMIT_MOST 0.75
#define LIMIT_PART 0.01
#define LIMIT_MISFIT 3e-4
#define LIMIT_UNSEEN 1e-3

/* Parts of any whole. Less is no difference: two rebounds, two windows, a lag beside its pulse; so little is
 * a reading beyond its range trusted. What is known this well where nothing measures it: the noise, the foot
 * of a contact, a plate's frequency by two axes, what an unasked family adds, what an oscillator leaves. Of
 * the peak: no swing and no contact any more. */
#define LIMIT_SLIGHT 0.1
#define LIMIT_KNOWN 0.05
#define LIMIT_FADED 0.02

/* Numerical: rounding; small beside what is measured, yet far from rounding; the least that such a part is
 * taken of, in g or 1. */
#define LIMIT_ROUNDING 1e-13
#define LIMIT_SMALL 1e-6
#define LIMIT_LEAST 1e-3

#endif
