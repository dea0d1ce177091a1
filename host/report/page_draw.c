/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A page's pictures: one gnuplot draws them all when the page is closed, since to start it costs more than to
 * draw. */
#include <stdlib.h>
#include <string.h>

#include "host/report/page.h"
#include "host/report/picture.h"

int page_open(struct page *page, FILE *out)
{
	page->whole = out;
	page->error = text_open(&page->body);
	page->out = page->body.out;
	if (!page->error) {
		page->error = text_open(&page->scripts);
		if (page->error)
			page->error = text_close(&page->body, page->error);
	}
	return page->error;
}

bool page_begin_script(struct page *page, struct text *script)
{
	if (!page->error)
		page->error = text_open(script);
	return !page->error;
}

/* Where the next byte of the body will stand. */
static size_t page_place(struct page *page)
{
	return fflush(page->out) == 0 ? page->body.size : 0;
}

/* The picture that the script so far leaves out comes in here. */
static void page_mark(struct page *page)
{
	size_t *at = realloc(page->picture_at, (page->pictures + 1) * sizeof(*at));

	if (!at) {
		page->error = DT_E_MEMORY;
		return;
	}
	page->picture_at = at;
	page->picture_at[page->pictures++] = page_place(page);
}

void page_draw(struct page *page, struct text *script, bool drawn, const char *label)
{
	page->error = text_close(script, 0);
	if (page->error)
		return;
	if (drawn) {
		fputs("<svg role=\"img\" aria-label=\"", page->out);
		html_text(page->out, label);
		fputc('"', page->out);
		page_mark(page);
		fwrite(script->bytes, 1, script->size, page->scripts.out);
		fputs("reset\nundefine $*\n", page->scripts.out);
	} else {
		fputs("<p class=\"soft\">Nothing to draw: no good sample here.</p>", page->out);
	}
	free(script->bytes);
}

static const char *after(const char *s, const char *end)
{
	const char *found = strstr(s, end);

	return found ? found + strlen(end) : s + strlen(s);
}

/* The rest of the <svg> element that stands next in *svgs, which moves behind it; false: none. What every
 * picture of gnuplot repeats (symbols, an id) may stand only once in a page, and its <title>s would pop up as
 * hints. */
static bool page_put_svg(FILE *out, const char **svgs, bool first)
{
	const char *s = after(*svgs, "<svg"), *end = strstr(s, "</svg>");

	if (!end)
		return false;
	*svgs = end + strlen("</svg>");
	while (s < *svgs) {
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
	return true;
}

/* The body with its pictures in their places. */
static int page_put(const struct page *page, const char *svgs, FILE *out)
{
	size_t from = 0;

	for (size_t i = 0; i < page->pictures; i++) {
		fwrite(page->body.bytes + from, 1, page->picture_at[i] - from, out);
		from = page->picture_at[i];
		if (!page_put_svg(out, &svgs, i == 0)) {
			snprintf(page->message, page->size, "gnuplot made %zu pictures, expected %zu", i,
			         page->pictures);
			return DT_E_SYSTEM;
		}
	}
	fwrite(page->body.bytes + from, 1, page->body.size - from, out);
	return 0;
}

static int page_translate(const struct page *page, const char *svgs)
{
	struct text english;
	int result = text_open(&english);

	if (result == 0)
		result = text_close(&english, page_put(page, svgs, english.out));
	if (result == 0)
		result = language_write(page->translation, english.bytes, english.size, page->whole);
	free(english.bytes);
	return result;
}

int page_close(struct page *page)
{
	char *svgs = NULL;

	page->error = text_close(&page->body, page->error);
	page->error = text_close(&page->scripts, page->error);
	if (!page->error && page->pictures > 0)
		page->error = picture_draw(page->scripts.bytes, page->scripts.size, &svgs, page->message,
		                           page->size);
	if (!page->error)
		page->error = page_translate(page, svgs);
	free(svgs);
	free(page->body.bytes);
	free(page->scripts.bytes);
	free(page->picture_at);
	return page->error;
}
