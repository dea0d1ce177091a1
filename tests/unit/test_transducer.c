/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Sensor files, and what they do to a record: signals made backwards, by what each key says, come out as they
 * were.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <complex.h>
#include <gsl/gsl_poly.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/base/date.h"
#include "host/sensor/lowpass.h"
#include "host/sensor/sensors.h"
#include "tests/unit/near.h"
#include "tests/unit/scratch.h"
#include "tests/unit/synth.h"

#define PI 3.14159265358979323846

static const char whole[] = "[sensor]\n"
                            "serial = 4711\n"
                            "channels = S2X S2Y S2Z\n"
                            "[calibration]\n"
                            "certificate = C-1\n"
                            "date = 2026-01-15\n"
                            "due = 2027-01-14\n"
                            "sensitivity_x_mv_g = 10.25\n"
                            "sensitivity_y_mv_g = 9.8\n"
                            "sensitivity_z_mv_g = 10.0\n"
                            "[chain]\n"
                            "scaled_x_mv_g = 10\n"
                            "scaled_y_mv_g = 10\n"
                            "scaled_z_mv_g = 10\n";

static void write_file(char path[SCRATCH_MAX], const char *head, const char *tail)
{
	int fd = mkstemp(scratch_name(path, "sensor"));
	FILE *out = fdopen(fd, "w");

	assert_non_null(out);
	fputs(head, out);
	fputs(tail, out);
	assert_int_equal(fclose(out), 0);
}

/* ---- reading ---- */

static void days(void **state)
{
	double day = 0;

	(void)state;
	assert_true(date_days("2026-11-27", &day));
	assert_near(day, 20784, 0); /* date -u -d 2026-11-27 +%s, over 86 400 */
	assert_true(date_days("2028-02-29T10:00:00Z", &day));
	assert_false(date_days("2026-02-29", &day));
	assert_false(date_days("2026-13-01", &day));
	assert_false(date_days("2026-1-01", &day));
	assert_false(date_days("", &day));
}

static void reads(void **state)
{
	char path[SCRATCH_MAX], message[SETTINGS_MESSAGE_MAX];
	struct transducer t;

	(void)state;
	write_file(path, whole,
	           "filter = bessel\ncutoff_x_hz = 3000\ncutoff_y_hz = 4500\ncutoff_z_hz = 4500\n");
	assert_int_equal(transducer_read(&t, path, message), 0);
	unlink(path);
	assert_string_equal(t.sensor_serial, "4711");
	assert_string_equal(t.channel[2], "S2Z");
	assert_near(TRANSDUCER_OF(&t, calibration_sensitivity_x_mv_g, 1), 9.8, 0);
	assert_near(TRANSDUCER_OF(&t, chain_cutoff_x_hz, 2), 4500, 0);
	assert_near(TRANSDUCER_OF(&t, chain_polarity_x, 2), 1, 0);
	assert_int_equal(t.filter, TRANSDUCER_BESSEL);
	assert_true(t.default_used); /* no U is given, among others */
	assert_false(t.has_matrix);
	assert_near(t.calibration_expanded_percent, 2, 0);
}

/* Every key whose uncertainty is told when it lacks. */
static void tells_defaults(void **state)
{
	static const char *const told[] = {"expanded_percent = 2\n",       "transverse_percent = 5\n",
	                                   "linearity_percent = 1\n",      "response_percent = 1\n",
	                                   "drift_percent_year = 1\n",     "temperature_percent_k = .05\n",
	                                   "zero_shift_percent = .1\n",    "[chain]\ngain_u_percent = .15\n",
	                                   "[chain]\nmount_percent = .5\n"};
	enum { TOLD = sizeof(told) / sizeof(told[0]) };
	char message[SETTINGS_MESSAGE_MAX];

	(void)state;
	for (size_t left_out = 0; left_out <= TOLD; left_out++) {
		char path[SCRATCH_MAX], tail[600] = "";
		struct transducer t;

		for (size_t i = 0; i < TOLD; i++)
			if (i != left_out)
				snprintf(tail + strlen(tail), sizeof(tail) - strlen(tail), "%s%s",
				         told[i][0] == '[' ? "" : "[calibration]\n", told[i]);
		write_file(path, whole, tail);
		assert_int_equal(transducer_read(&t, path, message), 0);
		unlink(path);
		assert_int_equal(t.default_used, left_out < TOLD);
	}
}

