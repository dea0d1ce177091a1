/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The uncertainty budget: the distribution of a sum against draws, one peak's budget worked out by hand, and
 * drops whose chain errors are drawn from the sensor's file, of which U must cover as many as it says. DROPS:
 * how many of each pulse (make accuracy: thousands).
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "host/estimate/estimate.h"
#include "host/sensor/budget.h"
#include "tests/unit/near.h"
#include "tests/unit/scratch.h"
#include "tests/unit/synth.h"

#define PI 3.14159265358979323846

/* ---- distributions ---- */

static double draw(struct synth_random *random, enum coverage_law law, double u)
{
	if (law == COVERAGE_NORMAL)
		return u * synth_normal(random);
	return law == COVERAGE_RECTANGULAR ? u * sqrt(3) * (2 * synth_uniform(random) - 1)
	                                   : u * sqrt(2) * cos(2 * PI * synth_uniform(random));
}

/* Parts of that many draws within +-limit. */
static double covered(const enum coverage_law *law, const double *u, size_t count, double limit, int draws)
{
	struct synth_random random = {7};
	int inside = 0;

	for (int n = 0; n < draws; n++) {
		double sum = 0;

		for (size_t i = 0; i < count; i++)
			sum += draw(&random, law[i], u[i]);
		inside += fabs(sum) < limit;
	}
	return (double)inside / draws;
}

/* Single laws in closed form; sums against draws. */
static void distributions(void **state)
{
	static const enum coverage_law law[] = {COVERAGE_ARCSINE, COVERAGE_NORMAL, COVERAGE_RECTANGULAR,
	                                        COVERAGE_RECTANGULAR, COVERAGE_NORMAL};
	static const double u[][5] = {{2, 1, 0.6, 0.6, 0.3},
	                              {2, 0.05, 0, 0, 0},
	                              {0.2, 0.1, 2, 0.5, 0.1},
	                              {0.1, 2, 0.1, 0.2, 0.3},
	                              {1, 0, 1, 1, 0}};
	struct coverage one = {.count = 0};

	(void)state;
	assert_near(coverage_expanded(&one), 0, 0);
	coverage_add(&one, COVERAGE_NORMAL, 3);
	assert_near(coverage_expanded(&one), 6, 1e-4);
	one = (struct coverage){.count = 0};
	coverage_add(&one, COVERAGE_RECTANGULAR, 1);
	assert_near(coverage_expanded(&one), COVERAGE_PROBABILITY * sqrt(3), 2e-3);
	one = (struct coverage){.count = 0};
	coverage_add(&one, COVERAGE_ARCSINE, 1);
	assert_near(coverage_expanded(&one), sqrt(2) * sin(COVERAGE_PROBABILITY * PI / 2), 2e-3);
	for (size_t i = 0; i < sizeof(u) / sizeof(u[0]); i++) {
		struct coverage c = {.count = 0};

		for (int k = 0; k < 5; k++)
			coverage_add(&c, law[k], u[i][k]);
		assert_near(covered(law, u[i], 5, coverage_expanded(&c), 100000), COVERAGE_PROBABILITY,
		            0.0026); /* four times what 10^5 draws scatter */
	}
}

static void factors(void **state)
{
	static const double k[] = {13.968, 4.527, 3.307};
	const double u[] = {1, 2, 2}, degrees[] = {4, INFINITY, 16};

	(void)state;
	for (int nu = 1; nu <= 3; nu++)
		assert_near(coverage_factor(nu), k[nu - 1], 5.1e-4);
	for (int nu = 4; nu < 400; nu++) /* a formula for all others, good to 0.3 % at 4 */
		assert_near_part(2 + 2.5 / nu + 3.0625 / (nu * nu) + 2.859 / pow(nu, 3), coverage_factor(nu),
		                 0.0031);
	assert_near(coverage_factor(INFINITY), 2, 1e-4);
	assert_near(coverage_degrees(u, degrees, 3), 81 / (1.0 / 4 + 16.0 / 16), 1e-9);
	assert_true(isinf(coverage_degrees(u + 1, degrees + 1, 1)));
}

/* ---- a peak by hand ---- */

/* A half-sine of 500 g and 3 ms on X, Y by the tangent of 30 deg, Z nothing. */
struct by_hand {
	struct record record;
	struct estimate_channel channels[3];
	struct analysis analysis;
	struct sensors sensors;
};

