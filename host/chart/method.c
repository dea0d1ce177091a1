/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/chart/method.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "host/chart/product.h"

#define GROSS 0.15

static const struct quantity_text texts[QUANTITIES] = {
        [QUANTITY_PEAK] = {"peak", "Peak of one axis (S2 X)", "g", 1, 3, false},
        /* without a family an instant costs four times the bound: that is no failure */
        [QUANTITY_PEAK_TIME] = {"peak-time", "Instant of one axis' peak (S2 X)", "us", 1e6, 6, false},
        [QUANTITY_RESULTANT] = {"resultant", "Resultant of X and Y (S2)", "g", 1, 3, false},
        [QUANTITY_PLATE_PEAK] = {"plate-peak", "Peak of the plate (S1 X)", "g", 1, 3, true},
        [QUANTITY_LAG] = {"lag", "Time from S2's peak to S1's (X)", "us", 1e6, 3, true},
        [QUANTITY_FREQUENCY] = {"frequency", "Damped frequency of the plate (S1)", "Hz", 1, 3, true},
        [QUANTITY_DAMPING] = {"damping", "Damping ratio of the plate (S1)", "%", 100, 3, true},
        [QUANTITY_CONTACT] = {"contact", "Contact time (S2 X)", "us", 1e6, 3, false},
        [QUANTITY_VELOCITY] = {"velocity", "Velocity change (S2 X)", "mm/s", 1e3, 3, false},
};

const struct quantity_text *quantity_text(enum quantity quantity)
{
	return &texts[quantity];
}

/* ---- a trial ------------------------------------------------------------------------------------------- */

/* Pre-trigger mean off, holes bridged; what is missing at an end repeats the last that is there. */
static void method_bridge(const struct channel *channel, size_t quiet, double *y)
{
	double sum = 0, last = NAN;
	size_t n = 0, from = 0;

	for (size_t k = 0; k < quiet; k++)
		if (!channel->sample[k]) {
			sum += channel->value_g[k];
			n++;
		}
	for (size_t k = 0; k < channel->count; k++) {
		double value = channel->value_g[k] - (n > 0 ? sum / (double)n : 0);

		if (channel->sample[k])
			continue;
		for (size_t i = from; i <= k; i++)
			y[i] = isnan(last) ? value
			                   : last + (value - last) * (double)(i + 1 - from) /
			                                     (double)(k + 1 - from);
		last = value;
		from = k + 1;
	}
	for (size_t i = from; i < channel->count; i++)
		y[i] = isnan(last) ? 0 : last;
}

static double method_contact_end(const struct synthetic *synthetic)
{
	const struct synthetic_axis *axis = &synthetic->signal[0].axis;

	return synthetic->onset_s + axis->onset_s + axis->contact_s + fmax(0, axis->delay_s);
}

static int method_make_series(struct trial *trial)
{
	const struct synthetic *synthetic = trial->synthetic;
	size_t total = 0, from;
	double *next;

	for (int i = 0; i < SYNTHETIC_CHANNELS; i++)
		total += synthetic->record.channels[i].count;
	next = trial->memory = malloc(total * sizeof(*next));
	if (!next)
		return DT_E_MEMORY;
	for (int i = 0; i < SYNTHETIC_CHANNELS; i++) {
		const struct channel *channel = &synthetic->record.channels[i];

		method_bridge(channel, (size_t)((synthetic->scene.pre_s - 5e-3) * channel->rate_hz), next);
		trial->series[i] = (struct reference_series){next, channel->count, channel->rate_hz};
		next += channel->count;
	}
	trial->decay = trial->series[SYNTHETIC_S1X];
	from = (size_t)ceil(method_contact_end(synthetic) * trial->decay.rate_hz);
	from = from < trial->decay.count ? from : trial->decay.count;
	trial->decay.y += from;
	trial->decay.count -= from;
	return 0;
}

