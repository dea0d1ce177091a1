/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_MODEL_PEAK_TRACKER_H
#define DT_HOST_MODEL_PEAK_TRACKER_H
/*
 * The largest magnitude of several signals along an integration, each with its instant: signals are sampled
 * twice a step, and where one turns round above its largest so far, its turning point is found on the
 * continuous extension. Also the instant a signal crosses zero.
 *
 * The caller owns the struct; no memory besides, any thread.
 */
#include <stdbool.h>
#include <stddef.h>

#include "common/error.h"
#include "host/model/ode.h"

enum { PEAK_TRACKER_SIGNALS_MAX = 10 };

struct peak_tracker_peak {
	double value; /* signed */
	double time_s;
};

struct peak_tracker {
	/* set by the caller */
	size_t count;
	void (*signals)(const void *context, const double y[], double value[]);
	const void *context;
	unsigned skipped; /* bits of the signals nobody asks for: their peaks are not sought */
	bool rough;       /* steps are so long that a parabola through three samples is all there is */

	/* read only */
	struct peak_tracker_peak peak[PEAK_TRACKER_SIGNALS_MAX];
	double with[PEAK_TRACKER_SIGNALS_MAX][PEAK_TRACKER_SIGNALS_MAX]; /* all signals at each one's peak */
	double time_s[3], value[3][PEAK_TRACKER_SIGNALS_MAX]; /* the last samples, the newest last */
	int seen;
	bool resumed; /* and none since that told of what came right after */
};

/* After ode_start. */
void peak_tracker_start(struct peak_tracker *tracker, const struct ode *ode);

/* After each step (and after ode_cut, if that shortened it). */
void peak_tracker_step(struct peak_tracker *tracker, const struct ode *ode);

/* Whether signal, past its peak, is below share of it. */
bool peak_tracker_passed(const struct peak_tracker *tracker, size_t signal, double share);

/* At the end, or where the equations change: peaks between the last two samples, or at the very last. */
void peak_tracker_end(struct peak_tracker *tracker, const struct ode *ode);

/* Goes on after peak_tracker_end. */
void peak_tracker_resume(struct peak_tracker *tracker, const struct ode *ode);

/* Where the state, which has different signs at the ends of the last step, crosses zero. */
double peak_tracker_crossing(const struct ode *ode, size_t state);

#endif
