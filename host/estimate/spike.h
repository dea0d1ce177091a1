/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_SPIKE_H
#define DT_HOST_ESTIMATE_SPIKE_H
/*
 * Outliers of one or two samples: what no accelerometer reads but a bad contact or a flipped bit leaves. A
 * sample is one when it stands off the straight line between its neighbours by far more than those bend
 * among themselves, four on each side, and more than noise. A kink (the onset of a contact), a summit and a
 * vibration of any frequency bend their neighbours as much as themselves; so does whatever a sensor with a
 * limited bandwidth shows. A pulse shorter than about three samples is no different from a spike: it is taken
 * for one. Two within four samples hide each other: each is judged as if the other were missing, where one of
 * them is about as high as anything in its block.
 *
 * Marks SAMPLE_SPIKE, which is not good from then on, and RECORD_FLAG_SPIKE. Before baseline_remove. Nothing
 * is marked where the noise is not known, nor the first or the last sample: a pulse cut off there looks the
 * same. Beside missing samples only a single one is looked for, by a wider margin; so it is among the three
 * next to an end, where none is missing and it is about as high as anything in its block.
 */
#include "host/estimate/estimate.h"
#include "host/estimate/trace.h"

/* True when something was marked. */
bool spike_mark(struct trace *trace, double noise_g);

/* After baseline_remove. Noise that reaches far by its nature (Laplace, Student) leaves samples that are
 * marked: they stay left out, but are no defect of the sensor, and the flag is taken away, unless one stands
 * off far further than the quiet part's own. */
void spike_of_noise(struct trace *trace, const struct estimate_baseline *baseline);

#endif
