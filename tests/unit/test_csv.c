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

#include "host/record/join.h"
#include "host/record/read.h"
#include "host/record/seal.h"
#include "host/record/metadata.h"
#include "host/record/write.h"
#include "tests/unit/drop_by_hand.h"

static struct hand_drop drop;

static void read_back(const char *file, const char *format, struct record *record)
{
	char message[READ_MESSAGE_MAX] = "";

	if (read_record(record, file, NULL, message))
		fail_msg("%s", message);
	assert_string_equal(record->format, format);
}

/* Writes the record in a format, reads it back, and wants the same. Returns the file. */
static char *round_trip(const struct record *record, const char *ending, const char *format)
{
	char message[READ_MESSAGE_MAX] = "", *file = hand_file(ending, "", 0);
	struct record again;

	if (write_record(record, file, message))
		fail_msg("%s", message);
	read_back(file, format, &again);
	hand_check_equal(&again, record);
	record_free(&again);
	return file;
}

static struct record make_drop(uint64_t seed, bool losses, bool with_end)
{
	struct join *join = join_create();
	struct record record;
	struct frame frame;

	assert_non_null(join);
	for (uint32_t tick = 0; tick < drop.ticks; tick++) {
		for (unsigned sensor = 1; sensor <= 2; sensor++) {
			if (losses && hand_random(&seed) % 8 == 0 && tick > 0)
				continue;
			hand_block(&drop, sensor, tick, false, &frame);
			join_feed(join, &frame);
		}
	}
	hand_capture_end(&drop, &frame);
	if (with_end)
		join_feed(join, &frame);
	assert_int_equal(join_take(join, &record), 0);
	join_destroy(join);
	return record;
}

static void test_one_drop_in_every_format(void **state)
{
	(void)state;
	for (uint64_t seed = 1; seed < 5; seed++) {
		struct record record;
		char *file;

		print_message("# seed %llu\n", (unsigned long long)seed);
		hand_fill(&drop, seed == 2 ? UINT32_MAX - 30 : 1000, 60, seed);
		drop.sample[0][4][0] = -32768;
		drop.sample[1][5][9] = -32767;
		drop.sample[1][6][19] = 16001;
		drop.marks = seed == 3 ? 1u << 1 | 1u << 5 : 1u << 3;
		drop.frame_speed_mm_s = (uint16_t)(seed == 4 ? 0 : 3912 + seed);
		drop.camera_frame = (int16_t)(seed == 2 ? -300 : 32767);
		record = make_drop(seed, seed > 1, seed != 4);
		assert_int_equal(record.crc_agrees, seed == 1);
		hand_unlink(round_trip(&record, ".log", "candump"));
		hand_unlink(round_trip(&record, ".candump", "candump"));
		hand_unlink(round_trip(&record, ".csv", "csv"));
		record.counters.repeated = 5; /* what frames do not show, the other two carry */
		record.counters.reordered = 6;
		record.counters.corrupt = 7;
		record.counters.resent = 8;
		record.counters.conflicting = (uint64_t)1 << 40;
		file = round_trip(&record, ".csv", "csv");
		hand_unlink(file);
		hand_unlink(round_trip(&record, ".lcm", "lcm"));
		record_free(&record);
	}
}

/* A double of any bits but NaN and infinity. */
static double any_double(uint64_t *random)
{
	double value;

	do {
		uint64_t bits = (uint64_t)hand_random(random) << 32 | hand_random(random);

		memcpy(&value, &bits, sizeof(value));
	} while (!isfinite(value));
	return value;
}

