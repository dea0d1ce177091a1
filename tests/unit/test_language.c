/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * A page in German: what is translated, what is not, and that the table has every text that a name, flag,
 * status, quantity or field of the laboratory can bring.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/base/text.h"
#include "host/model/model.h"
#include "host/report/facts.h"
#include "host/report/laboratory.h"
#include "host/report/language.h"
#include "host/result/decide.h"
#include "host/result/quantity.h"

/* Texts without an entry, one behind the other. */
static char untold[4096];

static void tell(void *context, const char *text)
{
	(void)context;
	strncat(untold, text, sizeof(untold) - strlen(untold) - 2);
	strcat(untold, "|");
}

static char *in(const char *code, const char *page)
{
	const struct translation translation = {language_find(code), tell, NULL};
	struct text out;

	untold[0] = '\0';
	assert_non_null(translation.language);
	assert_int_equal(text_open(&out), 0);
	assert_int_equal(text_close(&out, language_write(&translation, page, strlen(page), out.out)), 0);
	return out.bytes;
}

static void is(const char *english, const char *german)
{
	char *page = in("de", english);

	assert_string_equal(page, german);
	assert_string_equal(untold, "");
	free(page);
}

static void test_texts(void **state)
{
	(void)state;
	is("<td>conditional pass</td>", "<td>bedingt bestanden</td>");
	is("<p class=\"clipped\">Plate damping\n  ratio</p>",
	   "<p class=\"clipped\">Dämpfungsgrad der Platte</p>");
	is("<b>samples are beyond the sensor&#39;s range: the true peak may be higher</b>",
	   "<b>Abtastwerte liegen außerhalb des Messbereichs des Aufnehmers: der wahre Scheitelwert kann "
	   "höher "
	   "sein</b>");
	is("<b>, (clipped).</b>", "<b>, (übersteuert).</b>");
	is("<li>SHORT: 1 of 3 planned drops count; 2 rejected and in no mean</li>",
	   "<li>ZU WENIG: 1 von 3 geplanten Fällen gewertet; 2 verworfen und in keinem Mittel</li>");
}

static void test_numbers(void **state)
{
	(void)state;
	is("<td>&minus;0.50 &plusmn; 1.2e-05*</td>", "<td>−0,50 ± 1,2e-05*</td>");
	is("<td>-0.5</td><td>&minus;0.25.</td><td>7.8.2.1</td><td>2026-11-28 03:16</td><td>&ndash;</td>",
	   "<td>-0,5</td><td>−0,25.</td><td>7.8.2.1</td><td>2026-11-28 03:16</td><td>–</td>");
	is("<p>dropped from 0.894 m at 25&deg;.</p>", "<p>Fall aus 0,894 m unter 25°.</p>");
	is("<p>1.50 Hz</p><p>S1.peak.value_g</p><p>0a1B2c3D</p>",
	   "<p>1,50 Hz</p><p>S1.peak.value_g</p><p>0a1B2c3D</p>");
}

/* The user's words are kept, whatever they say; other texts in front of or behind them are not. */
static void test_own(void **state)
{
	char *page;

	(void)state;
	is("<td>\1clipped 0.5 &lt;b&gt;\2</td>", "<td>clipped 0.5 &lt;b&gt;</td>");
	is("<td>Note: \1rejected; pass\2</td>", "<td>Bemerkung: rejected; pass</td>");
	is("<li>\1acc: 1\2 peak of all drops</li>", "<li>Scheitelwert acc: 1 aller Fälle</li>");
	page = in("en", "<td>\1clipped &lt;\2 0.5</td>");
	assert_string_equal(page, "<td>clipped &lt; 0.5</td>");
	free(page);
}

static void test_where(void **state)
{
	(void)state;
	is("<html lang=\"en\"><svg aria-label=\"drop 2, S1 and S2 along X\" stroke-width=\"0.5\">",
	   "<html lang=\"de\"><svg aria-label=\"Fall 2, S1 und S2 entlang X\" stroke-width=\"0.5\">");
	is("<style>a{margin:0.5em;content:\"page \" counter(page) \" of \"}</style><p>drop</p>",
	   "<style>a{margin:0.5em;content:\"Seite \" counter(page) \" von "
	   "\"}th{white-space:normal;vertical-align:bottom}</style><p>Fall</p>");
	is("<!-- log drop 0.5\nchain -->", "<!-- log drop 0.5\nchain -->");
}

