/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/base/html.h"

#include <math.h>
#include <stdbool.h>
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
		default:
			fputc(text[i], out);
		}
	}
}

void html_text(FILE *out, const char *text)
{
	html_text_part(out, text, strlen(text));
}

void html_number(FILE *out, int decimals, double value)
{
	bool negative = value < -0.5 * pow(10.0, -decimals); /* as it is rounded: no -0.0 */

	if (isfinite(value))
		fprintf(out, "%s%.*f", negative ? "&minus;" : "", decimals, fabs(value));
	else
		fputs("&ndash;", out);
}

void html_with_sigma(FILE *out, int decimals, double value, double sigma)
{
	html_number(out, decimals, value);
	if (isfinite(value) && isfinite(sigma)) {
		fputs(" &plusmn; ", out);
		html_number(out, decimals, sigma);
	}
}