static void fill_any(struct channel *channel, uint64_t *random)
{
	channel->start_s = hand_random(random) % 3 ? 0 : hand_random(random) * 1e-12;
	channel->range_g = hand_random(random) % 2 ? 0 : any_double(random);
	channel->flags = hand_random(random) % 2 ? RECORD_FLAG_UNEVEN : 0;
	for (size_t k = 0; k < channel->count; k++) {
		unsigned luck = hand_random(random) % 40;

		channel->sample[k] = luck == 0   ? SAMPLE_LOST
		                     : luck == 1 ? SAMPLE_BAD
		                     : luck == 2 ? SAMPLE_CLIPPED
		                                 : 0;
		channel->value_g[k] = luck < 2 ? NAN : luck < 20 ? any_double(random) : (int)luck / 32.0;
	}
}

static void test_any_record_comes_back_exactly(void **state)
{
	static const char *const names[] = {"time",     "a b", "x:y",
	                                    "\xC3\xBC", "1",   "a name of thirty-one characters"};

	(void)state;
	for (uint64_t seed = 100; seed < 140; seed++) {
		struct record record;
		uint64_t random = seed;
		size_t channels = 1 + hand_random(&random) % 6;

		print_message("# seed %llu\n", (unsigned long long)seed);
		record_init(&record);
		for (size_t i = 0; i < channels; i++) {
			double rate_hz = hand_random(&random) % 2
			                         ? 1e6 / (1 + hand_random(&random) % 1000)
			                         : 0.001 * (1 + hand_random(&random) % 100000);
			struct channel *channel =
			        record_add_channel(&record, names[i], rate_hz, hand_random(&random) % 200);

			assert_non_null(channel);
			fill_any(channel, &random);
		}
		record_finish(&record);
		hand_unlink(round_trip(&record, ".csv", "csv"));
		record_free(&record);
	}
}

/* The layout itself, once, byte by byte. */
static void test_the_layout(void **state)
{
	static const char expected[] =
	        "time_s,A_g,B_g,marks,droptower_csv_2\n"
	        "0,0.1,,,date 2026-11-27T23:18:58+00:00\n"
	        "0.25,600,,A clipped;B lost,operator Ann; B.\n"
	        "0.5,-0.03125,,,simulated 1\n"
	        "0.75,,,B bad,channel rate_hz=4 start_s=0 range_g=500 count=3 uneven=0 name=A\n"
	        ",,,,channel rate_hz=2 start_s=0.25 range_g=0 count=2 uneven=1 name=B\n"
	        /* by sha256sum, of this text with 64 times '0' here */
	        ",,,,sha256 c01d60105dad24e4ca3782dca5ac2e61f445aebeb5969cff1aff32f303c5c7c5\n";
	char message[READ_MESSAGE_MAX], *file = hand_file(".csv", "", 0), *bytes;
	struct record record, again;
	struct channel *a, *b;
	size_t size;

	(void)state;
	record_init(&record);
	a = record_add_channel(&record, "A", 4, 3);
	a->range_g = 500;
	a->value_g[0] = 0.1;
	a->value_g[1] = 600;
	a->value_g[2] = -0.03125;
	a->sample[0] = a->sample[2] = 0;
	a->sample[1] = SAMPLE_CLIPPED;
	b = record_add_channel(&record, "B", 2, 2);
	b->start_s = 0.25;
	b->flags = RECORD_FLAG_UNEVEN;
	b->sample[1] = SAMPLE_BAD;
	record.time_s = 1795821538;
	record.simulated = 1;
	metadata_take_words(record.operator_name, " Ann, B.\n");
	assert_int_equal(write_record(&record, file, message), 0);
	bytes = hand_read(file, &size);
	assert_string_equal(bytes, expected);
	free(bytes);
	/* and back */
	read_back(file, "csv", &again);
	assert_true(again.time_s == record.time_s && again.simulated == 1);
	assert_string_equal(again.operator_name, "Ann; B.");
	assert_int_equal(again.channels[0].sample[1], SAMPLE_CLIPPED);
	assert_int_equal(again.channels[1].sample[0], SAMPLE_LOST);
	assert_int_equal(again.channels[1].sample[1], SAMPLE_BAD);
	assert_true(again.channels[0].value_g[1] == 600 && again.file_sealed);
	record_free(&again);
	hand_unlink(file);
	record_free(&record);
}

