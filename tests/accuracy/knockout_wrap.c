/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/accuracy/knockout.h"

#include <math.h>
#include <string.h>

#include "host/estimate/baseline.h"
#include "host/estimate/burst.h"
#include "host/estimate/control_variate.h"
#include "host/estimate/cosine_pulse.h"
#include "host/estimate/crest.h"
#include "host/estimate/driven.h"
#include "host/estimate/dropout.h"
#include "host/estimate/grid_search.h"
#include "host/estimate/hum.h"
#include "host/estimate/iepe.h"
#include "host/estimate/interpolate.h"
#include "host/estimate/modes.h"
#include "host/estimate/outlier.h"
#include "host/estimate/peak_private.h"
#include "host/estimate/quiet.h"
#include "host/estimate/ringdown_private.h"
#include "host/estimate/ripple.h"
#include "host/estimate/settle.h"
#include "host/estimate/spike.h"

const struct knockout *knocked_out;

/* Calls from here go to the function itself; those of the estimators come to the wrapped one. */
#define WRAP(type, function, parameters, arguments, mechanism, otherwise)                               \
	_Static_assert(__builtin_types_compatible_p(__typeof__(function), __typeof__(type parameters)), \
	               "another function than its header's");                                           \
	type __real_##function parameters;                                                              \
	type __wrap_##function parameters;                                                              \
	type __wrap_##function parameters                                                               \
	{                                                                                               \
		if (is_off(mechanism))                                                                  \
			return otherwise;                                                               \
		return __real_##function arguments;                                                     \
	}

static bool is_off(const char *name)
{
	return knocked_out && strcmp(knocked_out->name, name) == 0;
}

/* clang-format off: a table */
const struct knockout knockouts[] = {
        {"settling supply", "settle.c settle.h"},
        {"spikes", "spike.c spike.h"},
        {"zeroed runs", "dropout.c dropout.h"},
        {"drift and hum", "hum.c hum.h"},
        {"decaying zero", "quiet.c:quiet_settled"},
        {"quietest part", "quiet.c:quiet_narrow"},
        {"zero again after spikes", "baseline.c:baseline_holds"},
        {"high-pass undone", "iepe.c iepe.h"},
        {"clipped: from the flanks", "peak_clipped.c"},
        {"polynomials", "crest.c crest.h local.c local.h"},
        {"weak axes", "peak_weak.c"},
        {"curve between samples", "control_variate.c control_variate.h"},
        {"families given up early", "shape_judge.c:shape_hopeless"},
        {"pulse without a family", "cosine_pulse.c cosine_pulse.h"},
        {"driven: S1's peak", "peak_driven.c"},
        {"driven: decay's start", "ringdown.c:ringdown_refine"},
        {"driven: holes as lines", "interpolate.c:interpolate_hole"},
        {"driven oscillator, all",
         "driven.c driven.h respond.c respond.h interpolate.c interpolate.h peak_driven.c"},
        {"ripple under noise", "ripple.c ripple.h"},
        {"burst under noise", "burst.c burst.h"},
        {"decay: reach back", "ringdown_span.c:ringdown_reach_back"},
        {"decay: grid start", "grid_search.c grid_search.h"},
        {"decay: outliers", "outlier.c outlier.h"},
        {"decay: hum", "ringdown_models.c:fit_hum"},
        {"decay: any law", "spring.c spring.h ringdown_models.c:try_square"},
        {"decay: softening spring", "spring.c spring.h"},
        {"decay: two modes",
         "ringdown_models.c:fit_two ringdown_models.c:try_two ringdown_models.c:separable"},
};
/* clang-format on */
const size_t knockout_count = sizeof(knockouts) / sizeof(knockouts[0]);

WRAP(bool, settle_find, (const struct trace *t, struct settle *s), (t, s), "settling supply", false)
WRAP(bool, spike_mark, (struct trace * t, double noise_g), (t, noise_g), "spikes", false)
WRAP(bool, dropout_mark, (struct trace * t, double noise_g), (t, noise_g), "zeroed runs", false)
WRAP(struct hum_line, hum_find,
     (struct quiet * q, double half_s, const struct quiet_moments *m, double reach), (q, half_s, m, reach),
     "drift and hum", (struct hum_line){0})
