/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * A record and an analysis made by hand (report_by_hand.h), told as pictures and page. What is expected is
 * worked out here from the hand-made numbers, not taken from the report's own code.
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
#include <sys/stat.h>
#include <unistd.h>

#include "host/report/picture.h"
#include "host/report/traces.h"
#include "tests/unit/report_by_hand.h"
#include "tests/unit/scratch.h"

static char *channel_script(const struct report_hand *f, size_t channel)
{
	struct report_zero zero = report_zero(&f->report);
	char *text = NULL;
	size_t length;
	FILE *out = open_memstream(&text, &length);

	assert_non_null(out);
	assert_true(traces_channel(out, &f->report, &zero, channel));
	assert_int_equal(fclose(out), 0);
	return text;
}

/* The points of block $name that lie in [from, to), and the breaks between points. */
static size_t points_in(const char *script, const char *name, double from_ms, double to_ms, size_t *breaks)
{
	char head[32];
	const char *s;
	size_t points = 0;

	snprintf(head, sizeof(head), "$%s << EOD\n", name);
	s = strstr(script, head);
	assert_non_null(s);
	*breaks = 0;
	for (s = strchr(s, '\n') + 1; strncmp(s, "EOD", 3) != 0; s = strchr(s, '\n') + 1) {
		double t = strtod(s, NULL);

		*breaks += *s == '\n';
		points += *s != '\n' && t >= from_ms && t < to_ms;
	}
	return points;
}

static void test_traces_keep_gaps_open(void **state)
{
	struct report_hand *f = *state;
	size_t breaks;
	char *script = channel_script(f, 1);

	/* whole: 10 samples a millisecond, no break */
	assert_int_equal(points_in(script, "measured", 3.95, 5.95, &breaks), 20);
	assert_int_equal(breaks, 0);
	assert_null(strstr(script, "set object"));
	free(script);
	report_make_holes(f);
	script = channel_script(f, 1);
	assert_int_equal(points_in(script, "measured", 3.95, 5.95, &breaks), 0);
	assert_true(breaks >= 1);
	report_check_has(script, "set object rectangle from 3.900000, graph 0 to 6.000000");
	free(script);
	script = channel_script(f, 3);
	assert_int_equal(points_in(script, "clipped", -100, 100, &breaks), 1);
	free(script);
}

/* gnuplot runs commands a script asks for. */
static void test_no_foreign_text_in_scripts(void **state)
{
	struct report_hand *f = *state;
	char *script;

	snprintf(f->record.channels[0].name, sizeof(f->record.channels[0].name), "'; system('evil'); '");
	snprintf(f->scene.title, sizeof(f->scene.title), "evil");
	snprintf(f->record.file, sizeof(f->record.file), "evil");
	script = channel_script(f, 0);
	assert_null(strstr(script, "evil"));
	free(script);
}

static void test_picture(void **state)
{
	static const char good[] = "set terminal svg\n$d << EOD\n1 2\n2 3\nEOD\nplot $d with lines\n";
	static const char wrong[] = "set terminal svg\nplot $nothing with lines\n";
	char message[200] = "", *svg = NULL;

	(void)state;
	assert_int_equal(picture_draw(good, strlen(good), &svg, message, sizeof(message)), 0);
	report_check_has(svg, "<svg");
	report_check_has(svg, "</svg>");
	free(svg);
	svg = NULL;
	assert_int_equal(picture_draw(wrong, strlen(wrong), &svg, message, sizeof(message)), DT_E_SYSTEM);
	assert_null(svg);
	report_check_has(message, "gnuplot failed: ");
	report_check_has(message, "nothing");
}

static void make_folder(char path[SCRATCH_MAX])
{
	assert_non_null(mkdtemp(scratch_name(path, "report")));
}

static char *read_file(const char *path)
{
	FILE *in = fopen(path, "r");
	char *text = calloc(1, 1 << 22);

	assert_non_null(in);
	assert_non_null(text);
	assert_true(fread(text, 1, (1 << 22) - 1, in) > 1000);
	fclose(in);
	return text;
}