int trial_open(struct trial *trial, const struct synthetic *synthetic)
{
	static const struct estimate_options options[TELLINGS] = {
	        [TELL_HALF_SINE] = {.family = ESTIMATE_FAMILY_HALF_SINE},
	        [TELL_SINE_POWER] = {.family = ESTIMATE_FAMILY_SINE_POWER},
	};
	int status;

	*trial = (struct trial){.synthetic = synthetic, .truth = synthetic_truth(synthetic)};
	status = method_make_series(trial);
	for (int i = 0; i < TELLINGS && !status; i++)
		status = estimate_record(&synthetic->record, &options[i], &trial->analysis[i]);
	if (!status) {
		trial->product = product_open(&synthetic->record, method_contact_end(synthetic));
		status = trial->product ? 0 : DT_E_MEMORY;
	}
	if (status)
		trial_close(trial);
	return status;
}

void trial_close(struct trial *trial)
{
	free(trial->memory);
	for (int i = 0; i < TELLINGS; i++)
		estimate_free(&trial->analysis[i]);
	product_close(trial->product);
	memset(trial, 0, sizeof(*trial));
}

/* What a method makes of trial t; of its own, what it says of that. */
#define VALUE(name, value)                        \
	static double name(const struct trial *t) \
	{                                         \
		return value;                     \
	}
#define HOW(name, how)                                                \
	static const struct estimate_how *name(const struct trial *t) \
	{                                                             \
		return how;                                           \
	}

/* ---- others' methods ----------------------------------------------------------------------------------- */

static struct reference_pulse gsl_pulse(const struct trial *t)
{
	struct reference_pulse pulse;

	if (!reference_fit_pulse(&t->series[SYNTHETIC_S2X], &pulse))
		return (struct reference_pulse){NAN, NAN, NAN};
	return pulse;
}

VALUE(method_largest, reference_maximum(&t->series[SYNTHETIC_S2X]).value)
VALUE(largest_time, reference_maximum(&t->series[SYNTHETIC_S2X]).time_s)
VALUE(method_parabola, reference_parabola(&t->series[SYNTHETIC_S2X]).value)
VALUE(parabola_time, reference_parabola(&t->series[SYNTHETIC_S2X]).time_s)
VALUE(gsl_peak, gsl_pulse(t).value)
VALUE(gsl_peak_time, gsl_pulse(t).time_s)
VALUE(gsl_contact, gsl_pulse(t).base_s)
VALUE(two_maxima, hypot(reference_maximum(&t->series[SYNTHETIC_S2X]).value,
                        reference_maximum(&t->series[SYNTHETIC_S2Y]).value))
VALUE(method_drawn, reference_resultant(&t->series[SYNTHETIC_S2X], &t->series[SYNTHETIC_S2Y]))
VALUE(plate_largest, reference_maximum(&t->series[SYNTHETIC_S1X]).value)
VALUE(plate_parabola, reference_parabola(&t->series[SYNTHETIC_S1X]).value)
VALUE(maxima_apart, reference_maximum(&t->series[SYNTHETIC_S1X]).time_s -
                            reference_maximum(&t->series[SYNTHETIC_S2X]).time_s)
VALUE(parabolas_apart, reference_parabola(&t->series[SYNTHETIC_S1X]).time_s -
                               reference_parabola(&t->series[SYNTHETIC_S2X]).time_s)
VALUE(correlation, reference_correlation(&t->series[SYNTHETIC_S2X], &t->series[SYNTHETIC_S1X]))
VALUE(crossings, reference_crossings(&t->decay).hz)
VALUE(spectrum_hz, reference_spectrum(&t->decay).hz)
VALUE(spectrum_damping, reference_spectrum(&t->decay).damping)
VALUE(method_decrement, reference_decrement(&t->decay).damping)
VALUE(pencil_hz, reference_pencil(&t->decay).hz)
VALUE(pencil_damping, reference_pencil(&t->decay).damping)
VALUE(gsl_hz, reference_fit_decay(&t->decay).hz)
VALUE(gsl_damping, reference_fit_decay(&t->decay).damping)
VALUE(width, reference_width(&t->series[SYNTHETIC_S2X]))
VALUE(area_width, reference_area_width(&t->series[SYNTHETIC_S2X]))
VALUE(long_sum, reference_velocity(&t->series[SYNTHETIC_S2X], t->truth.contact_s))

/* ---- the product's --------------------------------------------------------------------------------------
 */