static void by_hand_open(struct by_hand *b)
{
	static const char *const name[] = {"S2X", "S2Y", "S2Z"};
	static const double height[] = {500, 500 * 0.57735026919, 0};

	memset(b, 0, sizeof(*b));
	record_init(&b->record);
	for (int i = 0; i < 3; i++) {
		struct channel *c = record_add_channel(&b->record, name[i], 10000, 400);
		struct estimate_channel *e = &b->channels[i];

		assert_non_null(c);
		for (size_t k = 0; k < c->count; k++) {
			c->value_g[k] =
			        height[i] * synth_pulse(SYNTH_HALF_SINE, ((double)k / 1e4 - 0.01) / 3e-3);
			c->sample[k] = 0;
		}
		e->baseline.samples = 100;
		e->peak =
		        (struct estimate_peak){height[i], i < 2 ? 0.0017 * height[i] : NAN, 0.0115, NAN, {0}};
		e->pulse = (struct estimate_pulse){.duration_s = 3e-3 * 0.936,
		                                   .sigma_duration_s = NAN,
		                                   .start_s = 0.0101,
		                                   .end_s = 0.0129,
		                                   .velocity_change_m_s = NAN,
		                                   .contact_time_s = NAN,
		                                   .fitted_velocity_m_s = NAN};
		e->ringdown.frequency_hz = e->ringdown.natural_frequency_hz = e->ringdown.damping_ratio = NAN;
	}
	b->analysis = (struct analysis){.channels = b->channels, .channel_count = 3, .resultant_count = 1};
	b->analysis.resultants[0] =
	        (struct estimate_resultant){"S2", 500 / cos(PI / 6), 1, 0.0115, NAN, true, 0, {0}};
}

static const char catalogue[] = "[sensor]\nserial = 1\nchannels = S2X S2Y S2Z\n"
                                "[calibration]\ncertificate = C\ndate = 2026-01-01\ndue = 2027-01-01\n"
                                "sensitivity_x_mv_g = 10\nsensitivity_y_mv_g = 10\nsensitivity_z_mv_g = 10\n"
                                "[chain]\nscaled_x_mv_g = 10\nscaled_y_mv_g = 10\nscaled_z_mv_g = 10\n";

static void read_sensor(struct sensors *sensors, const char *tail)
{
	char path[SCRATCH_MAX], message[SETTINGS_MESSAGE_MAX];
	int fd = mkstemp(scratch_name(path, "sensor"));
	FILE *out = fdopen(fd, "w");

	assert_non_null(out);
	fprintf(out, "%s%s", catalogue, tail);
	assert_int_equal(fclose(out), 0);
	assert_int_equal(sensors_read(sensors, path, 20454 + 0.5 * 365.25, message),
	                 0); /* half a year later */
	unlink(path);
}

static double share(const struct budget_item *item, enum budget_part part)
{
	return 100 * pow(item->part[part] / item->u, 2);
}

/* Catalogue data. Of 500 g, in %: transverse 5 x tan 30 / sqrt 2 = 2.04, sensitivity 1.00, linearity and
 * response .58, alignment, drift, mounting .29, noise .17, gain .15, temperature .14, zero .06, supply .04:
 * u 2.48 %. */
