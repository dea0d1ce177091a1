/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "common/units.h"
#include "host/estimate/estimate.h"
#include "host/record/read.h"
#include "tests/unit/drop_by_hand.h"
#include "tests/unit/near.h"
#include "tests/unit/synth.h"

/* Files of other programs that could be misread: each is right, flagged, or refused beside its line. */

static char message[READ_MESSAGE_MAX]; /* of the last text, without the file's name */
static char text[1 << 18];
static size_t used;

__attribute__((format(printf, 1, 2))) static void put(const char *format, ...)
{
	va_list list;

	va_start(list, format);
	used += (size_t)vsnprintf(text + used, sizeof(text) - used, format, list);
	va_end(list);
	assert_true(used < sizeof(text));
}

static int read_put(const char *columns, struct record *record)
{
	char *file = hand_file(".txt", text, used), whole[READ_MESSAGE_MAX] = "";
	int error = read_record(record, file, columns, whole);

	snprintf(message, sizeof(message), "%s",
	         error && strncmp(whole, file, strlen(file)) == 0 ? whole + strlen(file) : whole);
	assert_null(strchr(message, '\n'));
	hand_unlink(file);
	used = 0;
	return error;
}

static struct record read_good(const char *columns)
{
	struct record record;

	if (read_put(columns, &record) != 0)
		fail_msg("%s", message);
	return record;
}

static void refuse(const char *columns, const char *why)
{
	struct record record;
	int error = read_put(columns, &record);

	if (error != DT_E_FORMAT || strncmp(message, why, strlen(why)) != 0)
		fail_msg("%d \"%s\", expected \"%s\"", error, message, why);
}

/* ---- time columns ---- */

static double pulse(double t)
{
	return 800 * synth_pulse(SYNTH_HALF_SINE, (t - 0.03) / 4e-3);
}

/* A half-sine of 800 g and 4 ms with rows left out before it, in its flank and behind it: its height, area
 * and place are those of the whole record. */
static void gap(void **state)
{
	static const struct {
		size_t from, to;
	} gaps[] = {{100, 220}, {304, 310}, {360, 500}};
	struct estimate_options options = {.family = ESTIMATE_FAMILY_AUTO};
	struct synth_random random = {81};

	(void)state;
	for (size_t i = 0; i < 3; i++) {
		struct analysis analysis;
		struct record record;
		size_t lost = gaps[i].to - gaps[i].from;

		put("Time [ms],Accel [g]\n");
		for (size_t k = 0; k < 1000; k++)
			if (k < gaps[i].from || k >= gaps[i].to)
				put("%.3f,%.4f\n", (double)k * 0.1,
				    pulse((double)k * 1e-4) + 0.5 * synth_normal(&random));
		record = read_good("time:ms,a:g");
		assert_int_equal(record.channels[0].count, 1000);
		assert_near_part(record.channels[0].rate_hz, 10000.0, 1e-9);
		assert_int_equal(record.lost_samples, lost);
		assert_int_equal(record.flags, RECORD_FLAG_LOST);
		for (size_t k = 0; k < 1000; k++)
			assert_int_equal(record.channels[0].sample[k],
			                 k >= gaps[i].from && k < gaps[i].to ? SAMPLE_LOST : 0);
		assert_int_equal(estimate_record(&record, &options, &analysis), 0);
		assert_near(analysis.channels[0].peak.value_g, 800, 3);
		assert_near(analysis.channels[0].peak.time_s, 0.032, 2e-5);
		/* 2 / pi of height times base */
		assert_near_part(analysis.channels[0].pulse.velocity_change_m_s,
		                 800 * 4e-3 * 2 / 3.14159265358979 * UNITS_G_M_S2, 0.01);
		estimate_free(&analysis);
		record_free(&record);
	}
}

static void two_rates(void **state)
{
	(void)state;
	put("t a\n");
	for (int k = 0; k < 100; k++)
		put("%.4f %d\n", k < 50 ? k * 1e-3 : 0.05 + (k - 50) * 5e-3, k);
	refuse("time:s,a:g", ":53: two rates: time steps by 0.001 s (1000 Hz) above and by 0.005 s (200 Hz)");
	put("t a\n0 1\n0.1 1\n0.2 1\n0.2 1\n0.3 1\n");
	refuse("time:s,a:g", ":5: time 0.2 s after 0.2 s, expected it to increase");
	put("t a\n0 1\n0.1 1\n0.2 1\n0.15 1\n0.3 1\n");
	refuse("time:s,a:g", ":5: time 0.15 s after 0.2 s, expected it to increase");
}

/* ---- LabVIEW ---- */