static void refuses(void **state)
{
	static const struct {
		const char *cut, *tail, *line, *said;
	} wrong[] = {
	        {"serial = 4711\n", "", "", "[sensor] serial is missing"},
	        {"due = 2027-01-14\n", "", "", "[calibration] due is missing"},
	        {"sensitivity_y_mv_g = 9.8\n", "", "",
	         "[calibration] sensitivity_y_mv_g is missing, expected a number above 0 for channel S2Y"},
	        {"scaled_z_mv_g = 10\n", "", "", "[chain] scaled_z_mv_g is missing"},
	        {"due = 2027-01-14\n", "[calibration]\ndue = 2025-01-14\n", "",
	         "due is 2025-01-14, expected a day"},
	        {"due = 2027-01-14\n", "[calibration]\ndue = 2027-02-30\n",
	         ":16: ", "due is '2027-02-30', expected YYYY-MM-DD"},
	        {"channels = S2X S2Y S2Z\n", "[sensor]\nchannels = S2X S2Y\n",
	         ":16: ", "expected three names"},
	        {"channels = S2X S2Y S2Z\n", "[sensor]\nchannels = - - -\n", ":16: ", "expected three names"},
	        {"", "colour = red\n", ":15: ", "unknown key 'colour' in [chain]"},
	        {"", "gain = 1\ngain = 1\n", ":16: ", "gain is given twice"},
	        {"", "gain = much\n", ":15: ", "gain is 'much', expected a number from 0.01 to 100"},
	        {"", "gain = nan\n", ":15: ", "expected a number from"},
	        {"", "tau_s = -1\n", ":15: ", "tau_s is '-1', expected a number from 0 to 100"},
	        {"", "polarity_x = 0.5\n", ":15: ", "polarity_x is '0.5', expected 1 or -1"},
	        {"", "order = 2.5\n", ":15: ", "order is '2.5', expected a whole number"},
	        {"", "[calibration]\ntemperature_percent_k = -1\n",
	         ":16: ", "expected a number from -0.2 to 0.2"},
	        {"", "filter = chebyshev\n", ":15: ", "expected none, butterworth or bessel"},
	        {"", "filter = bessel\n", "", "[chain] cutoff_x_hz is missing"},
	        {"", "[chain\n", ":15: ", "not a [section] or key = value"},
	};

	(void)state;
	for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++) {
		char path[SCRATCH_MAX], message[SETTINGS_MESSAGE_MAX] = "", head[sizeof(whole) + 4];
		const char *at = strstr(whole, wrong[i].cut);
		struct transducer t = {.sensor_serial = "as it was"};
		size_t cut = strlen(wrong[i].cut);

		snprintf(head, sizeof(head), "%.*s%s%s", (int)(at - whole), whole, at + cut,
		         cut > 0 ? ";\n" : "");
		write_file(path, head, wrong[i].tail);
		assert_true(transducer_read(&t, path, message) < 0);
		unlink(path);
		if (strncmp(message, path, strlen(path)) != 0 || strstr(message, wrong[i].said) == NULL ||
		    strstr(message, wrong[i].line) == NULL)
			fail_msg("case %zu: %s", i, message);
		assert_string_equal(t.sensor_serial, "as it was");
	}
}

/* ---- filters ---- */

/* The half-sine of duration 1 behind a filter given by its poles, residues of a gain of 1, in closed form. */
static double behind(const double complex *pole, unsigned order, double t)
{
	double complex sum = 0;

	for (unsigned i = 0; i < order; i++) {
		double complex residue = -pole[i], jw = PI * _Complex_I, p = pole[i];
		double until = fmin(t, 1);

		for (unsigned j = 0; j < order; j++)
			if (j != i)
				residue *= -pole[j] / (p - pole[j]);
		sum += residue * cexp(p * (t - until)) *
		       ((cexp(jw * until) - cexp(p * until)) / (jw - p) -
		        (cexp(-jw * until) - cexp(p * until)) / (-jw - p)) /
		       (2 * _Complex_I);
	}
	return creal(sum);
}

/* With -3 dB at 1 rad/s. Of Bessel by the coefficients (2n-k)! / (2^(n-k) k! (n-k)!). */
static void poles_of(enum transducer_filter filter, unsigned order, double complex *pole)
{
	double coefficient[9], root[16], corner = 0;
	gsl_poly_complex_workspace *w = gsl_poly_complex_workspace_alloc(order + 1);

	for (unsigned k = 0; k < order; k++)
		pole[k] = cexp(_Complex_I * PI * (2.0 * k + order + 1) / (2.0 * order));
	for (unsigned k = 0; k <= order; k++)
		coefficient[k] = tgamma(2.0 * order - k + 1) /
		                 (pow(2, order - k) * tgamma(k + 1.0) * tgamma(order - k + 1.0));
	assert_int_equal(gsl_poly_complex_solve(coefficient, order + 1, w, root), 0);
	gsl_poly_complex_workspace_free(w);
	if (filter != TRANSDUCER_BESSEL)
		return;
	for (double power = 1; power > 0.5; corner += 1e-5) {
		power = 1;
		for (unsigned k = 0; k < order; k++) {
			double complex r = root[2 * k] + root[2 * k + 1] * _Complex_I;

			power *= pow(cabs(r) / cabs(corner * _Complex_I - r), 2);
		}
	}
	for (unsigned k = 0; k < order; k++)
		pole[k] = (root[2 * k] + root[2 * k + 1] * _Complex_I) / corner;
}