static void catalogue_peak(void **state)
{
	static const enum coverage_law law[] = {
	        COVERAGE_ARCSINE,     COVERAGE_NORMAL,      COVERAGE_RECTANGULAR, COVERAGE_RECTANGULAR,
	        COVERAGE_RECTANGULAR, COVERAGE_RECTANGULAR, COVERAGE_RECTANGULAR, COVERAGE_NORMAL,
	        COVERAGE_NORMAL,      COVERAGE_RECTANGULAR, COVERAGE_RECTANGULAR, COVERAGE_RECTANGULAR};
	static const double u[] = {10.206, 5,    2.887, 2.887, 1.454, 1.443,
	                           1.443,  0.85, 0.75,  0.722, 0.289, 0.22};
	const struct budget_item *item;
	struct budget budget;
	struct by_hand b;

	(void)state;
	by_hand_open(&b);
	read_sensor(&b.sensors, "tau_s = 0.5\n");
	assert_int_equal(budget_make(&budget, &b.sensors, &b.record, &b.analysis), 0);
	item = budget_find(&budget, "S2X.peak.value_g");
	assert_non_null(item);
	assert_near(100 * item->u / 500, 2.48, 0.005);
	assert_near(coverage_factor(item->degrees) * item->u, 24.8, 0.05);
	assert_near(item->expanded, 23.05, 0.02); /* 4 x 10^6 draws: 23.05, printed as 23 */
	assert_string_equal(item->method, "distribution");
	assert_near(share(item, BUDGET_TRANSVERSE), 68, 0.5);
	assert_near(share(item, BUDGET_SENSITIVITY), 18,
	            0.6); /* with drift, gain and temperature: 16 + 1.4 + .7 */
	assert_near(share(item, BUDGET_LINEARITY), 5, 0.5);
	assert_near(share(item, BUDGET_RESPONSE), 5, 0.5);
	assert_near(item->part[BUDGET_FILTER] / 5, 0.04, 0.005);
	assert_near(item->part[BUDGET_ZERO] / 5, 0.06, 0.005);
	assert_string_equal(item->largest, "transverse 68 %, sensitivity 18 %, linearity 5 %");
	assert_near(covered(law, u, 12, item->expanded, 400000), COVERAGE_PROBABILITY, 0.0013);
	budget_free(&budget);

	read_sensor(&b.sensors, "tau_s = 0.5\n[calibration]\nmatrix_xy = 0.03\n");
	assert_int_equal(budget_make(&budget, &b.sensors, &b.record, &b.analysis), 0);
	item = budget_find(&budget, "S2X.peak.value_g");
	assert_near(100 * item->u / 500, 1.44, 0.005);
	assert_near(coverage_factor(item->degrees) * item->u, 14.4, 0.05);
	assert_near(item->expanded, 14.4, 0.25); /* the linear rule agrees with the distribution */
	assert_near(share(item, BUDGET_LINEARITY), 16, 0.5);
	assert_near(share(item, BUDGET_RESPONSE), 16, 0.5);
	budget_free(&budget);
	record_free(&b.record);
}

/* Y is not recorded: 10 % of it is not taken off, and it is taken for half of X. Half-width 25 g of 500 g. */
static void matrix_without_axis(void **state)
{
	const struct budget_item *item;
	struct budget budget;
	struct by_hand b;
	double before;

	(void)state;
	by_hand_open(&b);
	snprintf(b.record.channels[1].name, sizeof(b.record.channels[1].name), "else");
	read_sensor(&b.sensors, "[calibration]\nmatrix_xz = 0.1\n");
	assert_int_equal(budget_make(&budget, &b.sensors, &b.record, &b.analysis), 0);
	before = budget_find(&budget, "S2X.peak.value_g")->part[BUDGET_TRANSVERSE];
	budget_free(&budget);
	read_sensor(&b.sensors, "[calibration]\nmatrix_xy = 0.1\n");
	assert_int_equal(budget_make(&budget, &b.sensors, &b.record, &b.analysis), 0);
	item = budget_find(&budget, "S2X.peak.value_g");
	assert_near(item->part[BUDGET_TRANSVERSE], hypot(before, 25 / sqrt(3)), 1e-6);
	budget_free(&budget);
	record_free(&b.record);
}

/* Without a width nobody knows what a filter does to the height: no budget rather than one without it. */
static void peak_without_width(void **state)
{
	struct budget budget;
	struct by_hand b;

	(void)state;
	by_hand_open(&b);
	b.channels[0].pulse.duration_s = NAN;
	read_sensor(&b.sensors, "tau_s = 0.5\n");
	assert_int_equal(budget_make(&budget, &b.sensors, &b.record, &b.analysis), 0);
	assert_null(budget_find(&budget, "S2X.peak.value_g"));
	assert_non_null(budget_find(&budget, "S2Y.peak.value_g"));
	budget_free(&budget);
	read_sensor(&b.sensors,
	            "filter = bessel\ncutoff_x_hz = 9000\ncutoff_y_hz = 9000\ncutoff_z_hz = 9000\n");
	assert_int_equal(budget_make(&budget, &b.sensors, &b.record, &b.analysis), 0);
	assert_near(budget_find(&budget, "S2X.peak.value_g")->part[BUDGET_FILTER], 500 * 0.2 / sqrt(3), 1e-6);
	budget_free(&budget);
	record_free(&b.record);
}

