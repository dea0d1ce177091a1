/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/sensor/budget.h"
#include "host/sensor/budget_sum.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/units.h"
#include "host/sensor/lowpass.h"

#define WIDTH_SHARE 0.936     /* of a half-sine's foot to foot: its width at 10 % */
#define OTHERS_SHARE 0.5      /* of a value: what an axis that is not recorded is taken for */
#define NEIGHBOUR_SHARE 0.125 /* of the duration: how far slopes are taken from */
#define PERCENT 0.01

struct desk {
	const struct sensors *sensors;
	const struct record *record;
	const struct analysis *analysis;
	struct budget *budget;
	bool failed;
};

/* One axis of a sensor in the record. */
struct axis {
	const struct sensor_used *used;
	unsigned axis;
	const struct estimate_channel *e;
};

/* subject "" for what is of no channel. Nothing without a value, its noise and all that adds to it. */
static void item_add(struct desk *d, const char *subject, const char *what, const char *unit, double value,
                     double noise, struct budget_sum *c)
{
	struct budget *b = d->budget;
	struct budget_item *item;

	if (!isfinite(value) || !(noise > 0.0) || !isfinite(noise) || c->unknown || d->failed)
		return;
	if (b->count == b->room) {
		size_t room = b->room > 0 ? 2 * b->room : 64;
		struct budget_item *more = realloc(b->item, room * sizeof(*more));

		d->failed = more == NULL;
		if (d->failed)
			return;
		b->item = more;
		b->room = room;
	}
	item = &b->item[b->count++];
	*item = (struct budget_item){.unit = unit, .value = value};
	snprintf(item->what, sizeof(item->what), "%.31s%s%s", subject, subject[0] != '\0' ? "." : "", what);
	c->part[BUDGET_NOISE] = noise;
	/* Student's t by its variance */
	budget_settle(item, c, budget_part_name(BUDGET_NOISE),
	              isfinite(c->degrees) ? sqrt(c->degrees / fmax(1.0, c->degrees - 2.0)) : 1.0);
}

/* ---- what each source does ---- */

/* A relative uncertainty of each axis, correlated, on what has the absolute effect w[i] of each. */
static void correlated(struct budget_sum *c, enum budget_part part, enum coverage_law law, double u, double r,
                       const double w[3])
{
	double sum = w[0] + w[1] + w[2];
	bool one = fabs(fabs(sum) - fmax(fabs(w[0]), fmax(fabs(w[1]), fabs(w[2])))) <= 0.0;

	if (one) {
		budget_collect(c, part, law, u * sum);
		return;
	}
	budget_collect(c, part, law, u * sqrt(r) * sum);
	for (int i = 0; i < 3; i++)
		budget_collect(c, part, law, u * sqrt(1.0 - r) * w[i]);
}

/* w: change of the value for a gain that is all of it larger, of each axis. */
static void gains(struct budget_sum *c, const struct sensor_used *used, const double w[3])
{
	const struct transducer *t = &used->transducer;
	double r = t->calibration_correlation, root = sqrt(3.0);

	correlated(c, BUDGET_SENSITIVITY, COVERAGE_NORMAL,
	           t->calibration_expanded_percent * PERCENT / t->calibration_coverage_factor, r, w);
	correlated(c, BUDGET_SENSITIVITY, COVERAGE_RECTANGULAR,
	           t->calibration_drift_percent_year * PERCENT * used->age_years / root, 1.0, w);
	correlated(c, BUDGET_SENSITIVITY, COVERAGE_RECTANGULAR,
	           fabs(t->calibration_temperature_percent_k) * PERCENT * t->chain_temperature_range_k / root,
	           1.0, w);
	correlated(c, BUDGET_SENSITIVITY, COVERAGE_NORMAL, t->chain_gain_u_percent * PERCENT, 0.0, w);
	correlated(c, BUDGET_LINEARITY, COVERAGE_RECTANGULAR,
	           t->calibration_linearity_percent * PERCENT / root, r, w);
	correlated(c, BUDGET_RESPONSE, COVERAGE_RECTANGULAR, t->calibration_response_percent * PERCENT / root,
	           r, w);
	correlated(c, BUDGET_MOUNTING, COVERAGE_RECTANGULAR, t->chain_mount_percent * PERCENT / root, 1.0, w);
}

