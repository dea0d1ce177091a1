/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_IEPE_H
#define DT_HOST_ESTIMATE_IEPE_H
/*
 * The high-pass of a sensor's supply undone: a reading y = x h with one pole at -1/tau is x = y + integral of
 * y / tau, the integral by trapezoids.
 *
 * It begins at the quiet part, where x is zero and so is the integral once the offset is off: what came
 * before is left as it is. An error of the offset grows to a slope of error / tau, noise to a random walk of
 * noise sqrt(t / rate) / tau: after 0.1 s and with 0.3 s a hundredth of the noise. What is missing is bridged
 * by a straight line.
 */
#include "host/estimate/trace.h"

/* In place, after baseline_remove. The channel's own time constant, where its sensor's file gives one, goes
 * before time_constant_s. */
void iepe_undo(struct trace *trace, double from_s, double time_constant_s);

#endif
