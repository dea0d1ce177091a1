/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The table of drops that a report carries along: put into a PDF that was written by hand, whose places are
 * then looked up as a reader does; and held against the archive's, cell by cell.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/command/verify_data.h"
#include "host/report/pdf_attach.h"

/* Two objects; the table's entries have 20 bytes each, and it begins at byte 99. */
#define CATALOGUE "2 0 obj\n<</Type /Catalog\n/Pages 1 0 R\n/View <</A 1>>>>\nendobj\n"
static const char small_pdf[] = "%PDF-1.4\n"
                                "1 0 obj\n<</Kids []>>\nendobj\n" /* from 9 on */
        CATALOGUE                                                 /* from 37 on */
                                "xref\n0 3\n0000000000 65535 f \n0000000009 00000 n \n0000000037 00000 n \n"
                                "trailer\n<</Size 3\n/Root 2 0 R\n/Info 1 0 R>>\nstartxref\n99\n%%EOF\n";
static const char table[] = "a,b\n1,\"x (y)\"\n";
static const struct pdf_file file = {.name = "s.csv", .bytes = table, .size = sizeof(table) - 1};

/* As a whole PDF, with a comment where the report puts its own; NULL when it was refused. */
static char *attached(const char *pdf, size_t length)
{
	char *bytes = NULL;
	size_t size, start;
	FILE *out = open_memstream(&bytes, &size);
	int result;

	assert_non_null(out);
	result = pdf_attach(pdf, length, &file, out, &start);
	if (result == 0) {
		fputs("%a comment\n", out);
		pdf_attach_end(out, start);
	}
	assert_int_equal(fclose(out), 0);
	if (result == 0)
		return bytes;
	assert_int_equal(result, DT_E_FORMAT);
	assert_int_equal(size, 0);
	free(bytes);
	return NULL;
}

/* An object by the newest table that has it, as ISO 32000-1, 7.5.8.2 wants it to be looked for. */
static const char *object(const char *pdf, unsigned number)
{
	const char *last = pdf, *next, *at, *row;
	unsigned from, count, used;

	while ((next = strstr(last + 1, "startxref")) != NULL)
		last = next;
	for (long table_at = atol(last + 9);; table_at = atol(strstr(at, "/Prev") + 5)) {
		at = pdf + table_at;
		assert_memory_equal(at, "xref\n", 5);
		for (row = at + 5; sscanf(row, "%u %u\n%n", &from, &count, (int *)&used) == 2;
		     row += used + 20 * count)
			if (number >= from && number < from + count)
				return pdf + atol(row + used + 20 * (number - from));
	}
}

static void attachment(void **state)
{
	char *pdf = attached(small_pdf, sizeof(small_pdf) - 1), text[64];
	const char *at;

	(void)state;
	assert_non_null(pdf);
	assert_memory_equal(pdf, small_pdf, sizeof(small_pdf) - 1);
	at = object(pdf, 2);
	assert_memory_equal(at, CATALOGUE, strlen("2 0 obj\n<</Type /Catalog\n/Pages 1 0 R\n/View <</A 1>>"));
	assert_non_null(strstr(at, "/EmbeddedFiles <</Names [(s.csv) 4 0 R]>>"));
	assert_non_null(strstr(at, "/AF [4 0 R]"));
	assert_memory_equal(object(pdf, 1), "1 0 obj\n", 8);
	assert_memory_equal(object(pdf, 4), "4 0 obj\n<</Type /Filespec", 24);
	at = object(pdf, 3);
	assert_memory_equal(at, "3 0 obj\n<</Type /EmbeddedFile", 28);
	snprintf(text, sizeof(text), "/Length %zu>>\nstream\n%s\nendstream", file.size, table);
	assert_non_null(strstr(at, text));
	assert_non_null(strstr(
	        at, "trailer\n<</Size 5\n/Root 2 0 R\n/Info 1 0 R\n/Prev 99>>\n%a comment\nstartxref\n"));
	free(pdf);
}

/* Cut anywhere, or with a part of it named otherwise: refused, or taken, and nothing worse. */
static void other_pdfs(void **state)
{
	static const char *const parts[] = {"startxref", "xref\n0",      "trailer", "/Size",
	                                    "/Root",     "endobj\nxref", "/Root 2", "/View"};
	static const char *const others[] = {"startxxxx", "xxxx\n0",      "trxxxxx", "/Sixx",
	                                     "/Roxx",     "endxxx\nxref", "/Root 9", "/Names"};
	char pdf[sizeof(small_pdf) + 8];

	(void)state;
	for (size_t i = 0; i < sizeof(parts) / sizeof(parts[0]); i++) {
		const char *at = strstr(small_pdf, parts[i]);

		snprintf(pdf, sizeof(pdf), "%.*s%s%s", (int)(at - small_pdf), small_pdf, others[i],
		         at + strlen(parts[i]));
		assert_null(attached(pdf, strlen(pdf)));
	}
	for (size_t length = 0; length < sizeof(small_pdf) - 1; length++) {
		char *cut = calloc(1, length + 1);

		memcpy(cut, small_pdf, length);
		free(attached(cut, length));
		free(cut);
	}
}

/* ---- the table against the archive's ---- */

static char told[1000];

static void tell(void *context, const char *text)
{
	(void)context;
	snprintf(told + strlen(told), sizeof(told) - strlen(told), "%s|", text);
}

static int held(const char *was, const char *is)
{
	told[0] = '\0';
	return verify_data(was, is, tell, NULL);
}

static void tables(void **state)
{
	static const char was[] = "series,number,note,s1_x_g,reason\ns,1,,376.1,\nbox,2,n,12,\"slid, 1\"\n";

	(void)state;
	assert_int_equal(held(was, was), 0);
	assert_string_equal(told, "");
	assert_int_equal(held(was, "series,number,note,s1_x_g,reason\ns,1,,376.2,\nbox,2,n,12,\"slid, 2\"\n"),
	                 2);
	assert_string_equal(told, "drop 1: s1_x_g is 376.1 in its table, the archive has 376.2|"
	                          "drop 2: reason is \"slid, 1\" in its table, the archive has \"slid, 2\"|");
	/* a later note, a later drop, other columns, another order and other line ends are no difference */
	assert_int_equal(
	        held(was, "number,s1_x_g,more,series,note,reason\r\n3,1,1,s,,\r\n2,12,1,box,later,\"slid, "
	                  "1\"\r\n1,376.1,1,s,now,"),
	        0);
	assert_int_equal(held(was, "series,number\ns,1\n"), 1);
	assert_string_equal(told, "drop 2 of its table is not in the archive|");
	assert_int_equal(held("", was), -1);
	assert_int_equal(held(was, ""), -1);
	assert_int_equal(held("series,s1_x_g\ns,1\n", was), -1);
	assert_int_equal(held("series,number\ns\n", was), -1);
}

int main(void)
{
	const struct CMUnitTest tests[] = {cmocka_unit_test(attachment), cmocka_unit_test(other_pdfs),
	                                   cmocka_unit_test(tables)};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
