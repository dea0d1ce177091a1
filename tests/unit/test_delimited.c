/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "host/record/read.h"
#include "tests/unit/drop_by_hand.h"
#include "tests/unit/near.h"

/* ---- small texts ---- */

static char message[READ_MESSAGE_MAX]; /* of the last text, without the file's name */

static int read_text(const char *text, const char *columns, struct record *record)
{
	char *file = hand_file(".txt", text, strlen(text)), whole[READ_MESSAGE_MAX] = "";
	int error = read_record(record, file, columns, whole);

	if (error && strncmp(whole, file, strlen(file)) == 0)
		strcpy(message, whole + strlen(file));
	else
		strcpy(message, whole);
	assert_null(strchr(message, '\n'));
	hand_unlink(file);
	return error;
}

/* Reads the text and wants these rows of up to two channels; 1e9 stands for a bad one. */
static struct record expect(const char *text, const char *columns, size_t rows, const double *values)
{
	struct record record;

	if (read_text(text, columns, &record))
		fail_msg("%s", message);
	assert_false(record.is_drop);
	for (size_t c = 0; c < record.channel_count; c++) {
		const struct channel *channel = &record.channels[c];

		assert_int_equal(channel->count, rows);
		assert_true(channel->start_s == 0);
		for (size_t k = 0; k < rows; k++) {
			double value = values[k * record.channel_count + c];

			if (value == 1e9) {
				assert_int_equal(channel->sample[k], SAMPLE_BAD);
				assert_true(isnan(channel->value_g[k]));
			} else {
				assert_int_equal(channel->sample[k], 0);
				assert_near(channel->value_g[k], value, 1e-12);
			}
		}
	}
	return record;
}

static void test_separators(void **state)
{
	static const double values[] = {1, -2, 3, 4.5};
	static const char *const texts[] = {
	        "0 1 -2\n0.5 3 4.5\n",
	        "  0   1  -2  \n  0.5   3  4.5  \n",
	        "0\t1\t-2\n0.5\t3\t4.5\n",
	        "0\t1\t-2\t\r\r\n0.5 \t3\t 4.5 \t\r\r\n",
	        "0,1,-2\n0.5,3,4.5\n",
	        "0 , 1 , -2\r\n0.5 , 3 , 4.5\r\n",
	        "0;1;-2\n0,5;3;4,5\n",
	        "0\t1\t-2\n0,5\t3\t4,5\n",
	        "0;1;-2\n0.5;3;4.5\n",
	        "0,\t1;-2\n0.5,\t3;4.5\n",
	        "0.0\t1,-2\n0.5\t3,4.5\n",
	        "\357\273\2770,1,-2\n0.5,3,4.5\n",
	        "0,\"1\",\"-2\"\n\n   \n# between\n0.5,3,4.5\n\n",
	        "+0e0,1e0,-2E+0\n5e-1,.3e1,45e-1\n",
	};

	(void)state;
	for (size_t i = 0; i < sizeof(texts) / sizeof(texts[0]); i++) {
		struct record record;

		print_message("# text %zu\n", i);
		record = expect(texts[i], "time:s,a:g,b:g", 2, values);
		assert_true(record.channels[0].rate_hz == 2);
		assert_string_equal(record.format, "delimited");
		assert_int_equal(record.flags, 0);
		record_free(&record);
	}
}

static void test_units_and_signs(void **state)
{
	static const double values[] = {1, -2 / 9.80665, 3, 4.905 / 9.80665};
	struct record record;

	(void)state;
	record = expect("0 -1 -2 x\n250 -3 4.905 y\n", "time:us,up:-g,side:m/s2,-", 2, values);
	assert_string_equal(record.channels[0].name, "up");
	assert_string_equal(record.channels[1].name, "side");
	assert_near(record.channels[0].rate_hz, 4000, 1e-9);
	record_free(&record);
	record = expect("-1 7 -2\n-3 7 4.905\n", "up:-g,-,side:m/s2@51200", 2, values);
	assert_true(record.channels[1].rate_hz == 51200);
	record_free(&record);
	record = expect("1 -2 0\n3 4.905 10\n", "time at end:g,b:m/s2,time:ms", 2, values);
	assert_near(record.channels[0].rate_hz, 100, 1e-9);
	record_free(&record);
}