/* ---- what is refused ---- */

static const char good[] = "# droptower csv 1\n"
                           "# channel rate_hz=4 start_s=0 range_g=500 count=3 uneven=0 name=A\n"
                           "# channel rate_hz=2 start_s=0 range_g=0 count=2 uneven=0 name=B\n"
                           "time_s,A_g,B_g\n"
                           "0,1,2\n"
                           "0.25,3,\n"
                           "0.5,4,5\n";

/* The good text with one stretch replaced must be refused at the line. */
static void refuse_of(const char *whole, const char *from, const char *to, unsigned line, const char *why)
{
	char text[1024], message[READ_MESSAGE_MAX] = "", place[16];
	const char *at = strstr(whole, from);
	struct record record;
	char *file;

	assert_non_null(at);
	snprintf(text, sizeof(text), "%.*s%s%s", (int)(at - whole), whole, to, at + strlen(from));
	file = hand_file(".csv", text, strlen(text));
	if (read_record(&record, file, NULL, message) == 0)
		fail_msg("\"%s\" for \"%s\" was read", to, from);
	snprintf(place, sizeof(place), ":%u: ", line);
	if (strncmp(message, file, strlen(file)) != 0 ||
	    strncmp(message + strlen(file), place, strlen(place)) != 0 || !strstr(message, why) ||
	    strchr(message, '\n'))
		fail_msg("\"%s\", expected line %u and \"%s\"", message, line, why);
	hand_unlink(file);
}

static void refuse(const char *from, const char *to, unsigned line, const char *why)
{
	refuse_of(good, from, to, line, why);
}

static void test_refusals(void **state)
{
	(void)state;
	refuse("csv 1", "csv 2", 1, "version");
	refuse("csv 1\n", "csv 1\n# colour 3\n", 2, "unknown key \"colour\"");
	refuse("csv 1\n", "csv 1\n# drop_id\n", 2, "expected \"key value\"");
	refuse("csv 1\n", "csv 1\n# drop_id 65536\n", 2, "drop_id \"65536\"");
	refuse("csv 1\n", "csv 1\n# blocks -1\n", 2, "blocks \"-1\"");
	refuse("csv 1\n", "csv 1\n# blocks 18446744073709551616\n", 2, "blocks");
	refuse("csv 1\n", "csv 1\n# trigger_s soon\n", 2, "trigger_s \"soon\"");
	refuse("csv 1\n", "csv 1\n# camera_frame -32769\n", 2, "camera_frame \"-32769\"");
	refuse("csv 1\n", "csv 1\n# camera_frame 32768\n", 2, "camera_frame \"32768\"");
	refuse("csv 1\n", "csv 1\n# camera_frame 12.5\n", 2, "camera_frame \"12.5\"");
	refuse("csv 1\n", "csv 1\n# camera_frame late\n", 2, "camera_frame \"late\"");
	refuse("csv 1\n", "csv 1\n# drop_id 3\n", 5, "S1X S1Y");
	refuse("csv 1\n", "csv 1\n# drop_id 3\n# last_tick_ms 5000\n", 6, "ticks");
	refuse("rate_hz=4", "rate_hz=0", 2, "expected rate_hz=");
	refuse("rate_hz=4", "rate_hz=nan", 2, "expected rate_hz=");
	refuse("rate_hz=4", "rate_hz=1e-320", 2, "expected rate_hz=");
	refuse("count=3", "count=1000000000", 2, "no more than the file holds");
	refuse("name=A", "name=", 2, "name=");
	refuse("name=A", "name=A,B", 2, "name=");
	refuse("time_s,A_g,B_g", "time_s,A_g", 4, "column names");
	refuse("time_s,A_g,B_g", "time_s,B_g,A_g", 4, "column names");
	refuse("time_s,A_g,B_g", "t,A_g,B_g", 4, "column names");
	refuse("0,1,2\n", "0,1,2,3\n", 5, "4 columns, expected 3");
	refuse("0,1,2\n", "0,1\n", 5, "2 columns, expected 3");
	refuse("0,1,2\n", "\n", 5, "1 columns, expected 3");
	refuse("0,1,2\n", "x,1,2\n", 5, "time");
	refuse("0,1,2\n", "0,1,nan\n", 5, "\"nan\" for B");
	refuse("0,1,2\n", "0,1,0x10\n", 5, "\"0x10\" for B");
	refuse("0,1,2\n", "0,1,2 \n", 5, "for B");
	refuse("0,1,2\n", "0,1,*\n", 5, "for B");
	refuse("0.25,3,\n", "0.25,3,9\n", 6, "sample of B at 0.25 s, expected at 0.5 s");
	refuse("0.25,3,\n", "0.26,3,\n", 6, "sample of A at 0.26 s, expected at 0.25 s");
	refuse("0.5,4,5\n", "", 6, "A ends after 2 samples, expected 3");
	refuse("0.5,4,5\n", "0.5,4,5\n0.75,6,\n", 8, "A has more samples than the 3");
	refuse("0.5,4,5\n", "0.5,4,", 7, "B ends after 1 samples, expected 2");
}