static void put_labview(const char *samples, const char *unit, const char *time)
{
	put("LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\nX_Columns\tOne\n"
	    "***End_of_Header***\t\n\t\nChannels\t3\nSamples\t%s\nDate\t2024/05/05\t2024/05/05\t2024/05/05\n"
	    "Time\t10:00:00.5\t10:00:00.5\t%s\nY_Unit_Label\tg\tm/s^2\t%s\nX_Dimension\tTime\tTime\tTime\n"
	    "X0\t2.0E+0\t2.5E+0\t2.0E+0\nDelta_X\t1.0E-3\t4.0E-3\t1.0E-3\n***End_of_Header***\t\t\t\n"
	    "X_Value\tfast\tslow\tother\tComment\n",
	    samples, time, unit);
	for (int k = 0; k < 40; k++)
		if (k < 10)
			put("%.6f\t%d.5\t%d.81\t%d.25\n", 2 + k * 1e-3, k, k, k);
		else
			put("%.6f\t%d.5\t\t%d.25\n", 2 + k * 1e-3, k, k);
}

/* Step, beginning, count and unit of each channel are its own. */
static void labview(void **state)
{
	struct record record;

	(void)state;
	for (int timed = 0; timed < 2; timed++) {
		put_labview("40\t10\t40", "g", "10:00:00.5");
		record = read_good(timed ? "time:s,fast:g,slow:m/s2,-,-" : "-,fast:g,slow:m/s2,-,-");
		assert_int_equal(record.flags, 0);
		assert_int_equal(record.channels[0].count, 40);
		assert_near_part(record.channels[0].rate_hz, 1000.0, 1e-12);
		assert_near(record.channels[0].start_s, 0, 0);
		assert_int_equal(record.channels[1].count, 10);
		assert_near_part(record.channels[1].rate_hz, 250.0, 1e-12);
		assert_near(record.channels[1].start_s, 0.5, 1e-12);
		assert_near(record.channels[1].value_g[9], 9.81 / UNITS_G_M_S2, 1e-12);
		record_free(&record);
	}
}

static void labview_refused(void **state)
{
	(void)state;
	put_labview("40\t12\t40", "g", "10:00:00.5");
	refuse("-,fast:g,slow:m/s2,-,-", ":9: column 3, slow, has 10 samples, expected Samples = 12");
	put_labview("40\t8\t40", "g", "10:00:00.5");
	refuse("-,fast:g,slow:m/s2,-,-", ":9: column 3, slow, has 10 samples, expected Samples = 8");
	put_labview("40\t10\t40", "V", "10:00:00.5");
	refuse("-,fast:g,-,other:g,-", ":12: column 4, \"V\", is in V, but --columns says other:g");
	put_labview("40\t10\t40", "g", "10:00:00.5");
	refuse("-,fast:m/s2,-,-,-", ":12: column 2, \"g\", is in g, but --columns says fast:m/s2");
	put_labview("40\t10\t40", "g", "10:00:07");
	refuse("-,fast:g,-,other:g,-", ":11: columns 2 and 4 began at different times");
	put_labview("40\t10\t40", "g", "10:00:00.5");
	refuse("-,fast:g@5000,-,-,-",
	       ":15: column 2 has Delta_X = 0.001 s (1000 Hz), but --columns says 5000 Hz");
	put_labview("40\t10\t40", "g", "10:00:00.5");
	put("Channels\t1\n");
	refuse("-,fast:g,-,-,-", ":58: another segment begins");
}

/* ---- units ---- */