static void test_blanks_around_entries(void **state)
{
	static const double values[] = {-1, -2 / 9.80665, -3, 4.905 / 9.80665};
	static const char *const columns[] = {
	        " time : ms,\tup : -g , side:m/s2, - ",
	        "time:ms, up:- g, side:m/s^2,-",
	        "time:ms,up :-g,side: m/s\302\262 , -\t",
	};

	(void)state;
	for (size_t i = 0; i < sizeof(columns) / sizeof(columns[0]); i++) {
		struct record record = expect("0 1 -2 x\n0.25 3 4.905 y\n", columns[i], 2, values);

		assert_int_equal(record.channel_count, 2);
		assert_string_equal(record.channels[0].name, "up");
		assert_string_equal(record.channels[1].name, "side");
		assert_near(record.channels[0].rate_hz, 4000, 1e-9);
		record_free(&record);
	}
	{
		struct record record = expect("-1 2\n-3 -4.905\n", "up:g @ 10, side: -m/s^2", 2, values);

		assert_true(record.channels[1].rate_hz == 10);
		record_free(&record);
	}
}

static void test_headers(void **state)
{
	static const double values[] = {1, 2, 3, 4};
	static const char *const texts[] = {
	        "time a b\n0 1 2\n1 3 4\n",
	        "\"Time (s)\",\"Acceleration x (g)\",\"y, too\"\n0,1,2\n1,3,4\n",
	        "# a comment\n\nTest 7 of 2023\n100 Hz\ns,g,g\n0,1,2\n1,3,4\n",
	};

	(void)state;
	for (size_t i = 0; i < sizeof(texts) / sizeof(texts[0]); i++) {
		struct record record = expect(texts[i], "time:s,a:g,b:g", 2, values);

		record_free(&record);
	}
}

static void test_cells_that_are_no_numbers(void **state)
{
	static const double values[] = {1, 2, 1e9, 1e9, 5, 1e9, 7, 8, 9, 10};
	struct record record = expect("0,1,2\n1,nan,inf\n2,5,\n3,7,8\n4,9,10\n", "time:s,a:g,b:g", 5, values);

	(void)state;
	assert_int_equal(record.channels[0].flags, RECORD_FLAG_BAD);
	assert_int_equal(record.flags, RECORD_FLAG_BAD);
	assert_int_equal(record.lost_samples, 0);
	record_free(&record);
	record = expect("0,1,2\n1,0x10,--\n2,5,1e999\n3,7,8\n4,9,10\n", "time:s,a:g,b:g", 5, values);
	record_free(&record);
	assert_int_equal(read_text("0,1\n1,x\n2,x\n3,x\n4,1\n", "time:s,a:g", &record), DT_E_FORMAT);
	assert_string_equal(message, ": a has no number in 3 of 5 rows, expected at least half");
}

static void test_uneven_times(void **state)
{
	struct record record;
	char text[4096];
	size_t used;

	(void)state;
	for (int row_missing = 0; row_missing < 2; row_missing++) {
		used = 0;
		for (int k = 0; k < 100; k++)
			if (!row_missing || k != 50)
				used += (size_t)snprintf(text + used, sizeof(text) - used, "%.3f 1\n",
				                         k * 0.25 + k % 2 * 0.02);
		assert_int_equal(read_text(text, "time:ms,a:g", &record), 0);
		assert_int_equal(record.flags, row_missing ? RECORD_FLAG_LOST : 0);
		assert_int_equal(record.channels[0].flags, record.flags);
		assert_int_equal(record.channels[0].count, 100);
		assert_int_equal(record.lost_samples, row_missing);
		assert_int_equal(record.channels[0].sample[50], row_missing ? SAMPLE_LOST : 0);
		assert_near_part(record.channels[0].rate_hz, 4000.0, 1e-3);
		record_free(&record);
	}
}

/* ---- what is refused ---- */

static void refuse(const char *text, const char *columns, int code, const char *why)
{
	struct record record;
	int error = read_text(text, columns, &record);

	if (error != code || strncmp(message, why, strlen(why)) != 0)
		fail_msg("%d \"%s\", expected %d \"%s\"", error, message, code, why);
}