/* channel_count: not recorded. */
static size_t channel_named(const struct desk *d, const char *name)
{
	const struct channel *channel = record_channel(d->record, name);

	return channel != NULL ? (size_t)(channel - d->record->channels) : d->record->channel_count;
}

static size_t channel_of(const struct desk *d, const struct sensor_used *used, unsigned axis)
{
	return channel_named(d, used->transducer.channel[axis]);
}

/* What an axis reads of the others, times weight; a: all three, in the value's unit. By the matrix it was
 * taken off, but of those that are not recorded. */
static void transverse(const struct desk *d, struct budget_sum *c, const struct sensor_used *used,
                       unsigned axis, const double a[3], double weight)
{
	const struct transducer *t = &used->transducer;
	double others = weight * hypot(a[(axis + 1) % 3], a[(axis + 2) % 3]);

	if (t->has_matrix)
		budget_collect(c, BUDGET_TRANSVERSE, COVERAGE_NORMAL, t->calibration_matrix_u * others);
	else
		budget_collect(c, BUDGET_TRANSVERSE, COVERAGE_ARCSINE,
		               t->calibration_transverse_percent * PERCENT * others / sqrt(2.0));
	for (unsigned j = 0; j < 3 && t->has_matrix; j++)
		if (j != axis && channel_of(d, used, j) == d->record->channel_count)
			budget_within(c, BUDGET_TRANSVERSE, transducer_reads(t, axis, j) * a[j] * weight);
	budget_within(c, BUDGET_MOUNTING, t->chain_align_deg * UNITS_PI / 180.0 * others);
}

static double zero_of(const struct axis *x)
{
	return x->used->transducer.calibration_zero_shift_percent * PERCENT * fabs(x->e->peak.value_g);
}

/* Where the filter puts an instant, times weight. */
static void late(struct budget_sum *c, const struct axis *x, double weight)
{
	const struct transducer *t = &x->used->transducer;
	double filter_s = lowpass_delay_s(t->filter, (unsigned)t->chain_order,
	                                  TRANSDUCER_OF(t, chain_cutoff_x_hz, x->axis));

	budget_collect(c, BUDGET_FILTER, COVERAGE_NORMAL,
	               t->chain_cutoff_u_percent * PERCENT * filter_s * weight);
	budget_collect(c, BUDGET_FILTER, COVERAGE_NORMAL, t->chain_skew_u_us * 1e-6 * weight);
}

/* Foot to foot of a pulse by its width. */
static double duration_of(const struct axis *x)
{
	return x->e->pulse.duration_s / WIDTH_SHARE;
}

/* Times value: what the supply's high-pass is off, by part of T / tau. */
static void supply(struct budget_sum *c, const struct axis *x, double value, double part)
{
	const struct transducer *t = &x->used->transducer;

	if (t->chain_tau_s > 0.0)
		budget_within(c, BUDGET_FILTER,
		              t->chain_tau_percent * PERCENT * value * part * duration_of(x) /
		                      t->chain_tau_s);
}

static double clock_of(const struct sensor_used *used)
{
	return used->transducer.chain_clock_ppm * 1e-6;
}

/* ---- the other axes ---- */

/* The signal without its zero at t, between two samples; NAN where there is none. */
static double signal_at(const struct desk *d, size_t channel, double t)
{
	const struct channel *x = &d->record->channels[channel];
	double at = (t - x->start_s) * x->rate_hz, s = at - floor(at);
	size_t k = at >= 0.0 ? (size_t)at : x->count;

	if (k + 1 >= x->count)
		return (double)NAN;
	return x->value_g[k] + s * (x->value_g[k + 1] - x->value_g[k]) -
	       d->analysis->channels[channel].baseline.offset_g;
}

