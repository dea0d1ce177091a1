/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The report of a series made by hand: results written here, logs as CSV. The page is read as text;
 * what its tables must say follows from the numbers below, or is asked of the archive.
 */
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

#include "common/base/text.h"
#include "host/archive/table.h"
#include "host/record/drop.h"
#include "host/record/write.h"
#include "host/report/report.h"
#include "host/report/series.h"
#include "tests/unit/scratch.h"

#define TITLE "Box <script>alert(1)</script> & \"plate\""

static char folder[64], message[ARCHIVE_MESSAGE_MAX];
static struct archive *archive;
static bool simulated; /* the drops that are added */

/* ---- an archive by hand ---- */

static void write_scene(const char *file)
{
	FILE *in = fopen("common/scenes/geometry-2A.ini", "r"), *out = fopen(file, "w");
	char line[256];

	assert_non_null(in);
	assert_non_null(out);
	while (fgets(line, sizeof(line), in))
		fputs(strncmp(line, "title", 5) ? line : "title = " TITLE "\n", out);
	fclose(in);
	assert_int_equal(fclose(out), 0);
}

static int set_up(void **state)
{
	char scene[96];

	(void)state;
	simulated = false;
	if (!mkdtemp(scratch_name(folder, "series")))
		return 1;
	snprintf(scene, sizeof(scene), "%s/scene.ini", folder);
	write_scene(scene);
	archive = archive_open(folder, ARCHIVE_CREATE, message);
	return !archive || archive_new_series(archive, "by-hand", "trial", scene, 25, NAN, NULL, 3);
}

static int tear_down(void **state)
{
	char command[96];

	(void)state;
	archive_close(archive);
	snprintf(command, sizeof(command), "rm -rf '%s'", folder);
	return system(command);
}

/* A half-sine of 3 ms in each of six channels, at 100 ms. */
static void write_log(const char *file, double peak_g)
{
	struct record record;
	FILE *out = fopen(file, "w");

	assert_non_null(out);
	assert_int_equal(drop_open(&record, 1000, 1249), 0);
	for (size_t i = 0; i < 6; i++) {
		struct channel *c = &record.channels[i];
		double rate_hz = c->rate_hz;

		for (size_t k = 0; k < c->count; k++) {
			double t = ((double)k / rate_hz - 0.1) / 0.003;

			c->value_g[k] = t > 0.0 && t < 1.0
			                        ? round(32 * peak_g * sin(3.14159265358979 * t)) / 32
			                        : 0.0;
			c->sample[k] = fabs(c->value_g[k]) > 500 ? SAMPLE_CLIPPED : 0;
		}
	}
	record_finish(&record);
	assert_int_equal(write_csv(&record, out), 0);
	assert_int_equal(fclose(out), 0);
	record_free(&record);
}

static int64_t made_s = 1000000000; /* when they are */

static unsigned add_to(const char *series, double peak_g)
{
	struct archive_recording r;

	assert_int_equal(archive_begin(archive, series, "<i>Ann</i>", ".csv", simulated, &r), 0);
	write_log(r.log, peak_g);
	assert_int_equal(archive_finish(archive, &r, made_s, "note & <u>more</u>"), 0);
	return r.number;
}

static unsigned add_drop(double peak_g)
{
	return add_to("by-hand", peak_g);
}

static struct estimate_channel channel_of(double value)
{
	return (struct estimate_channel){
	        .baseline = {.noise_g = 1},
	        .peak = {.value_g = value,
	                 .sigma_g = 0.5,
	                 .time_s = 0.1015,
	                 .sigma_time_s = 1e-6,
	                 .how = {.flags = ESTIMATE_FLAG_GAPS}},
	        .pulse = {.duration_s = 0.0028, .start_s = 0.1001, .contact_time_s = NAN},
	};
}

static void put_result(const char *drop, struct result *said)
{
	struct report report = {.record = said->record,
	                        .analysis = said->analysis,
	                        .options = *said->options,
	                        .sensors = said->sensors};
	struct text json;

	assert_int_equal(text_open(&json), 0);
	assert_int_equal(text_close(&json, report_json(&report, json.out)), 0);
	assert_int_equal(archive_result(archive, drop, "1.0-test", said, json.bytes), 0);
	free(json.bytes);
}

static struct sensors *chain; /* of the results to come */

