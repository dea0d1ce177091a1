/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "host/shock/band.h"
#include "host/shock/limit.h"
#include "host/shock/spectrum.h"
#include "host/shock/signal.h"
#include "tests/unit/near.h"
#include "tests/unit/synth.h"
#include "tests/unit/scratch.h"

static char file[SCRATCH_MAX];

static int make_file(void **state)
{
	int fd = mkstemp(scratch_name(file, "limit"));

	(void)state;
	return fd < 0 ? -1 : close(fd);
}

static int remove_file(void **state)
{
	(void)state;
	return unlink(file);
}

static int parse(struct limit_curve *curve, enum limit_kind kind, const char *text,
                 char message[READ_MESSAGE_MAX])
{
	FILE *out = fopen(file, "w");

	assert_non_null(out);
	fputs(text, out);
	assert_int_equal(fclose(out), 0);
	return limit_read(curve, file, kind, message);
}

static struct limit_curve made(enum limit_kind kind, const char *text)
{
	char message[READ_MESSAGE_MAX] = "";
	struct limit_curve curve;

	if (parse(&curve, kind, text, message) != 0)
		fail_msg("%s", message);
	return curve;
}

static void refuses(enum limit_kind kind, const char *text, const char *place, const char *what)
{
	char message[READ_MESSAGE_MAX] = "", wanted[SCRATCH_MAX + 64];
	struct limit_curve curve = {0};

	assert_int_not_equal(parse(&curve, kind, text, message), 0);
	snprintf(wanted, sizeof(wanted), "%s%s", file, place);
	if (strncmp(message, wanted, strlen(wanted)) != 0 || !strstr(message, what))
		fail_msg("'%s' lacks '%s' or '%s'", message, wanted, what);
	assert_null(strchr(message, '\n'));
	assert_null(curve.point);
}

static void reading(void **state)
{
	struct limit_curve curve;

	(void)state;
	curve = made(LIMIT_SPECTRUM, "# made by hand\nfrequency_hz,limit\n\n10,20\n1e2;200\r\n1000\t200\n");
	assert_int_equal(curve.count, 3);
	assert_near(curve.point[1].x, 100, 0);
	assert_near(curve.point[1].upper, 200, 0);
	limit_free(&curve);
	curve = made(LIMIT_BAND, "-0.001,-5,5\n0.002 -1 50.5\n");
	assert_near(curve.point[0].lower, -5, 0);
	assert_near(curve.point[1].upper, 50.5, 0);
	limit_free(&curve);
	curve = made(LIMIT_SPECTRUM, "Frequency (Hz),Limit (g)\n10,20\n100,200\n");
	assert_int_equal(curve.count, 2);
	assert_near(curve.point[0].x, 10, 0);
	limit_free(&curve);
	curve = made(LIMIT_BAND, "# by hand\n\"t in s\";lower;upper limit\n0;-5;5\n1;-5;6\n");
	assert_int_equal(curve.count, 2);
	assert_near(curve.point[1].upper, 6, 0);
	limit_free(&curve);
	refuses(LIMIT_SPECTRUM, "10,high\n20,30\n30,40\n", ":1:", "2 numbers");
	refuses(LIMIT_SPECTRUM, "10,20,g\n20,30\n30,40\n", ":1:", "2 numbers");
	refuses(LIMIT_SPECTRUM, "Frequency (Hz),Limit (g)\nHz,g\n10,20\n", ":2:", "2 numbers");
	refuses(LIMIT_SPECTRUM, "", ":", "empty");
	refuses(LIMIT_SPECTRUM, "10,20\n", ":", "1 points");
	refuses(LIMIT_SPECTRUM, "10,20\n5,20\n", ":2:", "increase");
	refuses(LIMIT_SPECTRUM, "10,20\n10,20\n", ":2:", "increase");
	refuses(LIMIT_SPECTRUM, "10,20\n20,high\n", ":2:", "2 numbers frequency_hz,limit");
	refuses(LIMIT_SPECTRUM, "10,20\n20,30,40\n", ":2:", "2 numbers");
	refuses(LIMIT_SPECTRUM, "f,g\nf,g\n", ":2:", "2 numbers");
	refuses(LIMIT_SPECTRUM, "0,20\n20,30\n", ":1:", "frequency");
	refuses(LIMIT_SPECTRUM, "10,20\n20,nan\n", ":2:", "numbers");
	refuses(LIMIT_SPECTRUM, "10,20\n20,-3\n", ":2:", "limit");
	refuses(LIMIT_BAND, "0,1\n1,2\n", ":1:", "time_s,lower_g,upper_g");
	refuses(LIMIT_BAND, "0,5,1\n1,2,3\n", ":1:", "upper");
}