/* All axes of x's sensor at t; one that is not there is a share of own. */
static void others_at(const struct desk *d, const struct axis *x, double t, double own, double a[3])
{
	for (unsigned i = 0; i < 3; i++) {
		size_t channel = channel_of(d, x->used, i);

		a[i] = channel < d->record->channel_count ? signal_at(d, channel, t) : (double)NAN;
		if (!isfinite(a[i]))
			a[i] = OTHERS_SHARE * own;
	}
}

/* The same integrated over x's pulse, m/s. */
static void others_area(const struct desk *d, const struct axis *x, double own, double a[3])
{
	const struct estimate_pulse *p = &x->e->pulse;

	for (unsigned i = 0; i < 3; i++) {
		size_t channel = channel_of(d, x->used, i);
		const struct channel *other = &d->record->channels[channel];
		double sum = 0.0;

		if (channel == d->record->channel_count) {
			a[i] = OTHERS_SHARE * own;
			continue;
		}
		for (double t = p->start_s; t < p->end_s; t += 1.0 / other->rate_hz) {
			double value = signal_at(d, channel, t);

			sum += isfinite(value) ? value : 0.0;
		}
		a[i] = sum * UNITS_G_M_S2 / other->rate_hz;
	}
}

/* ---- a channel's numbers ---- */

static struct budget_sum begin(const struct axis *x)
{
	double samples = (double)x->e->baseline.samples;

	return (struct budget_sum){.degrees = fmax(1.0, samples - 2.0)};
}

static void of_peak(struct desk *d, const struct axis *x, const char *name)
{
	const struct estimate_peak *p = &x->e->peak;
	const struct transducer *t = &x->used->transducer;
	struct budget_sum c = begin(x);
	double w[3] = {0.0, 0.0, 0.0}, a[3], fc = TRANSDUCER_OF(t, chain_cutoff_x_hz, x->axis);

	w[x->axis] = p->value_g;
	others_at(d, x, p->time_s, p->value_g, a);
	gains(&c, x->used, w);
	transverse(d, &c, x->used, x->axis, a, 1.0);
	budget_within(&c, BUDGET_ZERO, zero_of(x));
	supply(&c, x, p->value_g, 1.0 / UNITS_PI);
	if (t->filter != TRANSDUCER_NO_FILTER)
		budget_within(&c, BUDGET_FILTER, p->value_g * lowpass_peak_share(fc * duration_of(x)));
	item_add(d, name, "peak.value_g", "g", p->value_g, p->sigma_g, &c);
}

/* How far what it reads of the others moves an extreme: their slope over its own bend. */
static void moved(struct desk *d, struct budget_sum *c, const struct axis *x, double weight)
{
	double half = NEIGHBOUR_SHARE * duration_of(x), bend = pow(UNITS_PI / duration_of(x), 2), before[3],
	       after[3];
	const struct estimate_peak *p = &x->e->peak;

	others_at(d, x, p->time_s - half, 0.0, before);
	others_at(d, x, p->time_s + half, 0.0, after);
	for (int i = 0; i < 3; i++)
		after[i] -= before[i];
	transverse(d, c, x->used, x->axis, after, weight / (2.0 * half * bend * fabs(p->value_g)));
}

static void of_instant(struct desk *d, const struct axis *x, const char *name)
{
	const struct estimate_peak *p = &x->e->peak;
	struct budget_sum c = begin(x);

	late(&c, x, 1.0);
	moved(d, &c, x, 1.0);
	supply(&c, x, duration_of(x), 1.0 / (UNITS_PI * UNITS_PI));
	budget_within(&c, BUDGET_CLOCK, clock_of(x->used) * p->time_s);
	item_add(d, name, "peak.time_s", "s", p->time_s, p->sigma_time_s, &c);
}