/* The same as a table, with what is known of it in the last column. */
static const char table[] = "time_s,A_g,B_g,marks,droptower_csv_2\n"
                            "0,1,2,,channel rate_hz=4 start_s=0 range_g=500 count=3 uneven=0 name=A\n"
                            "0.25,,,A lost,channel rate_hz=2 start_s=0 range_g=0 count=2 uneven=0 name=B\n"
                            "0.5,4,5,A clipped;B clipped,\n"
                            ",,,,operator Ann\n";

static void test_refusals_of_tables(void **state)
{
	(void)state;
	refuse_of(table, "A_g,B_g", "B_g,A_g", 1, "column names");
	refuse_of(table, ",,operator", ",operator", 5, "4 columns, expected 5");
	refuse_of(table, "operator Ann", "colour red", 5, "unknown key \"colour\"");
	refuse_of(table, "operator Ann", "operator", 5, "expected \"key value\"");
	refuse_of(table, "operator Ann", "date 2026-11-27", 5, "expected a time as");
	refuse_of(table, "operator Ann", "date 2026-13-27T23:18:58+00:00", 5, "expected a time as");
	refuse_of(table, ",,,,operator", ",7,,,operator", 5, "A has more samples");
	refuse_of(table, ",,,,operator", ",,,A lost,operator", 5, "more samples");
	refuse_of(table, "A lost", "A found", 3, "marks \"A found\"");
	refuse_of(table, "A lost", "C lost", 3, "marks \"C lost\"");
	refuse_of(table, "A clipped;B clipped", "B clipped;A clipped", 4, "marks \"A clipped\"");
	refuse_of(table, "0.25,,", "0.25,3,", 3, "marked as lost or bad");
	refuse_of(table, "0,1,2", "0,lost,2", 2, "\"lost\" for A");
	refuse_of(table, "0,1,2", "0,1*,2", 2, "\"1*\" for A");
	refuse_of(table, "0,1,2", "0,1,", 4, "sample of B at 0.5 s, expected at 0 s");
}

static void test_line_ends_of_other_systems(void **state)
{
	char text[2 * sizeof(good)], *to = text, *file;
	struct record record;

	(void)state;
	for (const char *from = good; *from; from++) {
		if (*from == '\n')
			*to++ = '\r';
		*to++ = *from;
	}
	file = hand_file(".csv", text, (size_t)(to - text));
	read_back(file, "csv", &record);
	assert_true(record.channels[1].value_g[1] == 5);
	record_free(&record);
	hand_unlink(file);
}