static const struct estimate_channel *x_of(const struct trial *t, enum telling telling)
{
	return &t->analysis[telling].channels[SYNTHETIC_S2X];
}

/* Value, doubt and cost of a quantity that depends on what the product is told. */
#define TOLD(name, telling, family, field, doubt, job)                      \
	static double name(const struct trial *t)                           \
	{                                                                   \
		return x_of(t, telling)->field;                             \
	}                                                                   \
	static const struct estimate_how *name##_how(const struct trial *t) \
	{                                                                   \
		return &x_of(t, telling)->doubt;                            \
	}                                                                   \
	static void name##_work(const struct trial *t)                      \
	{                                                                   \
		job(t->product, family);                                    \
	}

TOLD(our_peak, TELL_NOTHING, ESTIMATE_FAMILY_AUTO, peak.value_g, peak.how, product_peak)
TOLD(our_power_peak, TELL_SINE_POWER, ESTIMATE_FAMILY_SINE_POWER, peak.value_g, peak.how, product_peak)
TOLD(our_told_peak, TELL_HALF_SINE, ESTIMATE_FAMILY_HALF_SINE, peak.value_g, peak.how, product_peak)
TOLD(our_time, TELL_NOTHING, ESTIMATE_FAMILY_AUTO, peak.time_s, peak.how, product_peak)
TOLD(our_power_time, TELL_SINE_POWER, ESTIMATE_FAMILY_SINE_POWER, peak.time_s, peak.how, product_peak)
TOLD(our_told_time, TELL_HALF_SINE, ESTIMATE_FAMILY_HALF_SINE, peak.time_s, peak.how, product_peak)
TOLD(our_contact, TELL_NOTHING, ESTIMATE_FAMILY_AUTO, pulse.contact_time_s, pulse.contact, product_pulse)
TOLD(our_told_contact, TELL_HALF_SINE, ESTIMATE_FAMILY_HALF_SINE, pulse.contact_time_s, pulse.contact,
     product_pulse)
TOLD(our_sum, TELL_NOTHING, ESTIMATE_FAMILY_AUTO, pulse.velocity_change_m_s, peak.how, product_pulse)
TOLD(our_area, TELL_NOTHING, ESTIMATE_FAMILY_AUTO, pulse.fitted_velocity_m_s, pulse.contact, product_pulse)
TOLD(our_told_area, TELL_HALF_SINE, ESTIMATE_FAMILY_HALF_SINE, pulse.fitted_velocity_m_s, pulse.contact,
     product_pulse)

VALUE(our_resultant, t->analysis[TELL_NOTHING].resultants[1].peak_g)
VALUE(our_told_resultant, t->analysis[TELL_HALF_SINE].resultants[1].peak_g)
HOW(our_resultant_how, &t->analysis[TELL_NOTHING].resultants[1].how)
HOW(our_told_resultant_how, &t->analysis[TELL_HALF_SINE].resultants[1].how)

/* Both axes' peaks are part of it. */
static void our_resultant_work(const struct trial *t)
{
	product_peak(t->product, ESTIMATE_FAMILY_AUTO);
	product_peak(t->product, ESTIMATE_FAMILY_AUTO);
	product_resultant(t->product);
}

static void our_told_resultant_work(const struct trial *t)
{
	product_peak(t->product, ESTIMATE_FAMILY_HALF_SINE);
	product_peak(t->product, ESTIMATE_FAMILY_HALF_SINE);
	product_resultant(t->product);
}

VALUE(our_smooth_plate_peak, product_plate_peak(t->product))

static const struct estimate_channel *plate_x(const struct trial *t)
{
	return &t->analysis[TELL_NOTHING].channels[SYNTHETIC_S1X];
}

VALUE(our_plate_peak, plate_x(t)->peak.value_g)
HOW(our_plate_peak_how, &plate_x(t)->peak.how)
VALUE(our_peaks_apart, t->analysis[TELL_NOTHING].lag.largest_peak_s)
VALUE(our_driven, t->analysis[TELL_NOTHING].lag.driven_axis_s[0])
HOW(our_driven_how, &t->analysis[TELL_NOTHING].lag.driven)

