/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HIL_TIMELINE_H
#define DT_HIL_TIMELINE_H
/*
 * A picture of a run over virtual time: states and emergencies, outputs and inputs, S2. The whole run on the
 * left, the drop on the right where there was one. Drawn by gnuplot as SVG.
 *
 * One thread. timeline_create takes memory that grows with the run, timeline_destroy gives it back; NULL is
 * allowed everywhere and does nothing.
 */
#include <stdint.h>

#include "common/error.h"
#include "hil/monitor.h"

struct timeline;

struct timeline *timeline_create(void);
void timeline_destroy(struct timeline *timeline);

/* What was converted at a virtual time; io: outputs and inputs then; state: WIRE_STATE_*. */
void timeline_sample(struct timeline *timeline, double time_s, uint16_t io, uint8_t state, unsigned group,
                     const int16_t codes[6]);

/* 0, or DT_E_SYSTEM: gnuplot or the file; errno tells where it can. */
DT_MUST_USE int timeline_draw(const struct timeline *timeline, const struct monitor *monitor,
                              const char *title, const char *file);

#endif
