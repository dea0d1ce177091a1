/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RESULT_DECIDE_H
#define DT_HOST_RESULT_DECIDE_H
/*
 * Whether a value meets a limit, with its uncertainty: ILAC-G8:09/2019, 4.2, with the probabilities of JCGM
 * 106.
 *
 * U = 2 u. The guard band is w = r U on the inner side of each limit: pass up to w before the limit,
 * conditional pass up to the limit, conditional fail up to w behind it, fail from there on. Without an
 * uncertainty nothing is decided.
 *
 * A curve of many points is met where all of its points are. What is common to them is wrong once; what is
 * each point's own has as many chances as there are points, and its part of the guard band grows with them.
 *
 * Pure functions.
 */
#include <stdbool.h>
#include <stddef.h>

#define DECIDE_COVERAGE 2.0 /* k */

/* The worst is the largest. */
enum decision {
	DECIDE_NONE, /* nothing was to be decided */
	DECIDE_PASS,
	DECIDE_CONDITIONAL_PASS,
	DECIDE_CONDITIONAL_FAIL,
	DECIDE_UNDECIDED, /* no value, no uncertainty, or a flag */
	DECIDE_FAIL,
};

/* "none" "pass" "conditional pass" "conditional fail" "undecided" "fail" */
const char *decide_name(enum decision decision);

/* Whether the limit is met: pass and conditional pass. */
bool decide_meets(enum decision decision);

/* The largest risk of a pass: the probability that a value at TL - w is beyond TL. */
double decide_risk(double guard);

/* The probability that the true value lies between the limits; an infinite limit is none. */
double decide_probability(double value, double u, double lower, double upper);

/* guard is r. */
enum decision decide_value(double value, double u, double lower, double upper, double guard);

/* A point of a curve: how far it is from its limits (negative: beyond), the standard uncertainty that is its
 * own, and the one that it has in common with the others, with its sign. */
struct decide_point {
	double below_upper, above_lower;
	double own, common;
};

/* The probability that all points are within their limits. */
double decide_all(const struct decide_point *point, size_t count);

/* The guard band of a point among so many. */
double decide_guard(const struct decide_point *point, size_t count, double guard);

/* The decision by these bands. share: of the points that must be within; 1: all of them. */
enum decision decide_points(const struct decide_point *point, size_t count, double guard, double share);

#endif