/* Every value of it another number. S2 X is as asked. */
static void give_result(const char *drop, double v, enum estimate_status status, unsigned flags)
{
	static const char *const names[] = {"S1X", "S1Y", "S1Z", "S2X", "S2Y", "S2Z"};
	struct channel channels[6] = {{.count = 0}};
	struct estimate_channel estimates[] = {channel_of(v),        channel_of(0.5 * v + 0.3),
	                                       channel_of(-0.1 * v), channel_of(2 * v),
	                                       channel_of(0.7 * v),  channel_of(-0.03 * v)};
	struct record record = {.channels = channels, .channel_count = 6, .flags = flags};
	struct analysis analysis = {
	        .channels = estimates,
	        .channel_count = 6,
	        .resultants = {{.sensor = "S1", .peak_g = 1.2 * v, .sigma_g = 0.4, .time_s = 0.1015},
	                       {.sensor = "S2", .peak_g = 2.2 * v, .sigma_g = 0.6, .time_s = 0.1015}},
	        .resultant_count = 2,
	        .has_lag = true,
	        .lag = {.first_peak_s = v * 5e-6,
	                .largest_peak_s = v * 6e-6,
	                .sigma_s = 5e-6,
	                .driven_s = v * 5.5e-6,
	                .sigma_driven_s = 1e-5,
	                .driven = {.flags = ESTIMATE_FLAG_MODEL}},
	        .has_plate = true,
	        .plate = {.frequency_hz = 0.4 * v,
	                  .sigma_hz = 0.05,
	                  .three_cycle_frequency_hz = 0.41 * v,
	                  .damping_ratio = 3e-4 * v,
	                  .sigma_damping = 3e-4,
	                  .how = {.flags = ESTIMATE_FLAG_AMPLITUDE}},
	};
	struct estimate_options options = {.iepe_time_constant_s = 0.25};
	struct result said = result_of(&record, &analysis, &options);

	said.sensors = chain;
	for (size_t i = 0; i < 6; i++) {
		snprintf(channels[i].name, sizeof(channels[i].name), "%s", names[i]);
		channels[i].rate_hz = names[i][2] == 'X' ? 7000 : 10000;
	}
	estimates[3].peak.how.status = status;
	estimates[3].flags = flags;
	put_result(drop, &said);
}

static void decide(const char *drop, enum archive_decision decision, const char *reason)
{
	assert_int_equal(archive_decide(archive, drop, decision, "Bob \"the\" <b>", reason), 0);
}

/* Drops 1, 2 and 4 count, 3 is rejected. */
static void make_series(void)
{
	static const double peak_g[] = {310.4, 320.6, 999.5, 330.2};

	for (unsigned i = 0; i < 4; i++) {
		char drop[32];

		assert_int_equal(add_drop(peak_g[i]), i + 1);
		snprintf(drop, sizeof(drop), "by-hand/%u", i + 1);
		give_result(drop, peak_g[i], ESTIMATE_OK, 0);
		decide(drop, i == 2 ? ARCHIVE_REJECTED : ARCHIVE_ACCEPTED,
		       i == 2 ? "<img src=x onerror=alert(1)> 'tape'" : "");
	}
}

static int report_to(char **page, bool undecided)
{
	struct series_report request = {.archive = archive,
	                                .series = "by-hand",
	                                .data = "",
	                                .undecided = undecided,
	                                .version = "1.0-test",
	                                .partial = true};
	size_t length = 0;
	FILE *out = open_memstream(page, &length);
	int result;

	assert_non_null(out);
	message[0] = '\0';
	result = series_report_html(&request, out, message, sizeof(message));
	assert_int_equal(fclose(out), 0);
	return result;
}

static char *report(void)
{
	char *page = NULL;

	if (report_to(&page, false) != 0)
		fail_msg("%s", message);
	assert_non_null(strstr(page, "</html>"));
	return page;
}

/* ---- reading the page ---- */

static void assert_has(const char *page, const char *text)
{
	if (!strstr(page, text))
		fail_msg("'%s' is not in the page", text);
}

static void assert_has_not(const char *page, const char *text)
{
	const char *found = strstr(page, text);

	if (found)
		fail_msg("'%s' is in the page: %.80s", text, found);
}