static void test_what_cannot_be_written(void **state)
{
	char message[READ_MESSAGE_MAX] = "";
	struct record record;

	(void)state;
	record_init(&record);
	assert_non_null(record_add_channel(&record, "a,b", 1, 1));
	assert_int_equal(write_record(&record, "/dev/null", message), DT_E_ARGUMENT);
	assert_non_null(strstr(message, "/dev/null: unknown ending, expected"));
	assert_int_equal(write_record(&record, "/nonexistent/x.csv", message), DT_E_SYSTEM);
	assert_non_null(strstr(message, "/nonexistent/x.csv: cannot be written: No such file or directory"));
	assert_int_equal(write_record(&record, "/nonexistent/x.lcm", message), DT_E_ARGUMENT);
	assert_non_null(strstr(message, "not a drop"));
	assert_int_equal(write_csv(&record, stdout), DT_E_ARGUMENT);
	assert_int_equal(write_frames(&record, NULL, NULL), DT_E_ARGUMENT);
	record_free(&record);
}

static void test_a_full_disk(void **state)
{
	FILE *full = fopen("/dev/full", "w");
	struct record record;

	(void)state;
	if (!full)
		skip();
	record_init(&record);
	assert_non_null(record_add_channel(&record, "a", 1, 20000));
	assert_int_equal(write_csv(&record, full), DT_E_SYSTEM);
	fclose(full);
	record_free(&record);
}

static int stop_at_five(void *context, const struct frame *frame)
{
	unsigned *count = context;

	assert_true(frame->time_us > 0);
	return ++*count == 5 ? DT_E_CLOSED : 0;
}

static void test_frames_end_when_told(void **state)
{
	struct record record;
	unsigned count = 0;

	(void)state;
	hand_fill(&drop, 1000, 20, 9);
	record = make_drop(1, false, true);
	assert_int_equal(write_frames(&record, stop_at_five, &count), DT_E_CLOSED);
	assert_int_equal(count, 5);
	record_free(&record);
}

static void test_damage(void **state)
{
	char message[READ_MESSAGE_MAX], *file = hand_file(".csv", "", 0), *bytes;
	struct record record;
	size_t size;

	(void)state;
	hand_fill(&drop, 1000, 20, 10);
	record = make_drop(1, true, true);
	assert_int_equal(write_record(&record, file, message), 0);
	bytes = hand_read(file, &size);
	hand_fuzz(bytes, size, NULL, 46, 200);
	hand_fuzz(good, sizeof(good) - 1, NULL, 47, 400);
	free(bytes);
	hand_unlink(file);
	record_free(&record);
}

/* ---- samples of a drop ---- */

/* The file with the first `from` behind `after` replaced; returns the line it stands in. */
static unsigned replace(const char *file, const char *after, const char *from, const char *to)
{
	size_t size;
	char *text = hand_read(file, &size), *end = malloc(size + 1), *place, *altered, *seal;
	unsigned line = 1;
	FILE *out;

	assert_non_null(end);
	memcpy(end, text, size);
	end[size] = '\0';
	place = strstr(strstr(end, after), from);
	assert_non_null(place);
	for (char *p = end; p < place; p++)
		line += *p == '\n';
	altered = malloc(size + strlen(to) + 1);
	assert_non_null(altered);
	sprintf(altered, "%.*s%s%s", (int)(place - end), end, to, place + strlen(from));
	seal = strstr(altered, SEAL_WORD);
	if (seal != NULL) { /* who altered it has sealed it again */
		memset(seal + strlen(SEAL_WORD), '0', 64);
		assert_int_equal(seal_fill(altered, strlen(altered)), 0);
	}
	out = fopen(file, "w");
	assert_non_null(out);
	fputs(altered, out);
	fclose(out);
	free(altered);
	free(text);
	free(end);
	return line;
}

/* The first row with 101 g: another cell in its place, and this in the column of marks. */
static unsigned put_marked(const char *file, const char *cell, const char *marks)
{
	size_t size;
	char *text = hand_read(file, &size), *place, *comma, from[256], to[512];
	unsigned line;

	place = memmem(text, size, ",101,", 5);
	assert_non_null(place);
	comma = memrchr(place, ',', (size_t)(strchr(place, '\n') - place));
	snprintf(from, sizeof(from), "%.*s", (int)(comma - place), place);
	snprintf(to, sizeof(to), "%s%s%s", cell, from + 5, marks);
	line = replace(file, "time_s,", from, to);
	free(text);
	return line;
}

