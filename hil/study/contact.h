/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HIL_STUDY_CONTACT_H
#define DT_HIL_STUDY_CONTACT_H
/*
 * What the study read from its video, read from the record: how long X of a sensor on the box stands above 1
 * % of its peak. Pure, any thread.
 */
#include "host/record/record.h"

/* s; tau_s: time constant of the sensor's high-pass; at_s: about when the peak is. NAN where samples of S1X
 * are missing. */
double contact_time(const struct record *record, double tau_s, double at_s);

#endif