/* Names as long as a channel may have keep each number's own. */
static void long_name(void **state)
{
	static const char name[] = "11HEADLEFT00ACXA-of-the-dummy-X";
	char what[100];
	struct budget budget;
	struct by_hand b;

	(void)state;
	by_hand_open(&b);
	assert_int_equal(sizeof(name), sizeof(b.record.channels[0].name));
	memcpy(b.record.channels[0].name, name, sizeof(name));
	b.channels[0].pulse.fitted_velocity_m_s = 5;
	b.channels[0].pulse.sigma_fitted_velocity_m_s = 0.01;
	read_sensor(&b.sensors, "");
	snprintf(b.sensors.used[0].transducer.channel[0], sizeof(b.sensors.used[0].transducer.channel[0]),
	         "%s", b.record.channels[0].name);
	assert_int_equal(budget_make(&budget, &b.sensors, &b.record, &b.analysis), 0);
	snprintf(what, sizeof(what), "%s.pulse.contact.velocity_change_m_s", b.record.channels[0].name);
	assert_non_null(budget_find(&budget, what));
	budget_free(&budget);
	record_free(&b.record);
}

/* Nothing but 2 % of each axis at 30 deg. */
static void resultant(void **state)
{
	static const struct {
		const char *correlation;
		double percent;
	} known[] = {{"correlation = 0\n", 1.58}, {"correlation = 0.9\n", 1.96}, {"correlation = 1\n", 2}};
	struct by_hand b;

	(void)state;
	by_hand_open(&b);
	for (int i = 0; i < 3; i++) {
		const struct budget_item *item;
		struct budget budget;
		char tail[600];

		snprintf(tail, sizeof(tail),
		         "gain_u_percent = 0\nmount_percent = 0\nalign_deg = 0\n[calibration]\n"
		         "expanded_percent = 4\ntransverse_percent = 0\nlinearity_percent = 0\n"
		         "response_percent = 0\ndrift_percent_year = 0\ntemperature_percent_k = 0\n"
		         "zero_shift_percent = 0\n%s",
		         known[i].correlation);
		read_sensor(&b.sensors, tail);
		assert_int_equal(budget_make(&budget, &b.sensors, &b.record, &b.analysis), 0);
		item = budget_find(&budget, "S2.peak_g");
		assert_non_null(item);
		assert_near(100 * item->part[BUDGET_SENSITIVITY] / item->value, known[i].percent, 0.0051);
		item = budget_find(&budget, "S2X.peak.value_g");
		assert_near(item->part[BUDGET_SENSITIVITY], 10, 1e-9);
		assert_string_equal(item->method, "linear");
		budget_free(&budget);
	}
	record_free(&b.record);
}

/* X alone, 2 m/s of 3 ms: zero of 0.1 % of 500 g over the pulse, the supply's 40 % of T / 2 tau, both against
 * the velocity change, times 1 + e. */
static void velocity_ratio(void **state)
{
	const struct budget_item *item;
	struct budget budget;
	struct by_hand b;

	(void)state;
	by_hand_open(&b);
	b.channels[0].pulse.velocity_change_m_s = 2;
	b.channels[1].pulse.velocity_change_m_s = 1e-9;
	b.analysis.has_rebound = true;
	b.analysis.rebound = (struct estimate_rebound){
	        .velocity_ratio = 0.4, .sigma_velocity_ratio = 1e-3, .flight_ratio = NAN};
	read_sensor(&b.sensors, "tau_s = 0.5\n");
	assert_int_equal(budget_make(&budget, &b.sensors, &b.record, &b.analysis), 0);
	item = budget_find(&budget, "rebound.velocity_ratio");
	assert_non_null(item);
	assert_near(item->part[BUDGET_ZERO], 1.4 * 9.80665 * 0.5 * 3e-3 / 2 / sqrt(3), 1e-8);
	assert_near(item->part[BUDGET_FILTER], 1.4 * 0.4 * 3e-3 / (2 * 0.5) / sqrt(3), 1e-8);
	budget_free(&budget);
	record_free(&b.record);
}

/* Half of the body's chi-square is unexplained: its definition is as unsure as its noise. A lag has both
 * sensors' skews and filters, an angle none. */
