/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/chart/product.h"

#include <math.h>
#include <stdlib.h>

#include "host/chart/synthetic.h"
#include "host/estimate/baseline.h"
#include "host/estimate/lag.h"
#include "host/estimate/peak.h"
#include "host/estimate/pulse.h"
#include "host/estimate/resultant.h"
#include "host/estimate/ringdown.h"
#include "host/estimate/spike.h"

/* As far before the given end of the contact as estimate_record looks for the decay's true start. */
#define MARGIN_S 0.5e-3

struct product {
	struct trace trace[SYNTHETIC_CHANNELS];
	struct estimate_baseline baseline[SYNTHETIC_CHANNELS];
	struct peak peak[SYNTHETIC_CHANNELS];
	struct ringdown ringdown[2]; /* of S1 */
	struct resultant resultant[2];
	struct lag_sensor sensor[2];
	double contact_end_s;
};

static void decay(struct product *product, int axis, struct ringdown *ringdown)
{
	const struct ringdown_span span = {.from_s = product->contact_end_s,
	                                   .until_s = INFINITY,
	                                   .peak_g = fabs(product->peak[axis].result.value_g),
	                                   .margin_s = MARGIN_S};

	ringdown_find(&product->trace[axis], &span, ringdown);
}

static void product_prepare(struct product *product)
{
	const struct estimate_options options = {0};

	for (int i = 0; i < SYNTHETIC_CHANNELS; i++)
		peak_find(&product->trace[i], &options, &product->peak[i]);
	for (int i = 0; i < 2; i++) {
		struct lag_sensor *sensor = &product->sensor[i];
		int x = i == 0 ? SYNTHETIC_S1X : SYNTHETIC_S2X, y = x + 1;

		decay(product, i, &product->ringdown[i]);
		sensor->axes = (struct resultant_axes){.trace = {&product->trace[x], &product->trace[y]},
		                                       .peak = {&product->peak[x], &product->peak[y]}};
		resultant_find(&sensor->axes, &product->resultant[i]);
		sensor->resultant = &product->resultant[i];
	}
}

struct product *product_open(const struct record *record, double contact_end_s)
{
	struct product *product = calloc(1, sizeof(*product));
	size_t longest = 0;
	double *scratch;

	for (int i = 0; i < SYNTHETIC_CHANNELS; i++)
		if (record->channels[i].count > longest)
			longest = record->channels[i].count;
	scratch = malloc(2 * longest * sizeof(*scratch));
	for (int i = 0; product && scratch && i < SYNTHETIC_CHANNELS; i++) {
		if (trace_open(&product->trace[i], &record->channels[i], -INFINITY, INFINITY)) {
			product_close(product);
			product = NULL;
			break;
		}
		baseline_find(&product->trace[i], scratch, &product->baseline[i]);
		if (spike_mark(&product->trace[i], product->baseline[i].noise_g))
			trace_marked(&product->trace[i]);
		baseline_remove(&product->trace[i], &product->baseline[i]);
	}
	if (product && scratch) {
		product->contact_end_s = contact_end_s;
		product_prepare(product);
	} else {
		free(product);
		product = NULL;
	}
	free(scratch);
	return product;
}

void product_close(struct product *product)
{
	for (int i = 0; product && i < SYNTHETIC_CHANNELS; i++)
		trace_close(&product->trace[i]);
	free(product);
}

void product_peak(struct product *product, enum estimate_family family)
{
	const struct estimate_options options = {.family = family};
	struct peak peak;

	peak_find(&product->trace[SYNTHETIC_S2X], &options, &peak);
}

double product_plate_peak(struct product *product)
{
	const struct estimate_options options = {0};
	struct peak peak;

	peak_find(&product->trace[SYNTHETIC_S1X], &options, &peak);
	return peak.result.value_g;
}

void product_pulse(struct product *product, enum estimate_family family)
{
	struct estimate_pulse pulse;

	pulse_measure(&product->trace[SYNTHETIC_S2X], &product->peak[SYNTHETIC_S2X],
	              &product->baseline[SYNTHETIC_S2X], family, &pulse);
}

void product_resultant(struct product *product)
{
	struct resultant resultant;

	resultant_find(&product->sensor[1].axes, &resultant);
}

void product_decay(struct product *product)
{
	struct ringdown ringdown;

	decay(product, 0, &ringdown);
}

void product_decays(struct product *product)
{
	struct ringdown ringdown[2];
	struct estimate_ringdown combined;

	decay(product, 0, &ringdown[0]);
	decay(product, 1, &ringdown[1]);
	ringdown_combine(&ringdown[0], &ringdown[1], &combined);
}

void product_lag(struct product *product)
{
	struct driven driven[2];
	struct driven_curve curve;
	struct estimate_lag lag;

	for (int i = 0; i < 2; i++) {
		const struct driven_axis axis = {
		        {&product->trace[SYNTHETIC_S1X + i], &product->trace[SYNTHETIC_S2X + i]},
		        {&product->peak[SYNTHETIC_S1X + i], &product->peak[SYNTHETIC_S2X + i]},
		        &product->ringdown[i]};

		driven_find(&axis, &driven[i], &curve);
	}
	lag_find(&product->sensor[0], &product->sensor[1], driven, &lag);
}