static void our_lag_work(const struct trial *t)
{
	product_lag(t->product);
}

static const struct estimate_ringdown *decay_of(const struct trial *t)
{
	return &plate_x(t)->ringdown;
}

VALUE(our_hz, decay_of(t)->frequency_hz)
VALUE(our_damping, decay_of(t)->damping_ratio)
HOW(our_decay_how, &decay_of(t)->how)

static void our_decay_work(const struct trial *t)
{
	product_decay(t->product);
}

VALUE(our_plate_hz,
      t->analysis[TELL_NOTHING].has_plate ? t->analysis[TELL_NOTHING].plate.frequency_hz : (double)NAN)
VALUE(our_plate_damping,
      t->analysis[TELL_NOTHING].has_plate ? t->analysis[TELL_NOTHING].plate.damping_ratio : (double)NAN)
HOW(our_plate_how,
    t->analysis[TELL_NOTHING].has_plate ? &t->analysis[TELL_NOTHING].plate.how : our_decay_how(t))

static void our_plate_work(const struct trial *t)
{
	product_decays(t->product);
}

/* ---- all -------------------------------------------------------------------------------------------------
 */

#define BOUND(field) offsetof(struct bound, field)
#define OTHERS(name, quantity, bound, value)                                  \
	{                                                                     \
		name, quantity, false, false, BOUND(bound), value, NULL, NULL \
	}
#define OURS(name, quantity, bound, value, as)                                        \
	{                                                                             \
		name, quantity, true, false, BOUND(bound), value, as##_work, as##_how \
	}
#define OURS_TOLD(name, quantity, bound, value, as)                                  \
	{                                                                            \
		name, quantity, true, true, BOUND(bound), value, as##_work, as##_how \
	}