static void motion(void **state)
{
	struct estimate_channel five[5];
	struct budget budget;
	struct by_hand b;

	(void)state;
	by_hand_open(&b);
	memcpy(five, b.channels, sizeof(b.channels));
	five[3] = five[4] = five[2];
	assert_non_null(record_add_channel(&b.record, "S1X", 10000, 4));
	assert_non_null(record_add_channel(&b.record, "S1Y", 10000, 4));
	b.analysis.channels = five;
	b.analysis.channel_count = 5;
	b.analysis.has_motion = true;
	b.analysis.motion = (struct estimate_motion){.lag_s = 1e-3,
	                                             .sigma_lag_s = 1e-6,
	                                             .angle_deg = 25,
	                                             .sigma_angle_deg = 0.1,
	                                             .chi_square = 2,
	                                             .refused = "",
	                                             .status = ESTIMATE_OK};
	read_sensor(&b.sensors, "skew_u_us = 3\n");
	b.sensors.used[1] = b.sensors.used[0];
	for (int axis = 0; axis < 3; axis++)
		b.sensors.used[1].transducer.channel[axis][1] = '1';
	b.sensors.count = 2;
	assert_int_equal(budget_make(&budget, &b.sensors, &b.record, &b.analysis), 0);
	assert_near(budget_find(&budget, "motion.lag_s")->part[BUDGET_DEFINITION], 1e-6, 1e-15);
	assert_near(budget_find(&budget, "motion.lag_s")->part[BUDGET_FILTER], 3e-6 * sqrt(2), 1e-12);
	assert_near(budget_find(&budget, "motion.angle_deg")->u, 0.1 * sqrt(2), 1e-9);
	budget_free(&budget);
	b.analysis.motion.status = ESTIMATE_NOT_CONVERGED;
	assert_int_equal(budget_make(&budget, &b.sensors, &b.record, &b.analysis), 0);
	assert_null(budget_find(&budget, "motion.lag_s"));
	budget_free(&budget);
	record_free(&b.record);
}

/* Four drops of one peak: what they have in common stays, scatter is s / 2 of three degrees. */
static void mean_of_drops(void **state)
{
	struct budget_mean mean = {.count = 0};
	struct budget_item whole;
	struct budget budget;
	struct by_hand b;
	const struct budget_item *item;

	(void)state;
	by_hand_open(&b);
	read_sensor(&b.sensors, "");
	assert_int_equal(budget_make(&budget, &b.sensors, &b.record, &b.analysis), 0);
	item = budget_find(&budget, "S2X.peak.value_g");
	budget_mean_add(&mean, item);
	budget_mean_item(&mean, 500, NAN, &whole); /* of one: its own */
	assert_near(whole.u, item->u, 1e-9);
	assert_near_part(whole.expanded, item->expanded, 0.004);
	for (int i = 1; i < 4; i++)
		budget_mean_add(&mean, item);
	budget_mean_item(&mean, 500, 6, &whole);
	assert_near(whole.part[BUDGET_NOISE], 3, 1e-12);
	assert_near(whole.part[BUDGET_SENSITIVITY], item->part[BUDGET_SENSITIVITY], 1e-12);
	assert_near(whole.u, sqrt(item->u * item->u - 0.85 * 0.85 + 9), 1e-9);
	assert_true(whole.expanded > item->expanded);
	budget_mean_item(&mean, 500, 600, &whole); /* scatter alone: Student's 3.307 of three degrees */
	assert_near_part(whole.expanded, 3.307 * 300, 0.003);
	assert_string_equal(whole.largest, "scatter 100 %, transverse 0 %, sensitivity 0 %");
	budget_free(&budget);
	record_free(&b.record);
}

/* ---- drops with drawn errors ---- */

enum { QUIET_MS = 100, AFTER_MS = 180, PLATE_STEPS = 120000, CELLS_MAX = 64 };
#define BASE_S 3e-3
#define NATURAL_HZ 132.0
#define DAMPING 0.09
#define TAU_S 0.3

static const char drawn_from[] =
        "gain_u_percent = 0\nmount_percent = 0\nalign_deg = 0\nfilter = butterworth\n"
        "cutoff_x_hz = 3000\ncutoff_y_hz = 4500\ncutoff_z_hz = 4500\n"
        "cutoff_u_percent = 5\nskew_u_us = 20\nclock_ppm = 0\ntau_s = 0.3\n"
        "tau_percent = 20\n[calibration]\nexpanded_percent = 4\ncorrelation = 0.5\n"
        "transverse_percent = 3\nlinearity_percent = 0\nresponse_percent = 0\n"
        "drift_percent_year = 0\ntemperature_percent_k = 0\nzero_shift_percent = 0\n";