/* The text of a row's n-th cell in the table below heading; entities as ASCII. */
static void cell_of(const char *page, const char *heading, const char *row, int n, char text[64])
{
	const char *at = strstr(page, heading);
	char begin[40];
	size_t length = 0;

	assert_non_null(at);
	snprintf(begin, sizeof(begin), "<td>%s</td>", row);
	at = strstr(at, begin);
	if (!at)
		fail_msg("no row '%s' below %s", row, heading);
	for (int i = 0; i < n; i++) {
		at = strstr(at + 3, "<td");
		assert_non_null(at);
	}
	at = strchr(at, '>') + 1;
	while (*at != '<' && length < 60) {
		const char *entity = *at == '&' ? strchr(at, ';') : NULL;

		text[length++] = !entity                       ? *at
		                 : !strncmp(at, "&minus;", 7)  ? '-'
		                 : !strncmp(at, "&plusmn;", 8) ? 'p'
		                                               : '?';
		at = entity ? entity + 1 : at + 1;
	}
	text[length] = '\0';
}

static void assert_cell(const char *page, const char *heading, const char *row, int n, const char *expected)
{
	char text[64];

	cell_of(page, heading, row, n, text);
	assert_string_equal(text, expected);
}

/* ---- the columns, as the archive names them ---- */

static const struct {
	const char *heading;
	int cell;
	enum archive_value value;
	double scale, step; /* of the last digit */
} columns[] = {
        {"<h2>Peaks", 2, ARCHIVE_S1_X, 1, 0.1},         {"<h2>Peaks", 3, ARCHIVE_S1_Y, 1, 0.1},
        {"<h2>Peaks", 4, ARCHIVE_S1_R, 1, 0.1},         {"<h2>Peaks", 5, ARCHIVE_S1_Z, 1, 0.1},
        {"<h2>Peaks", 6, ARCHIVE_S2_X, 1, 0.1},         {"<h2>Peaks", 7, ARCHIVE_S2_Y, 1, 0.1},
        {"<h2>Peaks", 8, ARCHIVE_S2_R, 1, 0.1},         {"<h2>Peaks", 9, ARCHIVE_S2_Z, 1, 0.1},
        {"<h2>Lag", 2, ARCHIVE_LAG, 1e3, 0.001},        {"<h2>Lag", 3, ARCHIVE_LAG_FIRST, 1e3, 0.001},
        {"<h2>Lag", 4, ARCHIVE_LAG_DRIVEN, 1e3, 0.001}, {"<h2>Lag", 5, ARCHIVE_FREQUENCY, 1, 0.01},
        {"<h2>Lag", 6, ARCHIVE_THREE_CYCLE, 1, 0.01},   {"<h2>Lag", 7, ARCHIVE_DAMPING, 1, 0.0001},
};
enum { COLUMNS = sizeof(columns) / sizeof(columns[0]) };

static const char *page_seen;

static int check_drop(void *context, const struct archive_drop *drop)
{
	unsigned *count = context;
	char row[16], text[64], *rest;

	snprintf(row, sizeof(row), "%u", drop->number);
	for (int i = 0; i < COLUMNS; i++) {
		double value, sigma;

		cell_of(page_seen, columns[i].heading, row, columns[i].cell, text);
		value = strtod(text, &rest);
		assert_string_not_equal(rest, text);
		assert_int_equal(rest[1], 'p');
		sigma = strtod(rest + 2, NULL);
		if (fabs(value - drop->value[columns[i].value] * columns[i].scale) > 0.51 * columns[i].step ||
		    fabs(sigma - drop->sigma[columns[i].value] * columns[i].scale) > 0.51 * columns[i].step)
			fail_msg("drop %u, %s: '%s'", drop->number, archive_value_name(columns[i].value),
			         text);
	}
	(*count)++;
	return 0;
}

/* ---- tests ---- */

static void test_every_number_is_the_archives(void **state)
{
	struct archive_filter filter = archive_filter_none();
	struct archive_table table;
	unsigned count = 0;
	char text[64], *page;

	(void)state;
	make_series();
	page_seen = page = report();
	assert_int_equal(archive_each_drop(archive, &filter, check_drop, &count), 0);
	assert_int_equal(count, 4);
	assert_int_equal(archive_table(archive, &filter, false, &table), 0);
	assert_int_equal(table.count, 1);
	for (int i = 0; i < COLUMNS; i++) {
		const struct archive_mean *m = &table.cell[0].value[columns[i].value];

		cell_of(page, columns[i].heading, "mean", columns[i].cell, text);
		assert_true(fabs(strtod(text, NULL) - m->mean * columns[i].scale) < 0.51 * columns[i].step);
		cell_of(page, columns[i].heading, "SD", columns[i].cell, text);
		assert_true(fabs(strtod(text, NULL) - m->sd * columns[i].scale) < 0.051 * columns[i].step);
		cell_of(page, columns[i].heading, "n", columns[i].cell, text);
		assert_string_equal(text, "3");
	}
	archive_table_free(&table);
	free(page);
}

