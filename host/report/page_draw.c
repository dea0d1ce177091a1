/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <stdlib.h>
#include <string.h>

#include "host/report/page.h"
#include "host/report/picture.h"

static const char *after(const char *s, const char *end)
{
	const char *found = strstr(s, end);

	return found ? found + strlen(end) : s + strlen(s);
}

/* The <svg> element alone. What every picture of gnuplot repeats (symbols, an id) may stand only once in
 * a page, and its <title>s would pop up as hints. */
static void inline_svg(FILE *out, const char *svg, bool first, const char *label)
{
	const char *s = strstr(svg, "<svg");

	if (!s)
		return;
	fputs("<svg role=\"img\" aria-label=\"", out);
	html_text(out, label);
	fputc('"', out);
	s += strlen("<svg");
	while (*s) {
		if (!strncmp(s, "<title>", 7))
			s = after(s, "</title>");
		else if (!strncmp(s, "<desc>", 6))
			s = after(s, "</desc>");
		else if (!first && !strncmp(s, "<defs>", 6))
			s = after(s, "</defs>");
		else if (!strncmp(s, " id=\"gnuplot", 12))
			s = after(s + 5, "\"");
		else
			fputc(*s++, out);
	}
}

void page_draw(struct page *page, struct text *script, bool drawn, const char *label)
{
	char *svg = NULL;

	page->error = text_close(script, 0);
	if (page->error)
		return;
	if (drawn) {
		page->error = picture_draw(script->bytes, script->size, &svg, page->message, page->size);
		if (!page->error)
			inline_svg(page->out, svg, page->pictures++ == 0, label);
		free(svg);
	} else {
		fputs("<p class=\"soft\">Nothing to draw: no good sample here.</p>", page->out);
	}
	free(script->bytes);
}

bool page_begin_script(struct page *page, struct text *script)
{
	if (!page->error)
		page->error = text_open(script);
	return !page->error;
}