/* White, or each value 0.8 of the last one and a rest (AR(1)); and the low-pass that is asked for. */
static const struct noise {
	const char *name;
	double sigma_g, keeps, lowpass_hz;
} noises[] = {{"white 0.5 g", 0.5, 0, 0},
              {"AR(1) 0.8 0.5 g", 0.5, 0.8, 0},
              {"AR(1) 0.8 1.5 g", 1.5, 0.8, 0},
              {"AR(1), 3 kHz", 0.5, 0.8, 3000}};

struct made {
	enum synth_shape shape;
	const struct noise *noise;
	double felt[2][2][PLATE_STEPS]; /* of S1, S2: behind X's filter, behind Y's and Z's */
	double plate[PLATE_STEPS];
	struct synth_random random;
	double onset_s;
	struct record record;
};

static const double peak_g[2][3] = {{60, 28, 6}, {450, -215, 40}}; /* S1: times the plate's answer */

/* Two sections of a Butterworth low-pass of four poles, by the bilinear transform at this step. */
static void pass_low(double *value, double cutoff_hz)
{
	static const double q[] = {0.541196100, 1.306562965};
	double w = tan(PI * cutoff_hz * SYNTH_STEP_S);

	for (int section = 0; section < 2; section++) {
		double a = 1 + w / q[section] + w * w, x1 = 0, x2 = 0, y1 = 0, y2 = 0;

		for (size_t k = 0; k < PLATE_STEPS; k++) {
			double x = value[k], y = (w * w * (x + 2 * x1 + x2) - 2 * (w * w - 1) * y1 -
			                          (1 - w / q[section] + w * w) * y2) /
			                         a;

			x2 = x1;
			x1 = x;
			y2 = y1;
			y1 = value[k] = y;
		}
	}
}

static void feel(struct made *m)
{
	for (int filter = 0; filter < 2; filter++) {
		for (size_t k = 0; k < PLATE_STEPS; k++) {
			m->felt[0][filter][k] = m->plate[k];
			m->felt[1][filter][k] = synth_pulse(m->shape, (double)k * SYNTH_STEP_S / BASE_S);
		}
		pass_low(m->felt[0][filter], filter == 0 ? 3000 : 4500);
		pass_low(m->felt[1][filter], filter == 0 ? 3000 : 4500);
	}
}

/* What the sensor's supply leaves of it: the opposite of what undoes it. */
static void pass_high(struct channel *c, double tau)
{
	double part = 1 / (2 * tau * c->rate_hz), integral = 0, before = 0;

	for (size_t k = 0; k < c->count; k++) {
		double y = (c->value_g[k] - integral - before * part) / (1 + part);

		integral += (before + y) * part;
		before = c->value_g[k] = y;
	}
}

static void make_sensor(struct made *m, int sensor)
{
	double common = synth_normal(&m->random),
	       tau = TAU_S * (1 + 0.2 * (2 * synth_uniform(&m->random) - 1));

	for (int axis = 0; axis < 3; axis++) {
		double rate_hz = axis == 0 ? 7000 : 10000,
		       delay = 2.6131259 / (2 * PI * (axis == 0 ? 3000 : 4500));
		double gain = 1 + 0.02 * sqrt(0.5) * (common + synth_normal(&m->random));
		double turn = 2 * PI * synth_uniform(&m->random), value;
		double late_s = 0.05 * delay * synth_normal(&m->random) + 20e-6 * synth_normal(&m->random);
		double others = 0.03 * (cos(turn) * peak_g[sensor][(axis + 1) % 3] +
		                        sin(turn) * peak_g[sensor][(axis + 2) % 3]);
		char name[] = {'S', (char)('1' + sensor), (char)('X' + axis), '\0'};
		struct channel *c = record_add_channel(&m->record, name, rate_hz,
		                                       (size_t)((QUIET_MS + AFTER_MS) * 1e-3 * rate_hz));

		assert_non_null(c);
		c->sensor = (uint8_t)(1 + sensor);
		c->axis = name[2];
		for (size_t k = 0; k < c->count; k++) {
			value = synth_table(m->felt[sensor][axis > 0], PLATE_STEPS, SYNTH_STEP_S,
			                    (double)k / rate_hz - late_s - m->onset_s);
			c->value_g[k] = gain * (peak_g[sensor][axis] + others) * value;
			c->sample[k] = 0;
		}
		pass_high(c, tau);
		value = m->noise->sigma_g * synth_normal(&m->random);
		for (size_t k = 0; k < c->count; k++) {
			c->value_g[k] += value;
			value = m->noise->keeps * value +
			        m->noise->sigma_g * sqrt(1 - m->noise->keeps * m->noise->keeps) *
			                synth_normal(&m->random);
		}
	}
}

