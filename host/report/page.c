/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/report/page.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#include <gsl/gsl_version.h>

#include "common/wire.h"

void page_text_part(FILE *out, const char *text, size_t length)
{
	for (size_t i = 0; i < length; i++) {
		switch (text[i]) {
		case '&':
			fputs("&amp;", out);
			break;
		case '<':
			fputs("&lt;", out);
			break;
		case '>':
			fputs("&gt;", out);
			break;
		case '"':
			fputs("&quot;", out);
			break;
		case '\'':
			fputs("&#39;", out);
			break;
		default:
			fputc(text[i], out);
		}
	}
}

void page_text(FILE *out, const char *text)
{
	page_text_part(out, text, strlen(text));
}

void page_number(FILE *out, int decimals, double value)
{
	bool negative = value < -0.5 * pow(10.0, -decimals); /* as it is rounded: no -0.0 */

	if (isfinite(value))
		fprintf(out, "%s%.*f", negative ? "&minus;" : "", decimals, fabs(value));
	else
		fputs("&ndash;", out);
}

void page_with_sigma(FILE *out, int decimals, double value, double sigma)
{
	page_number(out, decimals, value);
	if (isfinite(value) && isfinite(sigma)) {
		fputs(" &plusmn; ", out);
		page_number(out, decimals, sigma);
	}
}

void page_begin_compared(FILE *out, const struct report_row *row)
{
	fprintf(out, "<tr><td>%s%s%s</td><td>", row->label, row->unit[0] ? ", " : "", row->unit);
	page_with_sigma(out, row->decimals, row->predicted * row->scale, row->rungs_apart * row->scale);
	fputs("</td><td>", out);
}

void page_end_compared(FILE *out, const struct report_row *row)
{
	fprintf(out, "</td><td>%s", row->difference_percent > 0.0 ? "+" : "");
	page_number(out, 1, row->difference_percent);
	fputs(isfinite(row->difference_percent) ? " %</td></tr>\n" : "</td></tr>\n", out);
}

void page_channel_name(FILE *out, const char *name)
{
	if (strlen(name) == 3 && name[0] == 'S')
		fprintf(out, "%.2s %c", name, name[2]);
	else
		page_text(out, name);
}

/* Nothing is fetched and nothing runs, whatever a text may try. */
void page_begin(FILE *out, const char *title, const char *more)
{
	fputs("<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
	      "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">"
	      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; "
	      "style-src 'unsafe-inline'\"><title>",
	      out);
	page_text(out, title);
	fprintf(out, "</title>\n<style>%s%s</style></head>\n<body><main>\n<h1>", page_style, more);
	page_text(out, title);
	fputs("</h1>\n", out);
}

void page_end(FILE *out, const char *version)
{
	fputs("<p>droptower", out);
	if (version) {
		fputc(' ', out);
		page_text(out, version);
	}
	fprintf(out,
	        ", wire %08" PRIX32 ", GSL %s, pictures by gnuplot.</p></footer>\n</main></body></html>\n",
	        wire_hash(), gsl_version);
}

void page_begin_card(FILE *out, const char *label)
{
	fprintf(out, "<div class=\"card\"><span class=\"label\">%s</span><span class=\"value\">", label);
}

void page_end_card(FILE *out, const char *unit, const char *note)
{
	fprintf(out, "<small> %s</small></span><span class=\"note\">%s</span></div>\n", unit, note);
}