static void test_refused_texts(void **state)
{
	static const char rows[] = "t a\n0 1\n1 2\n2 3\n";

	(void)state;
	refuse(rows, NULL, DT_E_FORMAT,
	       ": neither the unit of time nor one of acceleration is told, expected --columns "
	       "\"time:s,a:g\" or "
	       "\"time:ms,a:g\"");
	refuse("only\nwords\n", NULL, DT_E_FORMAT, ":1: not a log of a drop tower, and no table of numbers");
	refuse("\xff\xfe"
	       "0",
	       "time:s,a:g", DT_E_FORMAT, ": text in UTF-16 of an odd number of bytes");
	refuse("\xfe\xff", NULL, DT_E_FORMAT, ": not a log of a drop tower, and no table of numbers");
	refuse(rows, "time:s,a:g,b:g", DT_E_FORMAT, ":2: 2 columns, expected 3");
	refuse(rows, "time:s", DT_E_ARGUMENT, "--columns: ");
	refuse("0 1\n1 2\n2 3 4\n", "time:s,a:g", DT_E_FORMAT, ":3: 3 columns, expected 2");
	refuse("0 1\n1 2\n2\n", "time:s,a:g", DT_E_FORMAT, ":3: 1 columns, expected 2");
	refuse("0,1\n1,2,\n", "time:s,a:g", DT_E_FORMAT, ":2: 3 columns, expected 2");
	refuse("0 1\n1 2\nend of file\n", "time:s,a:g", DT_E_FORMAT, ":3: 3 columns, expected 2");
	refuse("0 1\n1 2\nnan 3\n", "time:s,a:g", DT_E_FORMAT, ":3: no number in the time column");
	refuse("0 1\n1 2\n1 3\n", "time:s,a:g", DT_E_FORMAT,
	       ":3: time 1 s after 1 s, expected it to increase");
	refuse("0 1\n2 2\n1 3\n", "time:s,a:g", DT_E_FORMAT, ":3: time 1 s after 2 s");
	refuse("0 1\n", "time:s,a:g", DT_E_FORMAT, ":1: one row");
	refuse("\n\nonly\nwords\n", "time:s,a:g", DT_E_FORMAT,
	       ":3: no row of numbers from here on, expected 2");
	refuse("\n\n\n", "a:g@10", DT_E_FORMAT, ": no row of numbers");
	refuse("t,a\n0,\n1,\n2,5", "time:s,a:g", DT_E_FORMAT,
	       ": a has no number in 2 of 3 rows"); /* the file may end in 5 */
	refuse(rows, "a:g,b:g", DT_E_ARGUMENT,
	       ": neither a time column nor a rate, expected time:ms or name:unit@RATE");
	refuse("0 1\n1e-310 2\n", "time:s,a:g", DT_E_FORMAT, ":2: time column without a rate");
}

static void test_refused_columns(void **state)
{
	static const struct {
		const char *columns, *why;
	} table[] = {
	        {"", "--columns: \"\", expected name:unit"},
	        {"time:s,", "--columns: \"\", expected name:unit"},
	        {"-", "--columns: \"-\", expected at least one channel"},
	        {"time:s,-", "--columns: \"time:s,-\", expected at least one channel"},
	        {"time:s,a", "--columns: \"a\", expected name:unit"},
	        {"time:s,:g", "--columns: \":g\", expected name:unit"},
	        {"time:s,a:", "--columns: \"a:\", expected unit g"},
	        {"time:s,a:-", "--columns: \"a:-\", expected unit g"},
	        {"time:s,a:min", "--columns: \"a:min\", expected unit g, m/s2"},
	        {"time:s,a:V", "--columns: \"a:V\", expected unit g, m/s2"},
	        {"time:s,a:g*0", "--columns: \"a:g*0\", expected unit g, m/s2"},
	        {"time:s,a:V/(0mV/g)", "--columns: \"a:V/(0mV/g)\", expected unit g, m/s2"},
	        {"time:s,a:V/(10pC/g)", "--columns: \"a:V/(10pC/g)\", expected unit g, m/s2"},
	        {"time:s,a:V/(10mV/s)", "--columns: \"a:V/(10mV/s)\", expected unit g, m/s2"},
	        {"time:parsec,a:g", "--columns: \"time:parsec\", expected unit s, ms, us"},
	        {"time:-s,a:g", "--columns: \"time:-s\", expected unit s, ms, us"},
	        {"time:s,time:s", "--columns: \"time:s\", expected unit g"},
	        {"time:s,a:g,a:g", "--columns: \"a:g\", expected every name once"},
	        {"a:g@", "--columns: \"a:g@\", expected a rate"},
	        {"a:g@-5", "--columns: \"a:g@-5\", expected a rate"},
	        {"a:g@nan", "--columns: \"a:g@nan\", expected a rate"},
	        {"a:g@5,b:g@6", "--columns: \"b:g@6\", expected one rate"},
	        {"time:s,a:g@5", "--columns: \"time:s,a:g@5\", expected a time column or a rate"},
	        {"a name that is longer than there is room for:g", "--columns: \"a name"},
	        {"a\tb:g", "--columns: \"a\tb:g\", expected name:unit"},
	        {"time:s, ,a:g", "--columns: \"\", expected name:unit"},
	        {"time:s, :g", "--columns: \":g\", expected name:unit"},
	        {" time:ms,a:m/s^3", "--columns: \"a:m/s^3\", expected unit g"},
	};

	(void)state;
	for (size_t i = 0; i < sizeof(table) / sizeof(table[0]); i++)
		refuse("0 1\n1 2\n", table[i].columns, DT_E_ARGUMENT, table[i].why);
}