static void between(void **state)
{
	struct limit_curve curve = made(LIMIT_SPECTRUM, "10,20\n1000,2000\n2000,2000\n");
	struct limit_point at;

	(void)state;
	assert_true(limit_at(&curve, LIMIT_SPECTRUM, 100, &at));
	assert_near(at.upper, 200, 1e-9);
	assert_true(limit_at(&curve, LIMIT_SPECTRUM, 1500, &at));
	assert_near(at.upper, 2000, 1e-9);
	assert_true(limit_at(&curve, LIMIT_SPECTRUM, 10, &at));
	assert_true(limit_at(&curve, LIMIT_SPECTRUM, 2000, &at));
	assert_false(limit_at(&curve, LIMIT_SPECTRUM, 9.9, &at));
	assert_false(limit_at(&curve, LIMIT_SPECTRUM, 2001, &at));
	assert_false(limit_at(&curve, LIMIT_SPECTRUM, NAN, &at));
	limit_free(&curve);
	curve = made(LIMIT_BAND, "0,-10,10\n2,10,30\n");
	assert_true(limit_at(&curve, LIMIT_BAND, 0.5, &at));
	assert_near(at.lower, -5, 1e-12);
	assert_near(at.upper, 15, 1e-12);
	limit_free(&curve);
}

static void spectra(void **state)
{
	struct limit_curve curve = made(LIMIT_SPECTRUM, "10,20\n1000,2000\n");
	double hz[] = {5, 10, 100, 500, 900, 2000}, value[] = {999, 10, 100, 1200, 1799, 9999};
	struct limit_verdict verdict = limit_spectrum(&curve, hz, value, 6);

	(void)state;
	assert_false(verdict.pass);
	assert_int_equal(verdict.checked, 4);
	assert_near(verdict.first_x, 500, 0);
	assert_near(verdict.margin, 20 * log10(1000.0 / 1200), 1e-9);
	assert_near(verdict.margin_x, 500, 0);
	value[3] = 999;
	verdict = limit_spectrum(&curve, hz, value, 6);
	assert_true(verdict.pass);
	assert_near(verdict.margin_x, 900, 0);
	assert_true(verdict.margin > 0 && verdict.margin < 0.1);
	assert_true(isnan(verdict.first_x));
	verdict = limit_spectrum(&curve, hz + 5, value + 5, 1); /* nothing checked is nothing passed */
	assert_false(verdict.pass);
	limit_free(&curve);
}

/* A half-sine of 100 g and 10 ms that peaks at 55 ms on 3 g, in the record's own time. */
static struct record pulse_record(void)
{
	struct synth_random random = {3};
	struct record record;
	struct channel *channel;

	record_init(&record);
	channel = record_add_channel(&record, "box", 10000, 1500);
	assert_non_null(channel);
	for (size_t k = 0; k < channel->count; k++) {
		channel->value_g[k] = 3 + 0.1 * synth_normal(&random) +
		                      100 * synth_pulse(SYNTH_HALF_SINE, ((double)k - 500) / 100);
		channel->sample[k] = 0;
	}
	record_finish(&record);
	return record;
}

static struct band checked(const struct record *record, const char *text, const char *channel, bool at_peak,
                           int result)
{
	struct limit_curve curve = made(LIMIT_BAND, text);
	struct band_options options = {&curve, channel, at_peak};
	struct estimate_options estimate = {0};
	struct analysis analysis;
	struct band band = {0};

	assert_int_equal(estimate_record(record, &estimate, &analysis), 0);
	assert_int_equal(band_check(record, &analysis, &estimate, &options, &band), result);
	estimate_free(&analysis);
	limit_free(&curve);
	return band;
}

