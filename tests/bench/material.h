/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_BENCH_MATERIAL_H
#define DT_TESTS_BENCH_MATERIAL_H
/*
 * Drops to measure on: two sensors, three axes, 0.5 s, 100 ms of them before the contact; a half-sine of 3 ms
 * on the box, its plate at 129 Hz, the converter's steps. Free with material_free.
 */
#include "host/record/record.h"

enum { MATERIAL_CHANNELS = 6, MATERIAL_S1X = 0, MATERIAL_S2X = 3 };

enum material_kind {
	MATERIAL_CLEAN,
	MATERIAL_WORST, /* spikes, hum, a second mode, a limit at 400 g, lost blocks */
};

struct material {
	struct channel channel[MATERIAL_CHANNELS];
	struct record record;
	double contact_end_s;
};

void material_make(struct material *material, enum material_kind kind);
void material_free(struct material *material);

#endif