/* 310.4, 320.6 and 330.2: their mean is 320.4, their squared deviations 100, 0.04 and 96.04. */
static void test_rejected_is_in_no_mean(void **state)
{
	char *page;

	(void)state;
	make_series();
	page = report();
	assert_cell(page, "<h2>Peaks", "1", 2, "310.4 p 0.5");
	assert_cell(page, "<h2>Peaks", "3", 1, "rejected");
	assert_cell(page, "<h2>Peaks", "3", 2, "999.5 p 0.5");
	assert_cell(page, "<h2>Peaks", "mean", 2, "320.4");
	assert_cell(page, "<h2>Peaks", "SD", 2, "9.90");
	assert_cell(page, "<h2>Peaks", "n", 2, "3");
	assert_has(page, "<tr class=\"out\"><td>3</td>");
	assert_has_not(page, "<tr class=\"out\"><td>4</td>");
	assert_has(page, "complete: 3 drops count, 3 were planned; 1 rejected");
	assert_has(page, "Rejected</b>: &lt;img src=x onerror=alert(1)&gt; &#39;tape&#39;");
	free(page);
}

/* Curves in the colour of S1 in the picture of its X: one for each drop that counts. */
/* Curves in S1's colour of the picture with that label. */
static size_t curves_of(const char *page, const char *label)
{
	static const char colour[] = "rgb(  0, 114, 178)";
	const char *at = strstr(page, label), *end;
	size_t curves = 0;

	assert_non_null(at);
	end = strstr(at, "</svg>");
	for (at = strstr(at, "<path stroke="); at && at < end; at = strstr(at + 1, "<path stroke="))
		curves += !strncmp(at + strlen("<path stroke='"), colour, strlen(colour));
	return curves;
}

static void test_overlay_has_what_counts(void **state)
{
	char *page;

	(void)state;
	make_series();
	page = report();
	assert_int_equal(curves_of(page, "aria-label=\"S1 X of all drops that count\""), 3);
	assert_int_equal(curves_of(page, "aria-label=\"shock response spectra of S1 X\""), 3);
	assert_has(page, "aria-label=\"drop 3, S1 and S2 along X\""); /* drawn, on its own */
	free(page);
}

static void test_hostile_texts_are_escaped(void **state)
{
	char *page;

	(void)state;
	make_series();
	page = report();
	assert_has(page, "<h1>Box &lt;script&gt;alert(1)&lt;/script&gt; &amp; &quot;plate&quot;</h1>");
	assert_has(page, "&lt;i&gt;Ann&lt;/i&gt;");
	assert_has(page, "Bob &quot;the&quot; &lt;b&gt;");
	assert_has(page, "note &amp; &lt;u&gt;more&lt;/u&gt;");
	assert_has_not(page, "<script");
	assert_has_not(page, "<img");
	assert_has_not(page, "<i>Ann");
	assert_has_not(page, "<u>");
	free(page);
}

/* A reference leads within the page or carries its data itself; "http" stands only where SVG names itself. */
static void test_nothing_outside_is_referred_to(void **state)
{
	char *page;

	(void)state;
	make_series();
	page = report();
	for (const char *at = strstr(page, "href="); at; at = strstr(at + 1, "href="))
		assert_true(at[6] == '#' || !strncmp(at + 6, "data:text/csv;base64,", 21));
	for (const char *at = strstr(page, "http"); at; at = strstr(at + 1, "http")) {
		if (!strncmp(at, "http-equiv", 10))
			continue;
		assert_memory_equal(at, "http://www.w3.org/", 18);
		assert_true(!strncmp(at - 7, "xmlns=", 6) || !strncmp(at - 7, "xlink=", 6));
	}
	assert_has_not(page, " src=\"");
	assert_has_not(page, "url(");
	assert_has_not(page, "@import");
	assert_has_not(page, "<link");
	assert_has(page, "default-src 'none'");
	free(page);
}