/* Peak, its instant, width at 10 %. */
static void pulse_behind(enum transducer_filter filter, unsigned order, double periods, double found[3])
{
	double complex pole[8];
	double low, high, from, until;

	poles_of(filter, order, pole);
	for (unsigned k = 0; k < order; k++)
		pole[k] *= 2 * PI * periods;
	low = 0.4;
	high = 1;
	while (high - low > 1e-9) {
		double a = low + (high - low) / 3, b = high - (high - low) / 3;

		*(behind(pole, order, a) < behind(pole, order, b) ? &low : &high) =
		        behind(pole, order, a) < behind(pole, order, b) ? a : b;
	}
	found[1] = low;
	found[0] = behind(pole, order, low);
	for (from = low; behind(pole, order, from) > 0.1 * found[0]; from -= 1e-5)
		;
	for (until = low; behind(pole, order, until) > 0.1 * found[0]; until += 1e-5)
		;
	found[2] = until - from;
}

static void delays(void **state)
{
	static const double butterworth[] = {1.41421, 2.61313, 3.86370, 5.12583},
	                    bessel[] = {1.36165, 2.11392, 2.70340, 3.17962};

	(void)state;
	for (unsigned i = 0; i < 4; i++) {
		unsigned order = 2 * i + 2;

		assert_near(lowpass_delay_s(TRANSDUCER_BUTTERWORTH, order, 1 / (2 * PI)), butterworth[i],
		            6e-6);
		assert_near(lowpass_delay_s(TRANSDUCER_BESSEL, order, 1 / (2 * PI)), bessel[i], 6e-6);
	}
	assert_near(lowpass_delay_s(TRANSDUCER_BUTTERWORTH, 4, 3000), 138.6e-6, 0.05e-6);
	assert_near(lowpass_delay_s(TRANSDUCER_BUTTERWORTH, 4, 4500), 92.4e-6, 0.05e-6);
	assert_near(lowpass_delay_s(TRANSDUCER_NO_FILTER, 4, 4500), 0, 0);
}

static void pulses(void **state)
{
	static const struct {
		enum transducer_filter filter;
		unsigned order;
		double late[3], late_digit, error_percent[3], error_digit, width_percent; /* at 5 periods */
	} known[] = {
	        {TRANSDUCER_BUTTERWORTH, 2, {1.007, 1.003, 1.001}, 5e-4, {NAN, NAN, NAN}, 0, -0.1},
	        {TRANSDUCER_BUTTERWORTH, 4, {1.0225, 1.0028, 1.0004}, 5e-5, {-0.145, -0.009, 0}, 5e-4, -0.2},
	        {TRANSDUCER_BUTTERWORTH, 8, {1.047, 1.019, 1.002}, 5e-4, {-0.48, -0.097, -0.005}, 5e-3, -0.1},
	        /* |H(1/2T)| - 1 */
	        {TRANSDUCER_BESSEL, 4, {1, 1, 1}, 5e-5, {-0.8843, -0.3189, -0.0985}, 2e-4, 0.3},
	};
	static const double periods[] = {3, 5, 9};

	(void)state;
	for (size_t i = 0; i < sizeof(known) / sizeof(known[0]); i++)
		for (int p = 0; p < 3; p++) {
			double found[3], delay = lowpass_delay_s(known[i].filter, known[i].order, periods[p]);

			pulse_behind(known[i].filter, known[i].order, periods[p], found);
			assert_near((found[1] - 0.5) / delay, known[i].late[p], known[i].late_digit * 1.01);
			if (isfinite(known[i].error_percent[p]))
				assert_near(100 * (found[0] - 1), known[i].error_percent[p],
				            known[i].error_digit * 1.01);
			if (p == 1)
				assert_near(100 * (found[2] / (1 - 2 * asin(0.1) / PI) - 1),
				            known[i].width_percent, 0.051);
			/* what the budget takes a filter for */
			assert_true(fabs(found[0] - 1) < lowpass_peak_share(periods[p]));
			assert_true(fabs(found[2] / (1 - 2 * asin(0.1) / PI) - 1) <
			            lowpass_width_share(periods[p]));
		}
}