static void test_without_an_entry(void **state)
{
	char *page = in("de", "<p>Gone fishing: 0.5</p><p>&lt;b&gt; &amp; so</p>");

	(void)state;
	assert_string_equal(page, "<p>Gone fishing: 0.5</p><p>&lt;b&gt; &amp; so</p>");
	assert_string_equal(untold, "Gone fishing: 0.5|<b> & so|");
	free(page);
	assert_null(language_find("fr"));
}

/* A long text of many parts ends, known or not. */
static void test_many_parts(void **state)
{
	char text[4000] = "<p>";

	(void)state;
	for (int i = 0; i < 300; i++)
		strcat(text, i % 3 ? "drop, " : "nothing; ");
	strcat(text, "</p>");
	free(in("de", text));
	assert_string_not_equal(untold, "");
}

static void has(const char *text)
{
	char page[1000], *german;

	snprintf(page, sizeof(page), "<td>%s</td>", text);
	german = in("de", page);
	free(german);
	if (untold[0] != '\0')
		fail_msg("no German for '%s'", text);
}

static void test_names(void **state)
{
	(void)state;
	for (unsigned bit = 0; bit < 32; bit++) {
		has(record_flag_name(1u << bit));
		has(report_flag_words(1u << bit));
		has(estimate_flag_name(1u << bit));
		has(report_note_words(1u << bit));
	}
	for (int i = 0; i <= ESTIMATE_NOT_CONVERGED; i++)
		has(estimate_status_name((enum estimate_status)i));
	for (int i = DECIDE_NONE; i <= DECIDE_FAIL; i++)
		has(decide_name((enum decision)i));
	for (int i = MODEL_AUTO + 1; i <= MODEL_PLANAR; i++)
		has(model_fidelity_name((enum model_fidelity)i));
	for (size_t i = 0; i < LABORATORY_FIELDS; i++)
		has(laboratory_rows[i].label);
}

static void test_quantities(void **state)
{
	(void)state;
	for (int object = 0; object < QUANTITY_OBJECTS; object++)
		for (const struct quantity *q = NULL;
		     (q = quantity_next((enum quantity_object)object, q)) != NULL;) {
			has(q->label + (q->label[0] == '?'));
			has(q->label[0] ? q->shown : "");
		}
	for (size_t i = 0; i < QUANTITY_COLUMNS; i++) {
		has(quantity_columns[i].title);
		has(quantity_columns[i].shown);
	}
}

/* ---- the table itself ---- */

static void marks(const char *text, char of[64])
{
	size_t n = 0;

	for (; *text != '\0' && n < 60; text++)
		if (*text == '#' || strncmp(text, "{}", 2) == 0)
			of[n++] = *text;
	of[n] = '\0';
}

static void test_table(void **state)
{
	const struct language *l = language_find("de");

	(void)state;
	for (size_t i = 0; i < l->count; i++) {
		char english[64], german[64];

		marks(l->text[i].english, english);
		marks(l->text[i].other, german);
		if (strcmp(english, german) != 0)
			fail_msg("'%s' has %s, its German %s", l->text[i].english, english, german);
		for (size_t k = 0; k < i; k++)
			if (strcmp(l->text[k].english, l->text[i].english) == 0)
				fail_msg("'%s' stands twice", l->text[i].english);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(test_texts),
	        cmocka_unit_test(test_numbers),
	        cmocka_unit_test(test_own),
	        cmocka_unit_test(test_where),
	        cmocka_unit_test(test_without_an_entry),
	        cmocka_unit_test(test_many_parts),
	        cmocka_unit_test(test_names),
	        cmocka_unit_test(test_quantities),
	        cmocka_unit_test(test_table),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
