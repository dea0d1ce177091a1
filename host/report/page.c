/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/report/page.h"

#include <math.h>
#include <string.h>

void page_text(FILE *out, const char *s)
{
	for (; *s; s++) {
		switch (*s) {
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
		default:
			fputc(*s, out);
		}
	}
}

void page_number(FILE *out, int decimals, double value)
{
	if (isfinite(value))
		fprintf(out, "%s%.*f", value < 0.0 ? "&minus;" : "", decimals, fabs(value));
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

/* "S1X" as "S1 X"; other names as they are. */
void page_channel_name(FILE *out, const char *name)
{
	if (strlen(name) == 3 && name[0] == 'S')
		fprintf(out, "%.2s %c", name, name[2]);
	else
		page_text(out, name);
}
