/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_CONTROL_VARIATE_H
#define DT_HOST_ESTIMATE_CONTROL_VARIATE_H
/*
 * What a pulse does between its samples, by a curve that fits it: a control variate. A sum or an edge by
 * straight lines is wrong by what the pulse bends between two samples, most at a kink, and the more the less
 * noise there is. The curve's own sum and edge are known, so that only what the samples say beyond the curve
 * is summed and interpolated. The result stays the samples': a curve that is a little wrong errs by how much
 * its difference to them bends.
 *
 * The curve is a family that is not refused, otherwise a symmetric pulse without a family (cosine_pulse.h).
 */
#include "host/estimate/cosine_pulse.h"

struct control_variate {
	struct cosine_pulse curve;
	double area_g_s;
	double sigma_peak_g;
	double sigma_base_s; /* 0 where it has no kink at its feet */
};

struct control_variate_edge {
	double time_s;
	double slope_g_s; /* magnitude, of the curve */
	double sigma_s;   /* by the samples' noise, at a known level */
	/* Where one of the two samples is beyond the curve's foot it knows nothing of where the foot is: the
	 * part of the foot's error that stays, and the part that the other sample takes off. */
	double stays, taken;
};

/* From a family's fit; false where there was no noise to hold it against. */
bool control_variate_from_shape(const struct shape *shape, struct control_variate *variate);

/* Without a family. False when no symmetric pulse fits either. */
bool control_variate_from_cosine_pulse(const struct trace *trace, const struct peak *peak,
                                       struct control_variate *variate);

/* Whether what lies beyond the curve's feet, for half of its base on either side, is nothing as far as noise
 * tells: a pulse with slower feet is no curve's, however well its middle fits. */
bool control_variate_ends(const struct control_variate *variate, const struct trace *trace);

/* Where the pulse meets level_g, a magnitude, before (step -1) or after (step +1) its middle. False where the
 * curve does not reach it or one of the two samples there is missing. */
bool control_variate_edge(const struct control_variate *variate, const struct trace *trace, int step,
                          double level_g, struct control_variate_edge *edge);

/* Standard deviation of the time between the two edges, at a known level. */
double control_variate_spread(const struct control_variate *variate,
                              const struct control_variate_edge edge[2]);

/* Sum of the pulse in g s, from foot to foot. Samples that are missing or clipped, from clipped_from_s to
 * clipped_until_s of the peak, follow the curve. */
double control_variate_area(const struct control_variate *variate, const struct trace *trace,
                            const struct peak *peak, double *sigma_g_s);

#endif