/* What is true of a drop. */
struct truths {
	double summit[2], summit_s[2], width_s, area;
};

static struct truths truths_of(struct made *m)
{
	struct truths t;
	double from = 0, until = 1;

	m->onset_s = 0;
	t.summit[1] = 1;
	t.summit_s[1] = synth_pulse_summit(m->shape) * BASE_S;
	t.summit_s[0] = synth_plate_peak(m->plate, PLATE_STEPS, &t.summit[0]);
	t.area = synth_pulse_area(m->shape) * BASE_S;
	while (synth_pulse(m->shape, from) < 0.1)
		from += 1e-5;
	while (synth_pulse(m->shape, until) < 0.1)
		until -= 1e-5;
	t.width_s = (until - from) * BASE_S;
	return t;
}

/* NAN: nothing is known of it. */
static double truth_of(const struct made *m, const struct truths *t, const char *what)
{
	int sensor = what[1] - '1', axis = what[2] - 'X';
	const char *key = strchr(what, '.');

	if (strncmp(what, "lag.largest", 11) == 0)
		return t->summit_s[0] - t->summit_s[1];
	if (strcmp(what, "plate.frequency_hz") == 0)
		return NATURAL_HZ * sqrt(1 - DAMPING * DAMPING);
	if (strcmp(what, "plate.damping_ratio") == 0)
		return DAMPING;
	if (what[0] != 'S')
		return NAN;
	if (strcmp(key, ".peak_g") == 0)
		return hypot(peak_g[sensor][0], peak_g[sensor][1]) * t->summit[sensor];
	if (strcmp(key, ".time_s") == 0 || strcmp(key, ".peak.time_s") == 0)
		return m->onset_s + t->summit_s[sensor];
	if (strcmp(key, ".peak.value_g") == 0)
		return peak_g[sensor][axis] * t->summit[sensor];
	if (sensor == 1 && strcmp(key, ".pulse.duration_s") == 0)
		return t->width_s;
	if (sensor == 1 && strcmp(key, ".pulse.velocity_change_m_s") == 0)
		return 9.80665 * peak_g[sensor][axis] * t->area;
	return NAN;
}

struct cell {
	char what[80];
	unsigned count, covered, by_noise;
};

static void count_cells(const struct made *m, const struct truths *t, const struct budget *budget,
                        struct cell *cells)
{
	for (size_t i = 0; i < budget->count; i++) {
		const struct budget_item *item = &budget->item[i];
		double truth = truth_of(m, t, item->what);
		size_t at = 0;

		if (isnan(truth) || item->what[2] == 'Z')
			continue;
		while (at < CELLS_MAX && cells[at].count > 0 && strcmp(cells[at].what, item->what) != 0)
			at++;
		assert_true(at < CELLS_MAX);
		snprintf(cells[at].what, sizeof(cells[at].what), "%s", item->what);
		cells[at].count++;
		cells[at].covered += fabs(item->value - truth) <= item->expanded;
		cells[at].by_noise += fabs(item->value - truth) <= 2 * item->part[BUDGET_NOISE];
	}
}

static void one_drop(struct made *m, const struct truths *t, const struct sensors *sensors,
                     struct cell *cells)
{
	const struct estimate_options options = {.iepe_time_constant_s = TAU_S,
	                                         .lowpass_hz = m->noise->lowpass_hz};
	char message[SETTINGS_MESSAGE_MAX];
	struct record corrected;
	struct analysis analysis;
	struct budget budget;