/* Makes the page in a folder of its own, which must hold nothing else afterwards. */
static char *make_page(const struct report *report)
{
	char folder[SCRATCH_MAX], path[SCRATCH_MAX + 32], message[200] = "";
	char *page;

	make_folder(folder);
	snprintf(path, sizeof(path), "%s/page.html", folder);
	if (report_html(report, path, message, sizeof(message)))
		fail_msg("%s", message);
	page = read_file(path);
	assert_int_equal(unlink(path), 0);
	assert_int_equal(rmdir(folder), 0);
	return page;
}

static void check_self_contained(const char *page)
{
	static const char xmlns[] = "xmlns=\"http://www.w3.org/2000/svg\"";
	static const char xlink[] = "xmlns:xlink=\"http://www.w3.org/1999/xlink\"";

	assert_int_equal(report_count_of(page, "http:"),
	                 report_count_of(page, xmlns) + report_count_of(page, xlink));
	assert_int_equal(report_count_of(page, "https:"), 0);
	assert_int_equal(report_count_of(page, "<script"), 0);
	assert_int_equal(report_count_of(page, "<link"), 0);
	assert_int_equal(report_count_of(page, "<img"), 0);
	assert_int_equal(report_count_of(page, "src="), 0);
	assert_int_equal(report_count_of(page, "@import"), 0);
	assert_int_equal(report_count_of(page, "nan"), 0);
	assert_int_equal(report_count_of(page, "<?xml"), 0);
	assert_int_equal(report_count_of(page, "<svg"), report_count_of(page, "</svg>"));
	assert_int_equal(report_count_of(page, "<figure"), report_count_of(page, "</figure>"));
	assert_int_equal(report_count_of(page, "<table"), report_count_of(page, "</table>"));
	assert_int_equal(report_count_of(page, "<div"), report_count_of(page, "</div>"));
	assert_int_equal(report_count_of(page, "<defs>"), 1); /* its names may stand only once */
	assert_int_equal(strcmp(page + strlen(page) - 8, "</html>\n"), 0);
}

static void test_html(void **state)
{
	struct report_hand *f = *state;
	char *page;

	f->report.options = (struct estimate_options){.cfc = 180, .iepe_time_constant_s = 0.3};
	page = make_page(&f->report);
	check_self_contained(page);
	assert_int_equal(report_count_of(page, "<svg"),
	                 6 + 1 + 2 + 1); /* traces, resultants, ring-down, whole */
	report_check_has(page, "<h1>Box &lt;b&gt;&amp; &quot;plate&quot;&lt;/b&gt;</h1>");
	assert_null(strstr(page, "<b>&"));
	report_check_has(page, "&lt;name&gt;.log");
	report_check_has(page, "test &lt;version&gt;");
	report_check_has(
	        page, "complete: every sample arrived, and the CRC-32 agrees</div>\n"
	              "<p class=\"soft\">Processing: filter CFC180; sensor high-pass of 0.3 s undone.</p>");
	report_check_has(page, "300.33 &plusmn; 0.34");
	report_check_has(page, "time 0 is in frame 441, S2 X peaks in 442. ");
	report_check_has(page, "+6.6 %");
	report_check_has(page, "129.37 &plusmn; 0.02 Hz");
	report_check_has(page, "because it is by hand");
	report_check_has(page, "Y peaks 0.400 ms before X");
	assert_null(strstr(page, "as the swing vanishes"));
	free(page);
}

static void test_html_of_holes(void **state)
{
	struct report_hand *f = *state;
	char *page;

	report_make_holes(f);
	f->analysis.plate.small_swing_hz = 139.7;
	f->analysis.resultants[1].axes_apart_s = (double)NAN;
	page = make_page(&f->report);
	check_self_contained(page);
	report_check_has(page, "INCOMPLETE: 54 samples lost");
	report_check_has(page, "<td>61338</td><td>61339</td><td>2</td>");
	report_check_has(page, "samples missing");
	report_check_has(page, "as the swing vanishes</td><td>139.70 Hz</td>");
	report_check_has(page, "one axis has no peak");
	assert_int_equal(report_count_of(page, "Y peaks "), 1);
	report_check_has(page, "beyond the sensor's range");
	free(page);
}

