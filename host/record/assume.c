/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/assume.h"

#include <math.h>

#include "common/units.h"
#include "host/record/source.h"

static const double RATE_LEAST_HZ = 10, RATE_MOST_HZ = 20e6, CHANGE_LEAST_M_S = 0.02, CHANGE_MOST_M_S = 200;

/* Area under the largest peak down to a tenth of it, in g times rows. */
static double largest_area(const struct record *record)
{
	double peak = 0, area = 0;
	const struct channel *of = NULL;
	size_t at = 0;

	for (size_t c = 0; c < record->channel_count; c++)
		for (size_t k = 0; k < record->channels[c].count; k++) {
			if (fabs(record->channels[c].value_g[k]) > fabs(peak)) {
				of = &record->channels[c];
				peak = of->value_g[k];
				at = k;
			}
			record_seen(k, sizeof(double));
		}
	for (size_t k = at; of != NULL && k < of->count && of->value_g[k] / peak > 0.1; k++)
		area += fabs(of->value_g[k]);
	for (size_t k = at; of != NULL && k-- > 0 && of->value_g[k] / peak > 0.1;)
		area += fabs(of->value_g[k]);
	return area;
}

static int refuse_open(double step, double area, bool is_rate, const char *file, char *message)
{
	const char *const *unit =
	        (const char *const[]){is_rate ? "Hz" : "s", is_rate ? "kHz" : "ms", is_rate ? "MHz" : "us"};
	double change_m_s = area * UNITS_G_M_S2 * step;

	return source_refuse(message, DT_E_FORMAT, file, 0,
	                     "%s tells no unit: in %s the rate is %.6g Hz and the largest peak %.3g m/s, in "
	                     "%s %.6g Hz and "
	                     "%.3g m/s, in %s %.6g Hz and %.3g m/s; expected --columns with %s",
	                     is_rate ? "the rate" : "the time column", unit[0], 1 / step, change_m_s, unit[1],
	                     1e3 / step, change_m_s / 1e3, unit[2], 1e6 / step, change_m_s / 1e6,
	                     is_rate ? "name:g@RATE_HZ" : "time:s, time:ms or time:us");
}

int assume_unit(struct assumed *assumed, const struct record *record, double step, bool is_rate,
                const char *file, char message[READ_MESSAGE_MAX])
{
	static const char *const times[] = {"s", "ms", "us", "ns"}, *const rates[] = {"Hz", "kHz", "MHz",
	                                                                              "GHz"};
	double area = largest_area(record), divisor = 1;
	unsigned plausible = 0;

	for (size_t i = 0; i < 4; i++, divisor *= 1e3) {
		double change_m_s = area * UNITS_G_M_S2 * step / divisor;

		if (!(divisor / step >= RATE_LEAST_HZ && divisor / step <= RATE_MOST_HZ &&
		      change_m_s >= CHANGE_LEAST_M_S && change_m_s <= CHANGE_MOST_M_S))
			continue;
		plausible++;
		*assumed = (struct assumed){is_rate ? rates[i] : times[i], divisor};
	}
	return plausible == 1 ? 0 : refuse_open(step, area, is_rate, file, message);
}