static void test_too_many_columns(void **state)
{
	char columns[257 * 2 + 8] = "a:g@1";
	struct record record;

	(void)state;
	for (int i = 0; i < 255; i++)
		strcat(columns, ",-");
	refuse("0 1\n1 2\n", columns, DT_E_FORMAT, ":1: 2 columns, expected 256");
	strcat(columns, ",-");
	refuse("0 1\n1 2\n", columns, DT_E_ARGUMENT, "--columns: \"-\", expected no more than 256");
	columns[0] = '\0';
	for (int i = 0; i < 250; i++)
		strcat(columns, "0 ");
	assert_int_equal(read_text(columns, "a:g@1", &record), DT_E_FORMAT);
	assert_string_equal(message, ":1: 250 columns, expected 1");
}

/* ---- LabVIEW ---- */

static const char labview[] = "LabVIEW Measurement\t\n"
                              "Writer_Version\t2\n"
                              "Separator\tTab\n"
                              "Decimal_Separator\t,\n"
                              "X_Columns\tOne\n"
                              "***End_of_Header***\t\n"
                              "\t\n"
                              "Channels\t3\n"
                              "X0\t1,4107E+2\t1,4107E+2\t0,0\n"
                              "Delta_X\t1,25E-4\t1,0\t1,0\n"
                              "***End_of_Header***\t\t\t\n"
                              "X_Value\tA\tB\tC\tComment\n"
                              "141,0700\t9,80665\t1,0\t7,0\tfirst\n"
                              "141,0701\t19,6133\t\t\n"
                              "141,0703\t-9,80665\t1,0\n"
                              "141,0704\t0\t2,5\t\t\n";

static void test_labview(void **state)
{
	static const double values[] = {1, 1, 2, 1e9, -1, 1, 0, 2.5};
	struct record record = expect(labview, "time:s,a:m/s2,b:g,-,-", 4, values);

	(void)state;
	assert_string_equal(record.format, "lvm");
	assert_near_part(record.channels[0].rate_hz, 8000.0, 1e-12);
	assert_int_equal(record.flags, RECORD_FLAG_BAD); /* rounding is not uneven */
	record_free(&record);
	record = expect(labview, "-,a:m/s2,b:g,-,-", 4, values); /* its header has the step */
	assert_near_part(record.channels[0].rate_hz, 8000.0, 1e-12);
	record_free(&record);
	refuse(labview, "time:s,a:m/s2,b:g,-", DT_E_FORMAT, ":13: 5 columns, expected 4");
	refuse(labview, "time:ms,a:m/s2,b:g,-,-", DT_E_FORMAT, ":16: time column steps by");
	refuse("LabVIEW Measurement\nSeparator\tTab\n", "time:s,a:g", DT_E_FORMAT,
	       ":2: 0 headers of a LabVIEW");
}

/* ---- damage ---- */

static void test_damage(void **state)
{
	char text[8192];
	size_t used = 0;

	(void)state;
	used += (size_t)snprintf(text, sizeof(text), "\"time\",\"a\"\r\n");
	for (int k = 0; k < 300; k++)
		used += (size_t)snprintf(text + used, sizeof(text) - used, "%.4f, %.5g\r\n", k * 0.01,
		                         k % 17 - 8.5);
	hand_fuzz(text, used, "time:ms,a:g", 48, 400);
	hand_fuzz(text, used, "a:g@10,b:m/s2", 49, 100);
	hand_fuzz(labview, sizeof(labview) - 1, "time:s,a:m/s2,b:g,-,-", 50, 400);
}

/* ---- real recordings ---- */

static struct record read_real(const char *name, const char *columns)
{
	char file[256], whole[READ_MESSAGE_MAX];
	struct record record;

	snprintf(file, sizeof(file), "../shared/data/%s", name);
	if (access(file, R_OK))
		skip();
	if (read_record(&record, file, columns, whole))
		fail_msg("%s", whole);
	return record;
}

/* The largest value and its place. */
static double largest(const struct channel *channel, size_t *at)
{
	*at = 0;
	for (size_t k = 0; k < channel->count; k++)
		if (channel->value_g[k] > channel->value_g[*at])
			*at = k;
	return channel->value_g[*at];
}

