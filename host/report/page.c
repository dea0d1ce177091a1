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
		fprintf(out, "%c%.2s %c%c", HTML_OWN, name, name[2], HTML_OWN_END);
	else
		html_own(out, name);
}

void page_note_subject(FILE *out, const char *of)
{
	static const char *const whats[] = {" peak", " velocity change", " contact", " resultant", " lag"};
	size_t length = strlen(of);

	for (size_t i = 0; i < sizeof(whats) / sizeof(whats[0]); i++) {
		size_t what = strlen(whats[i]);

		if (length > what && strcmp(of + length - what, whats[i]) == 0 &&
		    strncmp(of, "driven", 6) != 0) {
			fputc(HTML_OWN, out);
			html_text_part(out, of, length - what);
			fputc(HTML_OWN_END, out);
			html_text(out, of + length - what);
			return;
		}
	}
	html_text(out, of);
}

/* Nothing is fetched and nothing runs, whatever a text may try. */
void page_begin(FILE *out, const char *title, const char *more)
{
	fputs("<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
	      "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">"
	      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; "
	      "style-src 'unsafe-inline'\"><title>",
	      out);
	html_own(out, title);
	fprintf(out, "</title>\n<style>%s%s</style></head>\n<body><main>\n<h1>", page_style, more);
	html_own(out, title);
	fputs("</h1>\n", out);
}

void page_end(FILE *out, const char *version)
{
	fputs("<p>droptower", out);
	if (version) {
		fputc(' ', out);
		html_own(out, version);
	}
	fprintf(out,
	        ", wire %08" PRIX32
	        ", GSL %c%s%c, pictures by gnuplot.</p></footer>\n</main></body></html>\n",
	        wire_hash(), HTML_OWN, gsl_version, HTML_OWN_END);
}

void page_limits_by(FILE *out, const struct verdict *v)
{
	fputs(v->by[0] != '\0' ? "<p class=\"note\">Limits by " : "<p class=\"note\">Limits of the scene",
	      out);
	if (v->by[0] != '\0')
		html_own(out, v->by);
	fprintf(out, ". Uncertainty of %s.%s</p>\n", v->rests_on,
	        v->verified ? "" : " " VERDICT_UNVERIFIED ".");
}

void page_begin_card(FILE *out, const char *label)
{
	fprintf(out, "<div class=\"card\"><span class=\"label\">%s</span><span class=\"value\">", label);
}

void page_end_card(FILE *out, const char *unit, const char *note)
{
	fprintf(out, "<small> %s</small></span><span class=\"note\">%s</span></div>\n", unit, note);
}