static void units(void **state)
{
	static const struct {
		const char *header, *columns, *why; /* NULL: is read */
	} table[] = {
	        {"Time (s),Accel [g]", "time:s,a:g", NULL},
	        {"Time (s),Accel [g]", "time:s,a:m/s2",
	         ":1: column 2, \"Accel [g]\", is in g, but --columns"},
	        {"Time (s),Accel (m/s^2)", "time:s,a:g", ":1: column 2, \"Accel (m/s^2)\", is in m/s2, but"},
	        {"Time [ms],Accel", "time:s,a:g",
	         ":1: column 1, \"Time [ms]\", is in ms, but --columns says time:s"},
	        {"Time [ms]\tAccel", "time:ms,a:g", NULL},
	        {"Time [ms] Accel [m/s\302\262]", "time:ms,a:g",
	         ":1: column 2, \"Accel [m/s\302\262]\", is in m/s2"},
	        {"\"t (\302\265s)\";\"a, left (m/s**2)\"", "time:us,a:m/s2", NULL},
	        {"time_us,accel_g", "time:ms,a:g", ":1: column 1, \"time_us\", is in us"},
	        {"time_ms,accel_mg", "time:ms,a:g", ":1: column 2, \"accel_mg\", is in mg"},
	        {"time_ms,accel_mg", "time:ms,a:mg", NULL},
	        {"Time,Accel\nms,g", "time:ms,a:g", NULL},
	        {"Time,Accel\ns,mm/s2", "time:s,a:g", ":2: column 2, \"mm/s2\", is in mm/s2"},
	        {"# time(s), \t acceleration(g)", "time:ms,a:g", ":1: column 1, \"time(s),\", is in s"},
	        {"Time (s),Bridge (V)", "time:s,a:g", ":1: column 2, \"Bridge (V)\", is in V"},
	        {"Time (s),Shock (kg)", "time:s,a:g", ":1: column 2, \"Shock (kg)\", is in kilo-g"},
	        {"Time (s),Accel (left) (min)", "time:s,a:g", NULL},
	        {"Time (s),Accel (A)", "time:s,a:g", NULL},
	        {"Time (s),Volts (V)", "time:s,-,a:g", ":1: 2 columns, expected 3"},
	};

	(void)state;
	for (size_t i = 0; i < sizeof(table) / sizeof(table[0]); i++) {
		struct record record;

		put("%s\n0,1\n1,2\n2,3\n", table[i].header);
		if (!table[i].why) {
			record = read_good(table[i].columns);
			assert_int_equal(record.flags, 0);
			record_free(&record);
		} else if (i + 1 < sizeof(table) / sizeof(table[0])) {
			refuse(table[i].columns, table[i].why);
		} else {
			assert_int_equal(read_put(table[i].columns, &record), DT_E_FORMAT);
		}
	}
	put("Time (s),Strain (ustrain),Accel (g)\n0,1,1\n1,2,2\n");
	{
		struct record record = read_good("time:s,-,a:g"); /* what is left out may be anything */

		record_free(&record);
	}
}

/* The units that --columns takes: 1000 of each in g or s. */
static void units_of_columns(void **state)
{
	static const struct {
		const char *unit;
		double g;
	} table[] = {{"mg", 1},
	             {"cm/s2", 10 / UNITS_G_M_S2},
	             {"ft/s2", 304.8 / UNITS_G_M_S2},
	             {"in/s^2", 25.4 / UNITS_G_M_S2}};

	(void)state;
	for (size_t i = 0; i < 4; i++) {
		char columns[32];
		struct record record;

		snprintf(columns, sizeof(columns), "time:ns,a:%s", table[i].unit);
		put("0 1000\n1 1000\n");
		record = read_good(columns);
		assert_near_part(record.channels[0].value_g[0], table[i].g, 1e-12);
		assert_near_part(record.channels[0].rate_hz, 1e9, 1e-12);
		record_free(&record);
	}
}

/* ---- names and numbers ---- */

static void same_names(void **state)
{
	struct record record;

	(void)state;
	put("t,acc,acc\n0,1,2\n1,2,3\n");
	record = read_good("time:s,a:g,b:g");
	assert_int_equal(record.flags, RECORD_FLAG_SAME_NAMES);
	record_free(&record);
	put("t,acc,acc\n0,1,2\n1,2,3\n");
	record = read_good("time:s,a:g,-");
	assert_int_equal(record.flags, 0);
	record_free(&record);
}

static void thousands_and_units(void **state)
{
	static const struct {
		const char *row, *why;
	} table[] = {
	        {"3,\"1,234.5\"", ":5: \"1,234.5\" in column 2 has a thousands separator"},
	        {"3,1'234.5", ":5: \"1'234.5\" in column 2 has a thousands separator"},
	        {"3,\"1 234.5\"", ":5: \"1 234.5\" in column 2 has a thousands separator"},
	        {"3,1\302\240234.5", ":5: \"1\302\240234.5\" in column 2 has a thousands separator"},
	        {"3,\"12.3 g\"", ":5: \"12.3 g\" in column 2 has a unit behind its number"},
	        {"3,12.3g", ":5: \"12.3g\" in column 2 has a unit behind its number"},
	        {"3,\"9.81 m/s2\"", ":5: \"9.81 m/s2\" in column 2 has a unit behind its number"},
	        {"3 s,12.3", ":5: 3 columns, expected 2"},
	        {"3s,12.3", ":5: \"3s\" in column 1 has a unit behind its number"},
	        {"3,1,234.5", ":5: 3 columns, expected 2"},
	};
	struct record record;

	(void)state;
	for (size_t i = 0; i < sizeof(table) / sizeof(table[0]); i++) {
		put("t,a\n0,1.5\n1,2.5\n2,3.5\n%s\n4,1.5\n", table[i].row);
		refuse("time:s,a:g", table[i].why);
	}
	put("0 s,1 g\n1 s,2 g\n");
	assert_int_equal(read_put("time:s,a:g", &record), DT_E_FORMAT);
	put("0s,1g\n1s,2g\n");
	refuse("time:s,a:g", ":1: \"0s\" in column 1 has a unit");
	/* 1234 or 1.234 */
	put("t;a\n0;999\n1;1,234\n2;998\n");
	refuse("time:s,a:g", ":3: a comma before three digits may part thousands or decimals");
	put("t;a\n0;999\n1;1,234\n2;998,5\n");
	record = read_good("time:s,a:g");
	assert_near(record.channels[0].value_g[1], 1.234, 1e-12);
	record_free(&record);
}