static void test_real_shocks(void **state)
{
	static const struct {
		const char *name;
		double first_g, board_g, last_g; /* as the first and last rows have them */
	} table[] = {{"T04", 12.06219, -66.181723, 113.31139},
	             {"T06", 9.153420, 35.727277, -141.301},
	             {"T08", 19.4972, 6.426277, -136.634}};

	(void)state;
	for (int i = 0; i < 3; i++) {
		char name[64];
		struct record record;

		snprintf(name, sizeof(name), "afrl_in_situ/%s.txt", table[i].name);
		record = read_real(name, "time:ms,fixture:g,board:-g,-,-,-");
		assert_int_equal(record.channel_count, 2);
		assert_int_equal(record.channels[0].count, 5501);
		assert_near(record.channels[0].rate_hz, 1e6, 0.01);
		assert_near(record.channels[0].value_g[0], table[i].first_g, 1e-3);
		assert_near(record.channels[1].value_g[0], table[i].board_g, 1e-3);
		assert_near(record.channels[0].value_g[5500], table[i].last_g, 1e-2);
		assert_int_equal(record.flags, 0);
		record_free(&record);
	}
}

static void test_real_impacts(void **state)
{
	struct record record;
	size_t at;

	(void)state;
	record = read_real("repeated_impacts/acc_base_a0.txt", "time:s,base:g");
	assert_int_equal(record.channels[0].count, 1439);
	assert_near(record.channels[0].rate_hz, 49993, 1); /* published, and so is the peak */
	assert_near(largest(&record.channels[0], &at), 487, 5);
	assert_int_equal(record.flags, 0);
	record_free(&record);
	record = read_real("repeated_impacts/acc_pcb_a0.txt", "time:s,board:g");
	assert_int_equal(record.channels[0].count, 5500);
	assert_near(record.channels[0].rate_hz, 50000, 1);
	assert_near(largest(&record.channels[0], &at), 546.5, 0.5);
	record_free(&record);
}

static void test_real_labview(void **state)
{
	struct record record =
	        read_real("repeated_impacts/ds2_Test_004.lvm", "time:s,base:m/s2,board:m/s2,-,-,-,-");

	(void)state;
	assert_string_equal(record.format, "lvm");
	assert_int_equal(record.channel_count, 2);
	for (int c = 0; c < 2; c++) {
		assert_int_equal(record.channels[c].count, 51200);
		assert_near(record.channels[c].rate_hz, 51200, 1e-6);
	}
	assert_near(record.channels[0].value_g[0] * 9.80665, 3.867661, 1e-9);
	assert_near(record.channels[1].value_g[0] * 9.80665, 0.298372, 1e-9);
	assert_near(record.channels[1].value_g[51199] * 9.80665, -3.087500, 1e-9);
	assert_int_equal(record.flags, 0);
	record_free(&record);
}

static void test_real_phones(void **state)
{
	static const struct {
		const char *name;
		size_t count;
		double first_y_m_s2, last_z_m_s2;
	} table[] = {{"phone_fall/fall_1.csv", 1748, 3.788146973e-1, 1.025175476e1},
	             {"phone_fall/fall_2.csv", 1520, 5.798339844e-2, 8.594955444}};

	(void)state;
	for (int i = 0; i < 2; i++) {
		struct record record = read_real(table[i].name, "time:s,x:m/s2,y:m/s2,z:m/s2,-");

		assert_int_equal(record.channels[2].count, table[i].count);
		assert_near(record.channels[0].rate_hz, 200, 4);
		assert_near(record.channels[1].value_g[0] * 9.80665, table[i].first_y_m_s2, 1e-9);
		assert_near(record.channels[2].value_g[table[i].count - 1] * 9.80665, table[i].last_z_m_s2,
		            1e-9);
		record_free(&record);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(test_separators),
	        cmocka_unit_test(test_units_and_signs),
	        cmocka_unit_test(test_blanks_around_entries),
	        cmocka_unit_test(test_headers),
	        cmocka_unit_test(test_cells_that_are_no_numbers),
	        cmocka_unit_test(test_uneven_times),
	        cmocka_unit_test(test_refused_texts),
	        cmocka_unit_test(test_refused_columns),
	        cmocka_unit_test(test_too_many_columns),
	        cmocka_unit_test(test_labview),
	        cmocka_unit_test(test_damage),
	        cmocka_unit_test(test_real_shocks),
	        cmocka_unit_test(test_real_impacts),
	        cmocka_unit_test(test_real_labview),
	        cmocka_unit_test(test_real_phones),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
