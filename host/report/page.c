/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/report/page.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#include <gsl/gsl_version.h>

#include "common/wire.h"

void page_begin_compared(FILE *out, const struct report_row *row)
{
	fprintf(out, "<tr><td>%s%s%s</td><td>", row->label, row->unit[0] ? ", " : "", row->unit);
	html_with_sigma(out, row->decimals, row->predicted * row->scale, row->predicted_u * row->scale);
	fputs("</td><td>", out);
}

void page_end_compared(FILE *out, const struct report_row *row, bool simpler)
{
	fprintf(out, "</td><td>%s", row->difference_percent > 0.0 ? "+" : "");
	html_number(out, 1, row->difference_percent);
	fputs(isfinite(row->difference_percent) ? " %" : "", out);
	if (row->verdict[0])
		fprintf(out, ", %s", row->verdict);
	if (simpler) {
		fputs("</td><td>", out);
		html_number(out, row->decimals, row->rungs_apart * row->scale);
	}
	fputs("</td></tr>\n", out);
}

void page_channel_name(FILE *out, const char *name)
{
	if (strlen(name) == 3 && name[0] == 'S')
		fprintf(out, "%.2s %c", name, name[2]);
	else
		html_text(out, name);
}

/* Nothing is fetched and nothing runs, whatever a text may try. */
void page_begin(FILE *out, const char *title, const char *more)
{
	fputs("<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
	      "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">"
	      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; "
	      "style-src 'unsafe-inline'\"><title>",
	      out);
	html_text(out, title);
	fprintf(out, "</title>\n<style>%s%s</style></head>\n<body><main>\n<h1>", page_style, more);
	html_text(out, title);
	fputs("</h1>\n", out);
}

void page_end(FILE *out, const char *version)
{
	fputs("<p>droptower", out);
	if (version) {
		fputc(' ', out);
		html_text(out, version);
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