/* Channels of any name and number, no scene, one of them without a single sample. */
static void test_html_foreign(void **state)
{
	struct report_hand *f = *state;
	struct estimate_channel *many = calloc(15, sizeof(*many));
	char *page;

	assert_non_null(many);
	memcpy(many, f->estimates, sizeof(f->estimates));
	for (size_t i = HAND_CHANNELS; i < 15; i++) {
		assert_non_null(record_add_channel(&f->record, "<i>strange</i>", 1e6, i == 8 ? 0 : 50));
		many[i].peak = (struct estimate_peak){(double)NAN,
		                                      (double)NAN,
		                                      (double)NAN,
		                                      (double)NAN,
		                                      {.method = "sample", .status = ESTIMATE_SHORT}};
		many[i].pulse.status = ESTIMATE_SHORT;
	}
	for (size_t i = 0; i < HAND_CHANNELS; i++)
		f->record.channels[i].sensor = 0; /* whatever its name */
	f->analysis = (struct analysis){.channels = many, .channel_count = 15};
	f->record.is_drop = false;
	f->report.scene = NULL;
	f->report.prediction = NULL;
	f->report.version = NULL;
	page = make_page(&f->report);
	check_self_contained(page);
	assert_int_equal(report_count_of(page, "<svg"), 6 + 1); /* the other channels hold nothing */
	report_check_has(page, "&lt;i&gt;strange");
	assert_int_equal(report_count_of(page, "<i>strange"), 0);
	assert_null(strstr(page, "Processing"));
	report_check_has(page, "The first 12 of 15 channels");
	free(page);
	free(many);
}

static void test_html_unwritable(void **state)
{
	struct report_hand *f = *state;
	char message[200] = "", folder[SCRATCH_MAX], path[SCRATCH_MAX + 32];
	struct stat stat_before, stat_after;

	assert_int_equal(report_html(&f->report, "/nowhere/at/all/page.html", message, sizeof(message)),
	                 DT_E_SYSTEM);
	report_check_has(message, "/nowhere/at/all/page.html: ");
	make_folder(folder);
	snprintf(path, sizeof(path), "%s/sub", folder);
	assert_int_equal(mkdir(path, 0700), 0); /* a folder stands where the page should go */
	assert_int_equal(stat(folder, &stat_before), 0);
	assert_int_equal(report_html(&f->report, path, message, sizeof(message)), DT_E_SYSTEM);
	assert_int_equal(stat(folder, &stat_after), 0);
	assert_int_equal(rmdir(path), 0);
	assert_int_equal(rmdir(folder), 0); /* nothing was left behind */
}

static void test_html_without_gnuplot(void **state)
{
	struct report_hand *f = *state;
	char message[200] = "", folder[SCRATCH_MAX], path[SCRATCH_MAX + 32],
	     *old = strdup(getenv("PATH") ? getenv("PATH") : "");

	assert_non_null(old);
	make_folder(folder);
	snprintf(path, sizeof(path), "%s/page.html", folder);
	assert_int_equal(setenv("PATH", folder, 1), 0);
	assert_int_equal(report_html(&f->report, path, message, sizeof(message)), DT_E_SYSTEM);
	assert_int_equal(setenv("PATH", old, 1), 0);
	report_check_has(message, "gnuplot-nox");
	assert_int_equal(rmdir(folder), 0); /* no page, no part of one */
	free(old);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, report_set_up, report_tear_down)
	const struct CMUnitTest tests[] = {
	        TEST(test_traces_keep_gaps_open),
	        TEST(test_no_foreign_text_in_scripts),
	        TEST(test_picture),
	        TEST(test_html),
	        TEST(test_html_of_holes),
	        TEST(test_html_foreign),
	        TEST(test_html_unwritable),
	        TEST(test_html_without_gnuplot),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