static void of_width(struct desk *d, const struct axis *x, const char *name, const char *what, double width_s,
                     double noise_s)
{
	const struct estimate_pulse *p = &x->e->pulse;
	const struct transducer *t = &x->used->transducer;
	struct budget_sum c = begin(x);
	double duration = duration_of(x), slope = UNITS_PI * fabs(x->e->peak.value_g) / duration;
	double periods = duration * TRANSDUCER_OF(t, chain_cutoff_x_hz, x->axis), a[3][3];

	budget_within(&c, BUDGET_ZERO, 2.0 * zero_of(x) / slope);
	others_at(d, x, p->start_s, 0.0, a[0]);
	others_at(d, x, p->end_s, 0.0, a[1]);
	others_at(d, x, x->e->peak.time_s, 0.0, a[2]);
	for (int i = 0; i < 3; i++)
		a[0][i] += a[1][i] - 2.0 * 0.1 * a[2][i];
	transverse(d, &c, x->used, x->axis, a[0], 1.0 / slope);
	if (t->filter != TRANSDUCER_NO_FILTER)
		budget_within(&c, BUDGET_FILTER, width_s * lowpass_width_share(periods));
	budget_within(&c, BUDGET_CLOCK, clock_of(x->used) * width_s);
	item_add(d, name, what, "s", width_s, noise_s, &c);
}

static void of_velocity(struct desk *d, const struct axis *x, const char *name, const char *what,
                        double value, double noise)
{
	struct budget_sum c = begin(x);
	double w[3] = {0.0, 0.0, 0.0}, a[3];

	w[x->axis] = value;
	others_area(d, x, value, a);
	gains(&c, x->used, w);
	transverse(d, &c, x->used, x->axis, a, 1.0);
	budget_within(&c, BUDGET_ZERO, UNITS_G_M_S2 * zero_of(x) * duration_of(x));
	supply(&c, x, value, 0.5);
	budget_within(&c, BUDGET_CLOCK, clock_of(x->used) * value);
	item_add(d, name, what, "m/s", value, noise, &c);
}

static void of_decay(struct desk *d, const struct sensor_used *used, const char *name, const char *what,
                     const struct estimate_ringdown *r, double degrees)
{
	const struct {
		const char *key, *unit;
		double value, noise, follows;
	} number[] = {{"frequency_hz", "Hz", r->frequency_hz, r->sigma_hz, 1.0},
	              {"natural_frequency_hz", "Hz", r->natural_frequency_hz, r->sigma_natural_hz, 1.0},
	              {"damping_ratio", "1", r->damping_ratio, r->sigma_damping, 0.0}};
	/* the mean of three cycles, fitted or counted: one definition as good as the other */
	double apart = (r->how.flags & ESTIMATE_FLAG_AMPLITUDE) != 0
	                       ? fabs(r->three_cycle_frequency_hz - r->frequency_hz)
	                       : 0.0;

	for (size_t i = 0; i < sizeof(number) / sizeof(number[0]); i++) {
		struct budget_sum c = {.degrees = degrees};
		char key[40];

		budget_within(&c, BUDGET_CLOCK, clock_of(used) * number[i].value * number[i].follows);
		budget_within(&c, BUDGET_DEFINITION, 0.5 * apart * number[i].follows);
		snprintf(key, sizeof(key), "%s.%s", what, number[i].key);
		item_add(d, name, key, number[i].unit, number[i].value, number[i].noise, &c);
	}
}

static void of_channel(struct desk *d, size_t i)
{
	const char *name = d->record->channels[i].name;
	struct axis x = {.e = &d->analysis->channels[i]};
	const struct estimate_pulse *p = &x.e->pulse;

	x.used = sensors_of(d->sensors, name, &x.axis);
	if (x.used == NULL)
		return;
	of_peak(d, &x, name);
	of_instant(d, &x, name);
	of_width(d, &x, name, "pulse.duration_s", p->duration_s, p->sigma_duration_s);
	of_velocity(d, &x, name, "pulse.velocity_change_m_s", p->velocity_change_m_s, p->sigma_velocity_m_s);
	of_width(d, &x, name, "pulse.contact.duration_s", p->contact_time_s, p->sigma_contact_s);
	of_velocity(d, &x, name, "pulse.contact.velocity_change_m_s", p->fitted_velocity_m_s,
	            p->sigma_fitted_velocity_m_s);
	of_decay(d, x.used, name, "ringdown", &x.e->ringdown, begin(&x).degrees);
}

/* ---- of X and Y together ---- */