	record_init(&m->record);
	m->onset_s = QUIET_MS * 1e-3 + 1e-3 * synth_uniform(&m->random);
	make_sensor(m, 0);
	make_sensor(m, 1);
	assert_int_equal(sensors_correct(sensors, &m->record, &corrected, message), 0);
	assert_int_equal(estimate_record(&corrected, &options, &analysis), 0);
	assert_int_equal(budget_make(&budget, sensors, &corrected, &analysis), 0);
	count_cells(m, t, &budget, cells);
	budget_free(&budget);
	estimate_free(&analysis);
	record_free(&corrected);
	record_free(&m->record);
}

/* 95.45 +- 2 % in every cell, and what so few drops scatter. */
static void check_cells(const struct made *m, const struct cell *cells, unsigned drops)
{
	unsigned count = 0, inside = 0, by_noise = 0, found = 0;

	for (; found < CELLS_MAX && cells[found].count > 0; found++) {
		const struct cell *c = &cells[found];
		double part = 100.0 * c->covered / c->count, scatter = 100 * sqrt(0.0455 * 0.9545 / c->count);

		if (drops >= 500)
			print_message("%d, %-15s: %-32s %6u: U %5.1f %%, noise alone %5.1f %%\n", m->shape,
			              m->noise->name, c->what, c->count, part,
			              100.0 * c->by_noise / c->count);
		assert_true(c->count >= drops / 2);
		/* how a filter changes a width is known as a bound, which covers more */
		if (strstr(c->what, "duration") != NULL)
			part = fmin(part, 95.45);
		if (fabs(part - 95.45) > 2 + 3.5 * scatter)
			fail_msg("%s of pulse %d, %s: U covers %.1f %% of %u", c->what, m->shape,
			         m->noise->name, part, c->count);
		if (strstr(c->what, "value_g") || strstr(c->what, "peak_g") || strstr(c->what, "velocity")) {
			count += c->count;
			inside += c->covered;
			by_noise += c->by_noise;
		}
	}
	assert_int_equal(found, 19);
	/* those of one drop share their chain */
	assert_near(100.0 * inside / count, 95.45, 2 + 300 * sqrt(0.0455 * 0.9545 / drops));
	if (m->noise == noises) /* that is what they were without */
		assert_true(by_noise < count / 5);
}

static void covers(void **state)
{
	static const enum synth_shape shapes[] = {SYNTH_HALF_SINE, SYNTH_HAVERSINE, SYNTH_HUNT_CROSSLEY};
	unsigned drops = getenv("DROPS") ? (unsigned)atoi(getenv("DROPS")) : 60;
	struct sensors *sensors = malloc(sizeof(*sensors));
	struct made *m = malloc(sizeof(*m));

	(void)state;
	assert_non_null(m);
	assert_non_null(sensors);
	read_sensor(sensors, drawn_from);
	sensors->count = 2; /* S1's is the same by the numbers */
	sensors->used[1] = sensors->used[0];
	for (int axis = 0; axis < 3; axis++)
		sensors->used[0].transducer.channel[axis][1] = '1';
	snprintf(sensors->used[0].name, sizeof(sensors->used[0].name), "S1");
	for (size_t i = 0; i < sizeof(shapes) / sizeof(shapes[0]); i++) {
		struct truths t;

		m->shape = shapes[i];
		m->random = (struct synth_random){100 + i};
		synth_plate(m->plate, PLATE_STEPS, m->shape, BASE_S, NATURAL_HZ, DAMPING);
		feel(m);
		t = truths_of(m);
		for (size_t k = 0; k < sizeof(noises) / sizeof(noises[0]); k++) {
			struct cell cells[CELLS_MAX] = {{.count = 0}};

			m->noise = &noises[k];
			for (unsigned n = 0; n < drops; n++)
				one_drop(m, &t, sensors, cells);
			check_cells(m, cells, drops);
		}
	}
	free(m);
	free(sensors);
}

int main(void)
{
	const struct CMUnitTest tests[] = {cmocka_unit_test(distributions),
	                                   cmocka_unit_test(factors),
	                                   cmocka_unit_test(catalogue_peak),
	                                   cmocka_unit_test(matrix_without_axis),
	                                   cmocka_unit_test(peak_without_width),
	                                   cmocka_unit_test(long_name),
	                                   cmocka_unit_test(velocity_ratio),
	                                   cmocka_unit_test(mean_of_drops),
	                                   cmocka_unit_test(motion),
	                                   cmocka_unit_test(resultant),
	                                   cmocka_unit_test(covers)};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
