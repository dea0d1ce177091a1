/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "hil/study/sheet.h"

#include <stdarg.h>
#include <stdbool.h>
#include <string.h>

#include "host/base/html.h"

enum { LINE_MAX_ = 1024, TEXT_WIDTH = 110 };

static const char style[] =
        "<style>:root{color-scheme:light dark}body{font:16px/1.5 system-ui,sans-serif;max-width:1300px;"
        "margin:2rem auto;padding:0 1rem}h2{margin-top:2.2em}p{max-width:75ch}div{overflow-x:auto}"
        "table{border-collapse:collapse;font-variant-numeric:tabular-nums}"
        "td,th{padding:.15em .42em;text-align:right;white-space:nowrap}"
        "td.words{text-align:left;white-space:normal;min-width:32ch}"
        "thead{border-bottom:1px solid}tbody tr:nth-child(even){background:#8882}"
        ".out{font-weight:bold;background:#e69f0066}"
        "svg{width:100%;height:auto;background:#fff}</style>";

/* Broken at blanks. */
static void put_wrapped(FILE *out, const char *text)
{
	int at = 0;

	while (*text != '\0') {
		int length = (int)strcspn(text, " ");

		if (at > 0 && at + 1 + length > TEXT_WIDTH) {
			fputc('\n', out);
			at = 0;
		}
		at += fprintf(out, "%s%.*s", at > 0 ? " " : "", length, text);
		text += length;
		text += strspn(text, " ");
	}
	fputc('\n', out);
}

void sheet_begin(struct sheet *sheet, const char *title)
{
	fprintf(sheet->text, "%s\n", title);
	fprintf(sheet->page,
	        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
	        "content=\"width=device-width\"><title>%s</title>%s</head><body>\n<h1>%s</h1>\n",
	        title, style, title);
}

void sheet_end(struct sheet *sheet)
{
	fputs("</body></html>\n", sheet->page);
}

void sheet_heading(struct sheet *sheet, const char *title)
{
	fprintf(sheet->text, "\n%s\n", title);
	fputs("<h2>", sheet->page);
	html_text(sheet->page, title);
	fputs("</h2>\n", sheet->page);
}

void sheet_say(struct sheet *sheet, const char *format, ...)
{
	char line[LINE_MAX_];
	va_list arguments;

	va_start(arguments, format);
	vsnprintf(line, sizeof(line), format, arguments);
	va_end(arguments);
	put_wrapped(sheet->text, line);
	fputs("<p>", sheet->page);
	html_text(sheet->page, line);
	fputs("</p>\n", sheet->page);
}

/* How many columns from i on share its group. */
static size_t group_span(const struct sheet *sheet, size_t i)
{
	size_t n = 1;

	while (i + n < sheet->count && strcmp(sheet->columns[i + n].group, sheet->columns[i].group) == 0)
		n++;
	return n;
}

static void put_groups(const struct sheet *sheet)
{
	fputs("<div><table><thead><tr>", sheet->page);
	for (size_t i = 0, n; i < sheet->count; i += n) {
		int width = 0;

		n = group_span(sheet, i);
		for (size_t k = i; k < i + n; k++)
			width += sheet->columns[k].width;
		fprintf(sheet->text, "%*s", width, sheet->columns[i].group);
		fprintf(sheet->page, "<th colspan=\"%zu\">", n);
		html_text(sheet->page, sheet->columns[i].group);
		fputs("</th>", sheet->page);
	}
	fputs("</tr>\n", sheet->page);
	fputc('\n', sheet->text);
}

void sheet_table(struct sheet *sheet, const struct sheet_column *columns, size_t count)
{
	bool grouped = false;

	sheet->columns = columns;
	sheet->count = count;
	for (size_t i = 0; i < count; i++)
		grouped = grouped || columns[i].group[0] != '\0';
	if (grouped)
		put_groups(sheet);
	else
		fputs("<div><table><thead>", sheet->page);
	fputs("<tr>", sheet->page);
	for (size_t i = 0; i < count; i++) {
		fprintf(sheet->text, "%*s", columns[i].width, columns[i].name);
		fputs("<th>", sheet->page);
		html_text(sheet->page, columns[i].name);
		fputs("</th>", sheet->page);
	}
	fputs("</tr></thead><tbody>\n", sheet->page);
	fputc('\n', sheet->text);
}

void sheet_row(struct sheet *sheet, const char *format, ...)
{
	char line[LINE_MAX_];
	const char *cell = line;
	va_list arguments;

	va_start(arguments, format);
	vsnprintf(line, sizeof(line), format, arguments);
	va_end(arguments);
	fputs("<tr>", sheet->page);
	for (size_t i = 0; i < sheet->count; i++) {
		size_t length = strcspn(cell, "|");
		bool out = length > 0 && cell[length - 1] == '*', words = sheet->columns[i].width < 0;

		fprintf(sheet->text, "%s%*.*s", words ? "  " : "", sheet->columns[i].width, (int)length,
		        cell);
		fputs(out ? "<td class=\"out\">" : words ? "<td class=\"words\">" : "<td>", sheet->page);
		html_text_part(sheet->page, cell, length);
		fputs("</td>", sheet->page);
		cell += length + (cell[length] == '|');
	}
	fputs("</tr>\n", sheet->page);
	fputc('\n', sheet->text);
}

void sheet_table_end(struct sheet *sheet)
{
	fputs("</tbody></table></div>\n", sheet->page);
}

void sheet_picture(struct sheet *sheet, const char *title, const char *text, const char *svg)
{
	const char *start = strstr(svg, "<svg");

	fputs("<h2>", sheet->page);
	html_text(sheet->page, title);
	fputs("</h2>\n<p>", sheet->page);
	html_text(sheet->page, text);
	fprintf(sheet->page, "</p>\n%s\n", start != NULL ? start : "");
}