/* X and Y of one sensor, "S1" or "S2"; false: not both are there, of one file. */
static bool pair_of(const struct desk *d, const char *sensor, struct axis pair[2])
{
	for (unsigned i = 0; i < 2; i++) {
		char name[12];
		size_t k;

		snprintf(name, sizeof(name), "%.7s%c", sensor, "XY"[i]);
		k = channel_named(d, name);
		pair[i].used = sensors_of(d->sensors, name, &pair[i].axis);
		if (pair[i].used == NULL || k == d->record->channel_count)
			return false;
		pair[i].e = &d->analysis->channels[k];
	}
	return pair[0].used == pair[1].used;
}

/* Scale times the length of a's components along X and Y, whose zeros are wrong by up to zero, and which the
 * supply changes by that part of T / tau. */
static void of_length(const struct desk *d, struct budget_sum *c, const struct axis pair[2],
                      const double a[3], double scale, const double zero[2], double part)
{
	double length = hypot(a[pair[0].axis], a[pair[1].axis]), w[3] = {0.0, 0.0, 0.0};

	for (int i = 0; i < 2; i++) {
		double along = a[pair[i].axis];

		w[pair[i].axis] = scale * along * along / length;
		transverse(d, c, pair[i].used, pair[i].axis, a, scale * fabs(along) / length);
		budget_within(c, BUDGET_ZERO, scale * zero[i] * along / length);
	}
	gains(c, pair[0].used, w);
	supply(c, &pair[0], scale * length, part);
}

/* The instant of the length's maximum: each axis counts by its share. */
static void late_length(struct desk *d, struct budget_sum *c, const struct axis pair[2], const double a[3])
{
	double length = hypot(a[pair[0].axis], a[pair[1].axis]);

	for (int i = 0; i < 2; i++) {
		double share = pow(a[pair[i].axis] / length, 2);

		late(c, &pair[i], share);
		moved(d, c, &pair[i], share);
	}
}

static void of_resultant(struct desk *d, const struct estimate_resultant *r)
{
	struct axis pair[2];
	struct budget_sum height, instant;
	double a[3], zero[2];

	if (!pair_of(d, r->sensor, pair))
		return;
	others_at(d, &pair[0], r->time_s, r->peak_g, a);
	height = instant = begin(&pair[0]);
	for (int i = 0; i < 2; i++)
		zero[i] = zero_of(&pair[i]);
	of_length(d, &height, pair, a, 1.0, zero, 1.0 / UNITS_PI);
	item_add(d, r->sensor, "peak_g", "g", r->peak_g, r->sigma_g, &height);
	late_length(d, &instant, pair, a);
	budget_within(&instant, BUDGET_CLOCK, clock_of(pair[0].used) * r->time_s);
	item_add(d, r->sensor, "time_s", "s", r->time_s, r->sigma_time_s, &instant);
}

static void of_lag(struct desk *d)
{
	const struct estimate_lag *lag = &d->analysis->lag;
	struct budget_sum c = {.degrees = (double)INFINITY};

	for (size_t i = 0; i < d->analysis->resultant_count; i++) {
		const struct estimate_resultant *r = &d->analysis->resultants[i];
		struct axis pair[2];
		double a[3];

		if (!pair_of(d, r->sensor, pair))
			return;
		others_at(d, &pair[0], r->time_s, r->peak_g, a);
		late_length(d, &c, pair, a);
	}
	item_add(d, "", "lag.largest_peak_s", "s", lag->largest_peak_s, lag->sigma_s, &c);
	item_add(d, "", "lag.driven.lag_s", "s", lag->driven_s, lag->sigma_driven_s, &c);
}

static void of_rebound(struct desk *d)
{
	const struct estimate_rebound *r = &d->analysis->rebound;
	struct budget_sum c, flight = {.degrees = (double)INFINITY};
	struct axis pair[2];
	double a[3], v[2], zero[2];

	if (!pair_of(d, "S2", pair))
		return;
	others_area(d, &pair[0], 0.0, a);
	for (int i = 0; i < 2; i++) {
		v[i] = a[pair[i].axis] = pair[i].e->pulse.velocity_change_m_s;
		zero[i] = UNITS_G_M_S2 * zero_of(&pair[i]) * duration_of(&pair[i]);
	}
	c = begin(&pair[0]);
	of_length(d, &c, pair, a, (1.0 + r->velocity_ratio) / hypot(v[0], v[1]), zero, 0.5);
	item_add(d, "", "rebound.velocity_ratio", "1", r->velocity_ratio, r->sigma_velocity_ratio, &c);
	budget_within(&flight, BUDGET_CLOCK, clock_of(pair[0].used) * r->flight_ratio);
	item_add(d, "", "rebound.flight_ratio", "1", r->flight_ratio, r->sigma_flight_ratio, &flight);
}

