/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/base/html.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

void html_text_part(FILE *out, const char *text, size_t length)
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
		case HTML_OWN:
		case HTML_OWN_END:
			break;
		default:
			fputc(text[i], out);
		}
	}
}

void html_text(FILE *out, const char *text)
{
	html_text_part(out, text, strlen(text));
}

void html_own(FILE *out, const char *text)
{
	fputc(HTML_OWN, out);
	html_text(out, text);
	fputc(HTML_OWN_END, out);
}

enum { SIGMA_DIGITS = -3 }; /* of a value with significant digits */

void html_number(FILE *out, int decimals, double value)
{
	bool negative = value < (decimals < 0 ? 0.0 : -0.5 * pow(10.0, -decimals)); /* as rounded: no -0.0 */

	if (isfinite(value))
		fprintf(out, decimals < 0 ? "%s%.*g" : "%s%.*f", negative ? "&minus;" : "", abs(decimals),
		        fabs(value));
	else
		fputs("&ndash;", out);
}

void html_with_sigma(FILE *out, int decimals, double value, double sigma)
{
	html_number(out, decimals, value);
	if (isfinite(value) && isfinite(sigma)) {
		fputs(" &plusmn; ", out);
		html_number(out, decimals < 0 ? SIGMA_DIGITS : decimals, sigma);
	}
}