/* What the end of a file may have taken away. */
static void cut(void **state)
{
	static const struct {
		const char *row;
		bool bad; /* it has lost digits that the row before has */
	} table[] = {
	        {"2.0,3.125", false}, {"2.0,3.12", true}, {"2.0,3.", true}, {"2.0,3", true}, {"2.0,", true}};
	struct record record;

	(void)state;
	for (size_t i = 0; i < sizeof(table) / sizeof(table[0]); i++) {
		put("t,a\n0.0,1.125\n1.0,2.125\n%s", table[i].row);
		record = read_good("time:s,a:g");
		assert_true(record.flags & RECORD_FLAG_NO_LINE_END);
		assert_int_equal(record.channels[0].sample[2], table[i].bad ? SAMPLE_BAD : 0);
		record_free(&record);
	}
	for (size_t length = 1; length < strlen("3.125e+2"); length++) {
		put("t,a\n0.0,1.125e+2\n1.0,2.125e+2\n2.0,%.*s", (int)length, "3.125e+2");
		record = read_good("time:s,a:g");
		assert_int_equal(record.channels[0].sample[2], SAMPLE_BAD);
		record_free(&record);
	}
	put("t,a\n0.0,1.125\n1.0,2.125\n2.");
	refuse("time:s,a:g", ":4: 1 columns, expected 2");
	put("a,t\n1,0.00\n2,1.00\n3,2.0");
	refuse("a:g,time:s", ":4: the file ends within a time");
}

/* ---- universal files with times ---- */

static void put_uff58(double second_step_s)
{
	double t = 0;

	put("    -1\n    58\nshock\nNONE\nNONE\nNONE\nNONE\n%5d%10d%5d%10d %-10s%10d%4d %-10s%10d%4d\n", 1, 0,
	    0, 0, "NONE", 1, 1, "NONE", 0, 0);
	put("%10d%10d%10d%13.5E%13.5E%13.5E\n", 2, 60, 0, 0.0, 0.0, 0.0);
	put("%10d%5d%5d%5d %-20s %-20s\n", 17, 0, 0, 0, "Time", "s");
	put("%10d%5d%5d%5d %-20s %-20s\n", 12, 0, 0, 0, "Acceleration", "m/s^2");
	put("%10d%5d%5d%5d %-20s %-20s\n%10d%5d%5d%5d %-20s %-20s\n", 0, 0, 0, 0, "NONE", "NONE", 0, 0, 0, 0,
	    "NONE", "NONE");
	for (int k = 0; k < 60; k++) {
		put("%13.5E%13.5E%s", t, k * UNITS_G_M_S2, k % 3 == 2 ? "\n" : "");
		t += k < 30 ? 1e-3 : second_step_s;
		t += k == 10 && second_step_s < 2e-3 ? 5e-3 : 0;
	}
	put("    -1\n");
}

/* Times that leave five samples out lose them; times of two rates are refused beside their line. */
static void uff58_times(void **state)
{
	struct record record;

	(void)state;
	put_uff58(1e-3);
	record = read_good(NULL);
	assert_int_equal(record.channels[0].count, 65);
	assert_int_equal(record.lost_samples, 5);
	assert_near_part(record.channels[0].rate_hz, 1000.0, 1e-4);
	for (size_t k = 0; k < 65; k++)
		assert_int_equal(record.channels[0].sample[k], k > 10 && k < 16 ? SAMPLE_LOST : 0);
	assert_near(record.channels[0].value_g[16], 11, 1e-4);
	record_free(&record);
	put_uff58(4e-3);
	/* eleven lines of a head from line 3 on, three pairs a line */
	refuse(NULL,
	       ":24: \"shock\": two rates: time steps by 0.001 s (1000 Hz) above and by 0.004 s (250 Hz)");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(gap),        cmocka_unit_test(two_rates),
	        cmocka_unit_test(labview),    cmocka_unit_test(labview_refused),
	        cmocka_unit_test(units),      cmocka_unit_test(units_of_columns),
	        cmocka_unit_test(same_names), cmocka_unit_test(thousands_and_units),
	        cmocka_unit_test(cut),        cmocka_unit_test(uff58_times),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