/* Of the fitted body: its own uncertainty holds noise and the channels' gains by the fit's prior. What the
 * body leaves unexplained is the doubt of its definition: chi-square of that many degrees is 1 where it is
 * the body. */
static void of_motion(struct desk *d)
{
	const struct estimate_motion *m = &d->analysis->motion;
	const struct {
		const char *key, *unit;
		double value, noise, late, follows;
	} number[] = {{"contact_time_s", "s", m->contact_time_s, m->sigma_contact_time_s, 0.0, 1.0},
	              {"restitution", "1", m->restitution, m->sigma_restitution, 0.0, 0.0},
	              {"spin_rad_s", "rad/s", m->spin_rad_s, m->sigma_spin_rad_s, 0.0, 1.0},
	              {"lag_s", "s", m->lag_s, m->sigma_lag_s, 1.0, 0.0},
	              {"lag_x_s", "s", m->lag_x_s, m->sigma_lag_x_s, 1.0, 0.0},
	              {"angle_deg", "deg", m->angle_deg, m->sigma_angle_deg, 0.0, 0.0},
	              {"speed_m_s", "m/s", m->speed_m_s, m->sigma_speed_m_s, 0.0, 0.0}};
	struct axis one[2], two[2];

	if (m->status != ESTIMATE_OK || !pair_of(d, "S1", one) || !pair_of(d, "S2", two))
		return;
	for (size_t i = 0; i < sizeof(number) / sizeof(number[0]); i++) {
		struct budget_sum c = {.degrees = (double)INFINITY};
		char what[48];

		budget_collect(&c, BUDGET_DEFINITION, COVERAGE_NORMAL,
		               number[i].noise * sqrt(fmax(0.0, m->chi_square - 1.0)));
		late(&c, &one[0], number[i].late);
		late(&c, &two[0], number[i].late);
		budget_within(&c, BUDGET_CLOCK, clock_of(two[0].used) * number[i].value * number[i].follows);
		snprintf(what, sizeof(what), "motion.%s", number[i].key);
		item_add(d, "", what, number[i].unit, number[i].value, number[i].noise, &c);
	}
}

/* ---- all of it ---- */

int budget_make(struct budget *budget, const struct sensors *sensors, const struct record *record,
                const struct analysis *analysis)
{
	struct desk d = {.sensors = sensors, .record = record, .analysis = analysis, .budget = budget};
	struct axis pair[2];

	*budget = (struct budget){.count = 0};
	for (size_t i = 0; i < analysis->channel_count; i++)
		of_channel(&d, i);
	for (size_t i = 0; i < analysis->resultant_count; i++)
		of_resultant(&d, &analysis->resultants[i]);
	if (analysis->has_lag)
		of_lag(&d);
	if (analysis->has_plate && pair_of(&d, "S1", pair))
		of_decay(&d, pair[0].used, "", "plate", &analysis->plate, begin(&pair[0]).degrees);
	if (analysis->has_rebound)
		of_rebound(&d);
	if (analysis->has_motion)
		of_motion(&d);
	for (size_t i = 0; i < budget->count; i++)
		budget->item[i].largest_parts = budget->item[i].largest;
	if (!d.failed)
		return 0;
	budget_free(budget);
	return DT_E_MEMORY;
}

void budget_free(struct budget *budget)
{
	free(budget->item);
	*budget = (struct budget){.count = 0};
}

const struct budget_item *budget_find(const struct budget *budget, const char *what)
{
	for (size_t i = 0; budget != NULL && i < budget->count; i++)
		if (strcmp(budget->item[i].what, what) == 0)
			return &budget->item[i];
	return NULL;
}