static void bands(void **state)
{
	struct record record = pulse_record();
	struct band band;

	(void)state;
	/* Around the peak, flat to 5 g over +-1 ms: a half-sine falls by 4.89 g there. */
	band = checked(&record, "-0.001,94,101\n0.001,94,101\n", NULL, true, 0);
	assert_string_equal(band.channel, "box");
	assert_true(band.verdict.pass);
	assert_near(band.zero_s, 0.055, 2e-5);
	assert_true(band.verdict.checked >= 20 && band.verdict.checked <= 21);
	band = checked(&record, "-0.001,97,101\n0.001,97,101\n", "box", true, 0);
	assert_false(band.verdict.pass);
	assert_near(band.verdict.first_x, -0.001, 1.1e-4);
	assert_near(band.verdict.margin, 100 * cos(0.1 * M_PI) - 97, 0.5);
	assert_near(fabs(band.verdict.margin_x), 0.001, 1.1e-4);
	/* From the 10 % point on: 10 g there, at 0.319 ms into the pulse. */
	band = checked(&record, "0,5,15\n0.004681,95,105\n", "box", false, 0);
	assert_near(band.zero_s, 0.05 + 0.01 * asin(0.1) / M_PI, 3e-5);
	assert_false(band.verdict.pass); /* the pulse is rounder than a straight line */
	assert_true(band.verdict.margin < -10);
	record.channels[0].value_g[550] = NAN;
	record.channels[0].sample[550] = SAMPLE_LOST;
	band = checked(&record, "-0.001,90,101\n0.001,90,101\n", NULL, true, 0);
	assert_int_equal(band.verdict.missing, 1);
	assert_true(band.verdict.pass);
	(void)checked(&record, "0,0,1\n1,0,1\n", "plate", false, DT_E_UNKNOWN);
	record_free(&record);
}

static void spectrum(void **state)
{
	struct record record = pulse_record();
	struct limit_curve curve = made(LIMIT_SPECTRUM, "5,200\n2000,200\n");
	struct spectrum_options options = {.srs.damping = 0.05,
	                                   .side = SRS_MAXIMAX,
	                                   .part = SRS_TOTAL,
	                                   .per_octave = 12,
	                                   .limit = &curve};
	struct spectrum spectrum;

	(void)state;
	assert_int_equal(spectrum_compute(&record, &options, &spectrum), 0);
	assert_int_equal(spectrum.count, 104);
	assert_near(spectrum.frequency_hz[103], 5 * exp2(103 / 12.0), 1e-9);
	assert_true(spectrum_passes(&spectrum));
	/* A half-sine's spectrum has its top, 1.65 times the pulse with Q 10, near 0.8/T. */
	assert_near(spectrum.channel[0].verdict.margin, 20 * log10(200 / 165.0), 0.15);
	assert_near(spectrum.channel[0].verdict.margin_x, 80, 8);
	assert_near(spectrum.channel[0].offset_g, 3, 0.02);
	spectrum_free(&spectrum);
	curve.point[1].upper = curve.point[0].upper = 150;
	assert_int_equal(spectrum_compute(&record, &options, &spectrum), 0);
	assert_false(spectrum_passes(&spectrum));
	spectrum_free(&spectrum);
	options.to_hz = 9000;
	assert_int_equal(spectrum_compute(&record, &options, &spectrum), 0);
	assert_true(spectrum.channel[0].flags & SIGNAL_HALF_RATE);
	assert_true(isnan(spectrum.channel[0].side[SRS_MAXIMAX][spectrum.count - 1]));
	spectrum_free(&spectrum);
	options.from_hz = 5;
	options.to_hz = 4;
	assert_int_equal(spectrum_compute(&record, &options, &spectrum), DT_E_ARGUMENT);
	options.to_hz = 2000;
	options.per_octave = 100000;
	assert_int_equal(spectrum_compute(&record, &options, &spectrum), DT_E_ARGUMENT);
	limit_free(&curve);
	record_free(&record);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(reading), cmocka_unit_test(between),  cmocka_unit_test(spectra),
	        cmocka_unit_test(bands),   cmocka_unit_test(spectrum),
	};

	return cmocka_run_group_tests(tests, make_file, remove_file);
}