/* ---- a record ---- */

/* What a channel records of three true axes, each a pulse of its own place. */
static double truth(unsigned axis, double t)
{
	static const double peak[3] = {480, -220, 35}, at[3] = {0.02, 0.0202, 0.0197};

	return peak[axis] * synth_pulse(SYNTH_HAVERSINE, (t - at[axis]) / 3e-3);
}

static struct record record_by(const double m[3][3], const double factor[3], const double late_s[3])
{
	static const char *const name[] = {"S2X", "S2Y", "S2Z"};
	struct record record;

	record_init(&record);
	for (unsigned i = 0; i < 3; i++) {
		double rate_hz = i == 0 ? 7000 : 10000;
		struct channel *c = record_add_channel(&record, name[i], rate_hz, (size_t)(0.05 * rate_hz));

		assert_non_null(c);
		for (size_t k = 0; k < c->count; k++) {
			double t = (double)k / rate_hz - late_s[i];

			c->value_g[k] = 0;
			c->sample[k] = 0;
			for (unsigned j = 0; j < 3; j++)
				c->value_g[k] += factor[i] * m[i][j] * truth(j, t);
		}
	}
	return record;
}

static void check_truth(const struct record *r, double tolerance)
{
	for (unsigned i = 0; i < 3; i++)
		for (size_t k = 0; k < r->channels[i].count; k++)
			assert_near(r->channels[i].value_g[k],
			            truth(i, r->channels[i].start_s + (double)k / r->channels[i].rate_hz),
			            tolerance);
}

static const double plain_matrix[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};

static void correct_by(const char *tail, double day, struct record *record, struct record *corrected)
{
	char path[SCRATCH_MAX], message[SETTINGS_MESSAGE_MAX] = "";
	struct sensors sensors;

	write_file(path, whole, tail);
	assert_int_equal(sensors_read(&sensors, path, day, message), 0);
	unlink(path);
	assert_string_equal(sensors.used[0].name, "S2");
	assert_int_equal(sensors_correct(&sensors, record, corrected, message), 0);
	record_free(record);
}

static double day_of(const char *text)
{
	double day = NAN;

	assert_true(date_days(text, &day));
	return day;
}

/* Gain, polarity, temperature, filter, skew. */
static void put_right(void **state)
{
	/* Butterworth of 4 poles: 2.6131259 / (2 pi fc) */
	const double warm = 1 + 0.0004 * 10,
	             factor[3] = {-1.025 * 1.02 * warm, 0.98 * 1.02 * warm, 1.02 * warm},
	             late_s[3] = {138.6307e-6, 92.4205e-6 + 3e-6, 92.4205e-6 + 14.1e-6};
	struct record record = record_by(plain_matrix, factor, late_s), corrected;

	(void)state;
	correct_by("polarity_x = -1\ngain = 1.02\nfilter = butterworth\norder = 4\ncutoff_x_hz = 3000\n"
	           "cutoff_y_hz = 4500\ncutoff_z_hz = 4500\nskew_y_us = 3\nskew_z_us = 14.1\ntau_s = 0.25\n"
	           "temperature_c = 33\n[calibration]\ntemperature_percent_k = 0.04\n",
	           day_of("2026-06-01"), &record, &corrected);
	check_truth(&corrected, 1e-3);
	assert_near(corrected.channels[1].highpass_s, 0.25, 0);
	assert_int_equal(corrected.flags, RECORD_FLAG_DEFAULT_USED);
	record_free(&corrected);
}

static void matrix(void **state)
{
	static const double m[3][3] = {{1, 0.03, -0.01}, {-0.02, 1, 0.04}, {0.015, -0.03, 1}},
	                    factor[3] = {1.025, 0.98, 1}, late_s[3] = {0};
	struct record record = record_by(m, factor, late_s), corrected;

	(void)state;
	record.channels[1].sample[300] = SAMPLE_LOST;
	record.channels[1].value_g[300] = NAN;
	correct_by("[calibration]\nmatrix_xy = .03\nmatrix_xz = -.01\nmatrix_yx = -.02\nmatrix_yz = .04\n"
	           "matrix_zx = .015\nmatrix_zy = -.03\n",
	           day_of("2026-06-01"), &record, &corrected);
	for (unsigned i = 0; i < 3;
	     i++) { /* nobody knows what X and Z read of it then: bad, and zero it was */
		size_t at = i == 0 ? 210 : 300;

		assert_true(isnan(corrected.channels[i].value_g[at]));
		assert_true(i == 1 || corrected.channels[i].sample[at] == SAMPLE_BAD);
		assert_true(i == 1 || corrected.channels[i].flags & RECORD_FLAG_BAD);
		corrected.channels[i].value_g[at] = truth(i, 0.03);
		assert_false(isnan(corrected.channels[i].value_g[0]) ||
		             isnan(corrected.channels[i].value_g[corrected.channels[i].count - 1]));
	}
	check_truth(&corrected, 0.02); /* of interpolation between samples of Y: 4 % of some tenths of a g */
	record_free(&corrected);
}

