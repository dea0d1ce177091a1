/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_MODEL_WATCH_H
#define DT_HOST_MODEL_WATCH_H
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

enum { WATCH_SIGNALS_MAX = 10 };

struct watch_peak {
	double value; /* signed */
	double time_s;
};

struct watch {
	/* set by the caller */
	size_t count;
	void (*signals)(const void *context, const double y[], double value[]);
	const void *context;
	unsigned skipped; /* bits of the signals nobody asks for: their peaks are not sought */
	bool rough;       /* steps are so long that a parabola through three samples is all there is */

	/* read only */
	struct watch_peak peak[WATCH_SIGNALS_MAX];
	double with[WATCH_SIGNALS_MAX][WATCH_SIGNALS_MAX]; /* all signals at each one's peak */
	double time_s[3], value[3][WATCH_SIGNALS_MAX];     /* the last samples, the newest last */
	int seen;
	bool resumed; /* and none since that told of what came right after */
};

/* After ode_start. */
void watch_start(struct watch *watch, const struct ode *ode);

/* After each step (and after ode_cut, if that shortened it). */
void watch_step(struct watch *watch, const struct ode *ode);

/* Whether signal, past its peak, is below share of it. */
bool watch_passed(const struct watch *watch, size_t signal, double share);

/* At the end, or where the equations change: peaks between the last two samples, or at the very last. */
void watch_end(struct watch *watch, const struct ode *ode);

/* Goes on after watch_end. */
void watch_resume(struct watch *watch, const struct ode *ode);

/* Where the state, which has different signs at the ends of the last step, crosses zero. */
double watch_crossing(const struct ode *ode, size_t state);

#endif