static void expect_refused(char *file, unsigned line, const char *why)
{
	char message[READ_MESSAGE_MAX] = "", place[16] = "";
	struct record record;

	if (line > 0) /* it is told of one */
		snprintf(place, sizeof(place), ":%u: ", line);
	assert_int_equal(read_record(&record, file, NULL, message), DT_E_FORMAT);
	if (!strstr(message, place) || !strstr(message, why))
		fail_msg("\"%s\", expected %s%s", message, place, why);
	hand_unlink(file);
}

/* They are counts: a number between two is refused beside its line, in any of the formats. */
static void test_samples_are_counts(void **state)
{
	struct record record;

	(void)state;
	hand_fill(&drop, 1000, 30, 21);
	for (int i = 0; i < 7; i++)
		drop.sample[0][3][i] = (int16_t)(32 * i + 3200); /* 100, 101 .. g */
	record = make_drop(22, false, true);
	for (int i = 0; i < 3; i++) {
		static const char *const values[] = {"101.01", "1024", "-1024"};
		char *file = round_trip(&record, ".csv", "csv");
		char cell[32];
		unsigned line;

		snprintf(cell, sizeof(cell), ",%s,", values[i]);
		line = replace(file, "time_s,", ",101,", cell);
		expect_refused(file, line, "expected a whole count of 1/32 g");
	}
	for (int i = 0; i < 4; i++) { /* what is beyond the range is marked, and nothing else */
		static const char *const cells[] = {",101,", ",501,", ",-501,", ",,"};
		static const char *const marks[] = {"S1X clipped", "", "", "S1X lost clipped"};
		char *file = round_trip(&record, ".csv", "csv");
		unsigned line = put_marked(file, cells[i], marks[i]);

		expect_refused(file, line,
		               "for S1X, expected a mark as clipped for samples beyond 500 g and no other");
	}
	for (int i = 0; i < 2; i++) {
		char *file = round_trip(&record, i == 0 ? ".csv" : ".unv", i == 0 ? "csv" : "uff58");

		replace(file, i == 0 ? "channel" : "S1X", "range_g=500", "range_g=400");
		expect_refused(file, 0, "and a range of 500 g");
	}
	{
		char *file = round_trip(&record, ".unv", "uff58");
		unsigned line = replace(file, "S1X", "1.010000000000E+02", "5.010000000000E+02");

		expect_refused(file, line, "501 g for S1X has the mask 0, expected 4 beyond 500 g");
	}
	{
		char *file = round_trip(&record, ".unv", "uff58");
		unsigned line = replace(file, "S1X", "1.010000000000E+02", "1.010100000000E+02");

		expect_refused(file, line, "101.01 g for S1X, expected a whole count of 1/32 g");
	}
	{
		char *file = round_trip(&record, ".unv", "uff58");
		unsigned line = replace(file, "S1X", "1.010000000000E+02", "1.01000000O000E+02");

		expect_refused(file, line, "sample 23 of S1X is no number and its mask calls it good");
	}
	record_free(&record);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(test_samples_are_counts),
	        cmocka_unit_test(test_one_drop_in_every_format),
	        cmocka_unit_test(test_any_record_comes_back_exactly),
	        cmocka_unit_test(test_the_layout),
	        cmocka_unit_test(test_refusals),
	        cmocka_unit_test(test_refusals_of_tables),
	        cmocka_unit_test(test_line_ends_of_other_systems),
	        cmocka_unit_test(test_what_cannot_be_written),
	        cmocka_unit_test(test_a_full_disk),
	        cmocka_unit_test(test_frames_end_when_told),
	        cmocka_unit_test(test_damage),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