static void test_proof_of_the_logs(void **state)
{
	char *page;

	(void)state;
	make_series();
	page = report();
	assert_has(page, "raw/");
	assert_has(page, "0001.csv<br>");
	assert_has(page, "<td class=\"text\">1.0-test</td>");
	assert_has(page, "2001-09-09 01:46"); /* second 1 000 000 000 */
	assert_has(page,
	           "Sensors and their certificates</h2>\n<p class=\"soft\">No sensor's file was applied");
	assert_has(page, "<th>processing</th><td>sensor high-pass of 0.25 s undone</td>");
	assert_has(page, "Taken: <b>planar</b>");
	free(page);
}

static void test_remarks_in_words(void **state)
{
	char *page;

	(void)state;
	make_series();
	give_result("by-hand/2", 320.6, ESTIMATE_CLIPPED, RECORD_FLAG_CLIPPED);
	page = report();
	assert_has(page, "COMPLETE, WITH REMARKS: 3 drops count");
	assert_cell(page, "<h2>Peaks", "2", 6, "641.2 p 0.5*");
	assert_cell(page, "<h2>Peaks", "mean", 6, "640.8*");
	assert_has(page, "the true value lies beyond what the sensor shows: <b>S2 X of drop 2</b>");
	assert_has(page, "the true peak may be higher: <b>S2X of drop 2</b>");
	assert_has(
	        page,
	        "the frequency follows the swing; the value is fitted, the mean of the first three cycles: "
	        "<b>plate frequency of all drops</b>");
	free(page);
}

static void test_empty_series(void **state)
{
	char *page;

	(void)state;
	page = report();
	assert_has(page, "EMPTY: no drop yet of 3 planned");
	assert_has_not(page, "<td>mean</td>");
	assert_has_not(page, "<svg");
	free(page);
}

static void test_all_rejected(void **state)
{
	char *page;

	(void)state;
	assert_int_equal(add_drop(300), 1);
	give_result("by-hand/1", 300, ESTIMATE_OK, 0);
	decide("by-hand/1", ARCHIVE_REJECTED, "slid");
	page = report();
	assert_has(page, "NO RESULT: none of 1 drops is accepted");
	assert_has_not(page, "<td>mean</td>");
	assert_has_not(page, "of all drops that count");
	assert_has_not(page, "<div class=\"card\">");
	assert_has(page, "nothing to compare with");
	free(page);
}

static void test_undecided_counts_when_asked(void **state)
{
	char *page = NULL;

	(void)state;
	assert_int_equal(add_drop(300), 1);
	give_result("by-hand/1", 300, ESTIMATE_OK, 0);
	page = report();
	assert_has(page, "nobody has accepted or rejected it yet");
	free(page);
	assert_int_equal(report_to(&page, true), 0);
	assert_has(page, "SHORT: 1 of 3 planned drops count");
	assert_cell(page, "<h2>Peaks", "mean", 2, "300.0");
	assert_cell(page, "<h2>Peaks", "SD", 2, "?"); /* a dash */
	free(page);
}

/* A far one is found beside a series of two, too, whose scatter adds one degree of freedom to its own. */
static void test_one_that_stands_out_is_marked(void **state)
{
	static const double peak_g[] = {300, 300.5, 301, 300.2, 330}, other_g[] = {300, 300.1};
	char scene[96], drop[32], *page;

	(void)state;
	snprintf(scene, sizeof(scene), "%s/scene.ini", folder);
	assert_int_equal(archive_new_series(archive, "other", "another", scene, 25, NAN, NULL, 2), 0);
	for (unsigned i = 0; i < 5; i++) {
		snprintf(drop, sizeof(drop), "by-hand/%u", add_drop(peak_g[i]));
		give_result(drop, peak_g[i], ESTIMATE_OK, 0);
		decide(drop, ARCHIVE_ACCEPTED, "");
	}
	page = report();
	assert_has(page, "drop 5 stands out");
	free(page);
	for (unsigned i = 0; i < 2; i++) {
		snprintf(drop, sizeof(drop), "other/%u", add_to("other", other_g[i]));
		give_result(drop, other_g[i], ESTIMATE_OK, 0);
		decide(drop, ARCHIVE_ACCEPTED, "");
	}
	page = report();
	assert_has(page, "drop 5 stands out");
	free(page);
}

