/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_ASSUME_H
#define DT_HOST_RECORD_ASSUME_H
/*
 * The unit of a time column or of a rate that none is told of: the one of s, ms, us, ns (Hz, kHz, MHz, GHz)
 * that gives 10 Hz to 20 MHz and, under the largest peak, a velocity change that a shock can have, if there
 * is one.
 */
#include "host/record/record.h"
#include "host/record/read.h"

struct assumed {
	const char *unit;
	double divisor; /* a number of the file / divisor is in s */
};

/* step: of a row, as if in s, and of a rate 1/rate as if in Hz. The record has the samples. DT_E_FORMAT with
 * what each would be. */
DT_MUST_USE int assume_unit(struct assumed *assumed, const struct record *record, double step, bool is_rate,
                            const char *file, char message[READ_MESSAGE_MAX]);

#endif