/* A cut top has equal samples; what is taken off it makes them unequal. It stays marked, here and in what was
 * made with it. */
static void cut_top(void **state)
{
	static const double factor[3] = {1.025, 0.98, 1}, late_s[3] = {0};
	struct record record = record_by(plain_matrix, factor, late_s), corrected;
	size_t marked[3] = {0};

	(void)state;
	for (size_t k = 0; k < record.channels[0].count; k++)
		record.channels[0].value_g[k] = fmin(record.channels[0].value_g[k], 300);
	correct_by("[calibration]\nmatrix_xy = .03\nmatrix_yx = .02\n", day_of("2026-06-01"), &record,
	           &corrected);
	for (unsigned i = 0; i < 3; i++)
		for (size_t k = 0; k < corrected.channels[i].count; k++)
			marked[i] += (corrected.channels[i].sample[k] & SAMPLE_CLIPPED) != 0;
	assert_true(marked[0] >= 5);
	assert_true(marked[1] >= marked[0]);
	assert_int_equal(marked[2], 0);
	assert_true((corrected.channels[0].flags & RECORD_FLAG_CLIPPED) != 0);
	assert_true((corrected.flags & RECORD_FLAG_CLIPPED) != 0);
	record_free(&corrected);
}

/* The due day itself still holds; the day after does not. */
static void overdue(void **state)
{
	static const double factor[3] = {1, 1, 1}, late_s[3] = {0};
	static const struct {
		const char *day;
		unsigned flags;
	} known[] = {{"2027-01-14", RECORD_FLAG_DEFAULT_USED},
	             {"2027-01-15", RECORD_FLAG_DEFAULT_USED | RECORD_FLAG_OVERDUE}};

	(void)state;
	for (int i = 0; i < 2; i++) {
		struct record record = record_by(plain_matrix, factor, late_s), corrected;

		correct_by("", day_of(known[i].day) + 0.7, &record, &corrected);
		assert_int_equal(corrected.flags, known[i].flags);
		assert_int_equal(corrected.channels[2].flags, known[i].flags);
		record_free(&corrected);
	}
	assert_string_equal(record_flag_name(RECORD_FLAG_OVERDUE), "overdue");
	assert_string_equal(record_flag_name(RECORD_FLAG_DEFAULT_USED), "default_used");
}

static void does_not_fit(void **state)
{
	char path[2][SCRATCH_MAX], message[SETTINGS_MESSAGE_MAX] = "", both[2 * SCRATCH_MAX + 2];
	struct record record, corrected;
	struct sensors sensors;

	(void)state;
	record_init(&record);
	assert_non_null(record_add_channel(&record, "fixture", 7000, 10));
	write_file(path[0], whole, "");
	write_file(path[1], whole, "");
	assert_int_equal(sensors_read(&sensors, path[0], 0, message), 0);
	assert_int_equal(sensors_correct(&sensors, &record, &corrected, message), DT_E_UNKNOWN);
	assert_non_null(strstr(message, "sensor 4711: none of its channels S2X S2Y S2Z is there"));
	snprintf(both, sizeof(both), "%s, %s", path[0], path[1]);
	assert_int_equal(sensors_read(&sensors, both, 0, message), 0);
	assert_int_equal(sensors.count, 2);
	assert_int_equal(sensors_correct(&sensors, &record, &corrected, message), DT_E_ARGUMENT);
	assert_non_null(strstr(message, "both name channel S2X"));
	unlink(path[0]);
	assert_true(sensors_read(&sensors, both, 0, message) < 0);
	assert_non_null(strstr(message, "expected a sensor file"));
	unlink(path[1]);
	record_free(&record);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(days),      cmocka_unit_test(reads),       cmocka_unit_test(tells_defaults),
	        cmocka_unit_test(refuses),   cmocka_unit_test(delays),      cmocka_unit_test(pulses),
	        cmocka_unit_test(put_right), cmocka_unit_test(matrix),      cmocka_unit_test(cut_top),
	        cmocka_unit_test(overdue),   cmocka_unit_test(does_not_fit)};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