/* A drop of the series check at that time; e_n NAN: without a check. */
static void check_at(int64_t time_s, double e_n, const char *serial)
{
	char drop[32];

	made_s = time_s;
	chain->used[0].e_n = e_n;
	chain->used[0].serial = serial;
	snprintf(drop, sizeof(drop), "check/%u", add_to("check", 100 + (double)(time_s % 1000)));
	give_result(drop, 100, ESTIMATE_OK, 0);
}

/* The last check before and the first one after, of this sensor, not rejected; a failed one is told. */
static void test_checks_of_a_sensor(void **state)
{
	static struct sensors sensors = {.count = 1};
	struct sensor_used *used = &sensors.used[0];
	char scene[96], *page;

	(void)state;
	used->serial = used->model = used->certificate = used->laboratory = used->date = used->due =
	        used->file_sha256 = "4711";
	snprintf(used->name, sizeof(used->name), "S1");
	used->e_n = (double)NAN;
	chain = &sensors;
	snprintf(scene, sizeof(scene), "%s/scene.ini", folder);
	assert_int_equal(archive_new_series(archive, "check", "checks", scene, 25, NAN, NULL, 2), 0);
	for (made_s = 1000000000; made_s < 1000000200; made_s += 100) {
		char drop[32];

		snprintf(drop, sizeof(drop), "by-hand/%u", add_drop((double)(made_s % 1000) + 300));
		give_result(drop, 300, ESTIMATE_OK, 0);
		decide(drop, ARCHIVE_ACCEPTED, "");
	}
	check_at(999999000, 2.5, "4711");
	check_at(999999100, -0.25, "4711");
	check_at(999999200, 3, "4712");
	check_at(999999300, NAN, "4711");
	check_at(1000000300, -7, "4711");
	decide("check/5", ARCHIVE_REJECTED, "not screwed on");
	page = report();
	assert_has(page, "check/2: E_n -0.25");
	assert_has_not(page, "check/5");
	assert_has_not(page, "are suspect");
	free(page);
	check_at(1000000500, 0.5, "4711");
	check_at(1000000400, 1.25, "4711");
	page = report();
	assert_has(page, "check/2: E_n -0.25");
	assert_has(page, "check/7: E_n 1.25");
	assert_has(page, "are suspect");
	free(page);
	chain = NULL;
	made_s = 1000000000;
}

static int find_raw(void *context, const struct archive_drop *drop)
{
	snprintf(context, 200, "%s/%s", folder, drop->raw);
	return 0;
}

static void raw_of(unsigned number, char path[200])
{
	struct archive_filter filter = archive_filter_none();

	filter.number = number;
	assert_int_equal(archive_each_drop(archive, &filter, find_raw, path), 0);
}

static void test_log_missing_or_changed(void **state)
{
	char path[200], *page;
	FILE *out;

	(void)state;
	make_series();
	raw_of(1, path);
	assert_int_equal(unlink(path), 0);
	raw_of(2, path);
	out = fopen(path, "a");
	assert_non_null(out);
	fputc('\n', out);
	assert_int_equal(fclose(out), 0);
	page = report();
	assert_has(
	        page,
	        "SHORT: 1 of 3 planned drops count; 1 rejected and in no mean; 2 altered or missing and in "
	        "no mean");
	assert_has(page, "/0001.csv: missing");
	assert_has(page, "/0002.csv: altered: its SHA-256 is ");
	assert_cell(page, "<h2>Peaks", "1", 1, "altered");
	assert_cell(page, "<h2>Peaks", "n", 2, "1"); /* drop 4 alone */
	assert_has_not(page, "aria-label=\"drop 1, S1 and S2 along X\"");
	assert_has(page, "aria-label=\"drop 4, S1 and S2 along X\"");
	assert_int_equal(curves_of(page, "aria-label=\"shock response spectra of S1 X\""), 1); /* drop 4's */
	free(page);
}

static void test_without_result_and_interrupted(void **state)
{
	struct archive_recording r;
	char *page;

	(void)state;
	make_series();
	assert_int_equal(add_drop(300), 5);
	decide("by-hand/5", ARCHIVE_ACCEPTED, "");
	assert_int_equal(archive_begin(archive, "by-hand", "Ann", ".csv", false, &r), 0);
	archive_abandon(&r);
	page = report();
	assert_has(page,
	           "UNPROVEN: 4 drops count, but not every one has its log and result; 1 rejected and in no "
	           "mean; 1 never finished");
	assert_cell(page, "<h2>Peaks", "5", 2, "?");
	assert_cell(page, "<h2>Peaks", "6", 1, "interrupted");
	assert_cell(page, "<h2>Peaks", "mean", 2, "320.4");
	assert_has(page, "its recording was never finished");
	assert_has(page, "it has no result to lay its time by");
	free(page);
}