WRAP(bool, quiet_settled, (struct quiet * q), (q), "decaying zero", false)
WRAP(bool, quiet_narrow, (struct quiet * q), (q), "quietest part", false)
WRAP(bool, baseline_holds, (const struct trace *t, const struct estimate_baseline *b), (t, b),
     "zero again after spikes", true)
WRAP(void, iepe_undo, (struct trace * t, double from_s, double tau_s), (t, from_s, tau_s),
     "high-pass undone", )
WRAP(bool, peak_unclip, (const struct trace *t, const struct estimate_options *o, struct peak *p), (t, o, p),
     "clipped: from the flanks", false)
WRAP(bool, crest_fit,
     (struct crest * c, const struct trace *const axes[], unsigned n, double near_s, double width_s,
      const struct local_span *s),
     (c, axes, n, near_s, width_s, s), "polynomials", false)
WRAP(bool, peak_is_weak, (const struct trace *t, const struct peak *p), (t, p), "weak axes", false)
WRAP(bool, control_variate_from_shape, (const struct shape *s, struct control_variate *g), (s, g),
     "curve between samples", false)
WRAP(bool, control_variate_from_cosine_pulse,
     (const struct trace *t, const struct peak *p, struct control_variate *g), (t, p, g),
     "curve between samples", false)
WRAP(bool, shape_hopeless, (const struct shape *s), (s), "families given up early", false)
WRAP(bool, cosine_pulse_fit, (const struct trace *t, const struct peak *p, struct cosine_pulse *b), (t, p, b),
     "pulse without a family", false)
WRAP(bool, peak_driven,
     (const struct driven_axis *a, struct driven *d, const struct driven_curve *c, struct peak *p),
     (a, d, c, p), "driven: S1's peak", false)
WRAP(void, ripple_widen, (const struct trace *const t[], struct peak *const p[], unsigned n), (t, p, n),
     "ripple under noise", )
WRAP(void, ringdown_refine, (const struct trace *t, const struct ringdown_span *s, struct ringdown *r),
     (t, s, r), "driven: decay's start", )
WRAP(double, interpolate_hole, (const struct trace *t, ptrdiff_t k), (t, k), "driven: holes as lines", 0)
WRAP(bool, burst_find, (const struct trace *t, struct burst *b), (t, b), "burst under noise", false)
WRAP(void, ringdown_reach_back, (struct ringdown_job * j), (j), "decay: reach back", )
WRAP(bool, grid_search_find, (struct grid_search * s, const struct trace *t, size_t first, size_t last),
     (s, t, first, last), "decay: grid start", false)
WRAP(unsigned, outlier_drop, (struct block_means * s, const struct modes *m, const bool *usable),
     (s, m, usable), "decay: outliers", 0)
WRAP(void, ringdown_try_hum, (struct ringdown_job * j), (j), "decay: hum", )

static bool law_is_off(const struct modes *modes)
{
	return (modes->law != MODES_LAW_NONE && is_off("decay: any law")) ||
	       (modes->law == MODES_LAW_SPRING && is_off("decay: softening spring")) ||
	       (modes->count > 1 && is_off("decay: two modes"));
}

bool __real_modes_fit(struct modes *modes, const struct block_means *series);
bool __wrap_modes_fit(struct modes *modes, const struct block_means *series);
bool __wrap_modes_fit(struct modes *modes, const struct block_means *series)
{
	return !law_is_off(modes) && __real_modes_fit(modes, series);
}

static const struct driven no_oscillator = {.lag_s = NAN,
                                            .sigma_s = NAN,
                                            .peak_g = NAN,
                                            .sigma_peak_g = NAN,
                                            .peak_s = NAN,
                                            .sigma_peak_s = NAN,
                                            .free_s = NAN,
                                            .chi_square = NAN,
                                            .status = ESTIMATE_NOT_CONVERGED};

void __real_driven_find(const struct driven_axis *axis, struct driven *driven, struct driven_curve *curve);
void __wrap_driven_find(const struct driven_axis *axis, struct driven *driven, struct driven_curve *curve);
void __wrap_driven_find(const struct driven_axis *axis, struct driven *driven, struct driven_curve *curve)
{
	if (is_off("driven oscillator, all"))
		*driven = no_oscillator;
	else
		__real_driven_find(axis, driven, curve);
}
