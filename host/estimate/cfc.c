/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/cfc.h"

#include <math.h>

#include "host/estimate/filter.h"

/* Corner of one pass over the class: the standards' constant. */
#define ONE_PASS 2.0775

#define RATE_MIN 10.0 /* over the class */

static const unsigned classes[] = {60, 180, 600, 1000};

enum { CLASSES = sizeof(classes) / sizeof(classes[0]) };

int cfc_check(unsigned class, double rate_hz)
{
	for (unsigned i = 0; i < CLASSES; i++)
		if (classes[i] == class)
			return rate_hz * (1 + 1e-9) >= RATE_MIN * class ? 0 : DT_E_RANGE;
	return DT_E_UNKNOWN;
}

unsigned cfc_highest(double rate_hz)
{
	unsigned highest = 0;

	for (unsigned i = 0; i < CLASSES; i++)
		if (cfc_check(classes[i], rate_hz) == 0)
			highest = classes[i];
	return highest;
}

int cfc_filter(struct trace *trace, unsigned class)
{
	int result = cfc_check(class, trace->rate_hz);
	struct filter_section section;

	if (result != 0)
		return result;
	section = filter_section(ONE_PASS * class / trace->rate_hz, sqrt(2));
	return filter_two_pass(trace, &section, 1, CFC_CORNER * class / trace->rate_hz);
}