static void test_a_simulated_tower_is_named(void **state)
{
	char *page;

	(void)state;
	add_drop(300);
	page = report();
	assert_has_not(page, "imulated");
	free(page);
	simulated = true;
	add_drop(310);
	add_drop(320);
	page = report();
	assert_has(page, "<p><b>Simulated tower: no product fell in drops 2, 3.</b></p>");
	free(page);
}

static void test_all_on_a_simulated_tower(void **state)
{
	char *page;

	(void)state;
	simulated = true;
	make_series();
	page = report();
	assert_has(page, "<p><b>Simulated tower: no product fell.</b></p>");
	free(page);
}

static void test_unknown_series(void **state)
{
	struct series_report request = {.archive = archive, .series = "nobody", .data = "", .partial = true};
	FILE *out = fopen("/dev/null", "w");

	(void)state;
	assert_non_null(out);
	assert_int_equal(series_report_html(&request, out, message, sizeof(message)), DT_E_UNKNOWN);
	assert_non_null(strstr(message, "nobody"));
	fclose(out);
}

static void test_no_gnuplot(void **state)
{
	char *page = NULL, *path = strdup(getenv("PATH"));
	int result;

	(void)state;
	assert_non_null(path);
	make_series();
	assert_int_equal(setenv("PATH", folder, 1), 0);
	result = report_to(&page, false);
	assert_int_equal(setenv("PATH", path, 1), 0);
	assert_int_equal(result, DT_E_SYSTEM);
	assert_non_null(strstr(message, "gnuplot"));
	free(path);
	free(page);
}

static void test_full_disk(void **state)
{
	struct series_report request = {.archive = archive, .series = "by-hand", .data = "", .partial = true};
	FILE *out = fopen("/dev/full", "w");

	(void)state;
	assert_non_null(out);
	assert_int_equal(series_report_html(&request, out, message, sizeof(message)), DT_E_SYSTEM);
	assert_non_null(strstr(message, "written"));
	fclose(out);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test_setup_teardown(test_every_number_is_the_archives, set_up, tear_down),
	        cmocka_unit_test_setup_teardown(test_rejected_is_in_no_mean, set_up, tear_down),
	        cmocka_unit_test_setup_teardown(test_overlay_has_what_counts, set_up, tear_down),
	        cmocka_unit_test_setup_teardown(test_hostile_texts_are_escaped, set_up, tear_down),
	        cmocka_unit_test_setup_teardown(test_nothing_outside_is_referred_to, set_up, tear_down),
	        cmocka_unit_test_setup_teardown(test_proof_of_the_logs, set_up, tear_down),
	        cmocka_unit_test_setup_teardown(test_remarks_in_words, set_up, tear_down),
	        cmocka_unit_test_setup_teardown(test_empty_series, set_up, tear_down),
	        cmocka_unit_test_setup_teardown(test_all_rejected, set_up, tear_down),
	        cmocka_unit_test_setup_teardown(test_undecided_counts_when_asked, set_up, tear_down),
	        cmocka_unit_test_setup_teardown(test_one_that_stands_out_is_marked, set_up, tear_down),
	        cmocka_unit_test_setup_teardown(test_checks_of_a_sensor, set_up, tear_down),
	        cmocka_unit_test_setup_teardown(test_log_missing_or_changed, set_up, tear_down),
	        cmocka_unit_test_setup_teardown(test_without_result_and_interrupted, set_up, tear_down),
	        cmocka_unit_test_setup_teardown(test_a_simulated_tower_is_named, set_up, tear_down),
	        cmocka_unit_test_setup_teardown(test_all_on_a_simulated_tower, set_up, tear_down),
	        cmocka_unit_test_setup_teardown(test_unknown_series, set_up, tear_down),
	        cmocka_unit_test_setup_teardown(test_no_gnuplot, set_up, tear_down),
	        cmocka_unit_test_setup_teardown(test_full_disk, set_up, tear_down),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