static const struct method methods[] = {
        OTHERS("largest sample", QUANTITY_PEAK, peak_g[0], method_largest),
        OTHERS("parabola", QUANTITY_PEAK, peak_g[0], method_parabola),
        {"GSL fit, half-sine", QUANTITY_PEAK, false, true, BOUND(peak_g[0]), gsl_peak, NULL, NULL},
        OURS("default", QUANTITY_PEAK, peak_g[0], our_peak, our_peak),
        OURS("sine-power", QUANTITY_PEAK, peak_g[0], our_power_peak, our_power_peak),
        OURS_TOLD("half-sine", QUANTITY_PEAK, peak_g[0], our_told_peak, our_told_peak),

        OTHERS("largest sample", QUANTITY_PEAK_TIME, peak_s[0], largest_time),
        OTHERS("parabola", QUANTITY_PEAK_TIME, peak_s[0], parabola_time),
        {"GSL fit, half-sine", QUANTITY_PEAK_TIME, false, true, BOUND(peak_s[0]), gsl_peak_time, NULL, NULL},
        OURS("default", QUANTITY_PEAK_TIME, peak_s[0], our_time, our_time),
        OURS("sine-power", QUANTITY_PEAK_TIME, peak_s[0], our_power_time, our_power_time),
        OURS_TOLD("half-sine", QUANTITY_PEAK_TIME, peak_s[0], our_told_time, our_told_time),

        OTHERS("hypot of the maxima", QUANTITY_RESULTANT, resultant_g, two_maxima),
        OTHERS("X drawn to Y's instants", QUANTITY_RESULTANT, resultant_g, method_drawn),
        OURS("default", QUANTITY_RESULTANT, resultant_g, our_resultant, our_resultant),
        OURS_TOLD("half-sine", QUANTITY_RESULTANT, resultant_g, our_told_resultant, our_told_resultant),

        OTHERS("largest sample", QUANTITY_PLATE_PEAK, plate_g[0], plate_largest),
        OTHERS("parabola", QUANTITY_PLATE_PEAK, plate_g[0], plate_parabola),
        {"smooth curve", QUANTITY_PLATE_PEAK, true, false, BOUND(plate_g[0]), our_smooth_plate_peak, NULL,
         NULL},
        {"driven oscillator", QUANTITY_PLATE_PEAK, true, false, BOUND(plate_g[0]), our_plate_peak,
         our_lag_work, our_plate_peak_how},

        OTHERS("largest samples", QUANTITY_LAG, lag_s[0], maxima_apart),
        OTHERS("parabolas", QUANTITY_LAG, lag_s[0], parabolas_apart),
        OTHERS("cross-correlation", QUANTITY_LAG, lag_s[0], correlation),
        {"resultants' peaks", QUANTITY_LAG, true, false, BOUND(lag_s[0]), our_peaks_apart, our_lag_work,
         NULL},
        {"driven oscillator", QUANTITY_LAG, true, false, BOUND(lag_s[0]), our_driven, our_lag_work,
         our_driven_how},

        OTHERS("zero crossings", QUANTITY_FREQUENCY, damped_hz[0], crossings),
        OTHERS("FFT peak", QUANTITY_FREQUENCY, damped_hz[0], spectrum_hz),
        OTHERS("matrix pencil", QUANTITY_FREQUENCY, damped_hz[0], pencil_hz),
        OTHERS("GSL fit", QUANTITY_FREQUENCY, damped_hz[0], gsl_hz),
        OURS("X", QUANTITY_FREQUENCY, damped_hz[0], our_hz, our_decay),
        OURS("X and Y", QUANTITY_FREQUENCY, pair_hz, our_plate_hz, our_plate),

        OTHERS("log decrement", QUANTITY_DAMPING, damping[0], method_decrement),
        OTHERS("half-power width", QUANTITY_DAMPING, damping[0], spectrum_damping),
        OTHERS("matrix pencil", QUANTITY_DAMPING, damping[0], pencil_damping),
        OTHERS("GSL fit", QUANTITY_DAMPING, damping[0], gsl_damping),
        OURS("X", QUANTITY_DAMPING, damping[0], our_damping, our_decay),
        OURS("X and Y", QUANTITY_DAMPING, pair_damping, our_plate_damping, our_plate),

        {"10 % width x 1.068", QUANTITY_CONTACT, false, true, BOUND(contact_s[0]), width, NULL, NULL},
        {"pi dv / 2 A", QUANTITY_CONTACT, false, true, BOUND(contact_s[0]), area_width, NULL, NULL},
        {"GSL fit, half-sine", QUANTITY_CONTACT, false, true, BOUND(contact_s[0]), gsl_contact, NULL, NULL},
        OURS("best family", QUANTITY_CONTACT, contact_s[0], our_contact, our_contact),
        OURS_TOLD("half-sine", QUANTITY_CONTACT, contact_s[0], our_told_contact, our_told_contact),

        OTHERS("sum over +-3 contacts", QUANTITY_VELOCITY, velocity_m_s[0], long_sum),
        OURS("sum over the pulse", QUANTITY_VELOCITY, velocity_m_s[0], our_sum, our_sum),
        OURS("best family", QUANTITY_VELOCITY, velocity_m_s[0], our_area, our_area),
        OURS_TOLD("half-sine", QUANTITY_VELOCITY, velocity_m_s[0], our_told_area, our_told_area),
};

const struct method *method_table(size_t *count)
{
	*count = sizeof(methods) / sizeof(methods[0]);
	return methods;
}

double method_truth(const struct method *method, const struct trial *trial)
{
	const struct synthetic_truth *truth = &trial->truth;
	const double values[QUANTITIES] = {
	        [QUANTITY_PEAK] = truth->peak_g[0],        [QUANTITY_PEAK_TIME] = truth->peak_s[0],
	        [QUANTITY_RESULTANT] = truth->resultant_g, [QUANTITY_PLATE_PEAK] = truth->plate_g[0],
	        [QUANTITY_LAG] = truth->lag_s[0],          [QUANTITY_FREQUENCY] = truth->damped_hz,
	        [QUANTITY_DAMPING] = truth->damping,       [QUANTITY_CONTACT] = truth->contact_s,
	        [QUANTITY_VELOCITY] = truth->velocity_m_s,
	};

	return values[method->quantity];
}

double method_gross(const struct method *method, const struct trial *trial)
{
	return GROSS * (method->quantity == QUANTITY_PEAK_TIME ? trial->truth.contact_s
	                                                       : fabs(method_truth(method, trial)));
}
