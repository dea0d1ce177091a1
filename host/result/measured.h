/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RESULT_MEASURED_H
#define DT_HOST_RESULT_MEASURED_H
/*
 * What a drop has measured of its tower, in SI units: of the record.
 */
#include <stdbool.h>
#include <stddef.h>

#include "host/record/record.h"

/* NAN: not measured. */
struct measured {
	double dropout_s;      /* from magnet off to product free */
	double dropout_used_s; /* that the magnet edge was planned with */
	double separation_m;   /* travel at which the product left the frame */
	double separation_speed_m_s;
	double acceleration_m_s2; /* of the frame between the gates */
	double latch_delay_s;     /* from RELEASE to the start of the motion */
	double clock_ratio_ppm;   /* sample clock of X against that of Y and Z */
	double trigger_latency_s;
	double parameters_crc32;
	bool seal_agrees, calibrated;
};

/* All NAN when the record has none. */
struct measured measured_of(const struct record *record);

/* "magnet drop-out 8.02 ms (planned with 8.00), ..."; "" when there is none. */
void measured_text(const struct record *record, char *text, size_t size);

#endif
