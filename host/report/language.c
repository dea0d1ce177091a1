/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/report/language.h"

#include <ctype.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "host/base/html.h"

static const struct language_text german[] = {
#define TEXT(english, other) {english, other},
#include "host/report/german.def"
#undef TEXT
};

static const struct language languages[] = {
        {"en", '.', "", NULL, 0},
        {"de", ',', "th{white-space:normal;vertical-align:bottom}", german,
         sizeof(german) / sizeof(german[0])},
};

const struct language *language_find(const char *code)
{
	for (size_t i = 0; i < sizeof(languages) / sizeof(languages[0]); i++)
		if (strcmp(languages[i].code, code) == 0)
			return &languages[i];
	return NULL;
}

/* ---- a text, with the entities as the characters that they are ---- */

static const struct {
	const char *entity, *character;
} entities[] = {
        {"&amp;", "&"},  {"&lt;", "<"},     {"&gt;", ">"},    {"&quot;", "\""},  {"&#39;", "'"},
        {"&deg;", "°"},  {"&minus;", "−"},  {"&ndash;", "–"}, {"&plusmn;", "±"}, {"&times;", "×"},
        {"&emsp;", " "}, {"&#10003;", "✓"}, {"&#9888;", "⚠"}, {"&#9675;", "○"},  {"&#9650;", "▲"},
};

/* to has room for as many bytes. Returns the end of what is written. */
static char *decode(const char *from, const char *end, char *to)
{
	while (from < end) {
		size_t i = 0, count = sizeof(entities) / sizeof(entities[0]);

		while (*from == '&' && i < count &&
		       strncmp(from, entities[i].entity, strlen(entities[i].entity)) != 0)
			i++;
		if (isspace((unsigned char)*from)) { /* one, however many there are */
			*to++ = ' ';
			while (from < end && isspace((unsigned char)*from))
				from++;
			continue;
		}
		if (*from != '&' || i == count) {
			*to++ = *from++;
			continue;
		}
		memcpy(to, entities[i].character, strlen(entities[i].character));
		to += strlen(entities[i].character);
		from += strlen(entities[i].entity);
	}
	return to;
}

/* Behind the user's words that begin at from. */
static const char *after_own(const char *from, const char *end)
{
	const char *mark = memchr(from, HTML_OWN_END, (size_t)(end - from));

	return mark != NULL ? mark + 1 : end;
}

/* A sign, digits with a point or without, an exponent; or the dash for what is not known. Its bytes, or 0. */
static size_t number_size(const char *from, const char *end)
{
	const char *at = from;

	if (end - at >= 3 && (memcmp(at, "−", 3) == 0 || memcmp(at, "–", 3) == 0)) {
		at += 3;
		if (from[2] == "–"[2] && (at == end || !isdigit((unsigned char)*at)))
			return 3;
	} else if (at < end && (*at == '+' || *at == '-')) {
		at++;
	}
	if (at == end || !isdigit((unsigned char)*at))
		return 0;
	while (at < end && isdigit((unsigned char)*at))
		at++;
	if (end - at >= 2 && at[0] == '.' && isdigit((unsigned char)at[1]))
		for (at++; at < end && isdigit((unsigned char)*at);)
			at++;
	if (end - at >= 3 && at[0] == 'e' && (at[1] == '+' || at[1] == '-') && isdigit((unsigned char)at[2]))
		for (at += 2; at < end && isdigit((unsigned char)*at);)
			at++;
	return (size_t)(at - from);
}

/* A word that is none of a language: a checksum of eight hexadecimal digits, a key as S1X.peak.value_g. Its
 * bytes, or 0. */
static size_t key_size(const char *from, const char *end)
{
	size_t size = 0, digits = 0;
	bool key = false;

	for (; from + size < end && (isalnum((unsigned char)from[size]) || strchr("._/-", from[size]));
	     size++) {
		digits += isxdigit((unsigned char)from[size]) != 0;
		key |= from[size] == '.' && from + size + 1 < end && isalpha((unsigned char)from[size + 1]);
	}
	return key || (size == 8 && digits == 8) ? size : 0;
}

/* Whether there is a word to translate: a letter that is not the user's, nor a number's exponent. */
static bool has_words(const char *from, const char *end)
{
	while (from < end) {
		size_t number = key_size(from, end);

		number = number > 0 ? number : number_size(from, end);
		if (*from == HTML_OWN)
			from = after_own(from, end);
		else if (number > 0)
			from += number;
		else if (isalpha((unsigned char)*from++))
			return true;
	}
	return false;
}

/* ---- the entry of a text ---- */

enum { PARTS_MAX = 16, KNOWN_MAX = 1 << 12, LOOKS_MAX = 1000 };

struct part {
	const char *from, *end;
};

/* Of parts of the text at hand: the entry that was found; NULL: there is none. So each is looked for once. */
struct known {
	struct part part;
	const struct language_text *text;
};

struct passing {
	const struct translation *translation;
	const struct language *l;
	FILE *out;
	char *text; /* room for any text of the page */
	struct known known[KNOWN_MAX];
	size_t looks; /* at parts of the text */
};

static const struct language_text *language_look(struct passing *p, const char *from, const char *end);

static bool is_known(struct passing *p, const char *from, const char *end)
{
	return !has_words(from, end) || language_look(p, from, end) != NULL;
}

/* part: what stands in the places of # and {}. */
static bool fits(struct passing *p, const char *key, const char *from, const char *end, struct part *part)
{
	for (; *key != '\0'; key++) {
		size_t size = *key == '#' ? number_size(from, end) : 1;

		if (strncmp(key, "{}", 2) == 0) {
			const char *to = key[2] == '\0' ? end : from;

			for (; to <= end; to = to < end && *to == HTML_OWN ? after_own(to, end) : to + 1)
				if (to > from && fits(p, key + 2, to, end, part + 1) &&
				    is_known(p, from, to)) {
					*part = (struct part){from, to};
					return true;
				}
			return false;
		}
		if (from == end || size == 0 || (*key != '#' && *key != *from))
			return false;
		if (*key == '#')
			*part++ = (struct part){from, from + size};
		from += size;
	}
	return from == end;
}

/* Where it is known, or will be; NULL: the text has too many parts. */
static struct known *place_of(struct passing *p, const char *from, const char *end)
{
	size_t at = (size_t)(from - p->text) * 769 + (size_t)(end - p->text);

	for (size_t i = 0; i < 64; i++) {
		struct known *k = &p->known[(at + i) % KNOWN_MAX];

		if (k->part.from == NULL || (k->part.from == from && k->part.end == end))
			return k;
	}
	return NULL;
}

static const struct language_text *language_look(struct passing *p, const char *from, const char *end)
{
	struct known *k = place_of(p, from, end);
	struct part part[PARTS_MAX];

	if (k == NULL || k->part.from != NULL)
		return k != NULL ? k->text : NULL;
	if (p->looks++ >= LOOKS_MAX)
		return NULL;
	k->part = (struct part){from, end};
	for (size_t i = 0; i < p->l->count && k->text == NULL; i++)
		if (fits(p, p->l->text[i].english, from, end, part))
			k->text = &p->l->text[i];
	return k->text;
}

/* ---- a text in the other language ---- */

static void put_own(const char *from, const char *end, FILE *out)
{
	for (; from < end; from++)
		if (*from != HTML_OWN && *from != HTML_OWN_END)
			html_text_part(out, from, 1);
}

/* 0.5 as 0,5; 7.8.2 and 1.2-rc as they are. */
static void put_number(const struct language *l, const char *from, const char *end, FILE *out)
{
	for (; from < end; from++)
		fputc(*from == '.' ? l->decimal : *from, out);
}

static void put_numbers(const struct language *l, const char *from, const char *end, FILE *out)
{
	while (from < end) {
		size_t size = number_size(from, end);
		const char *next = from + size;

		if (*from == HTML_OWN) {
			put_own(from, after_own(from, end), out);
			from = after_own(from, end);
		} else if (key_size(from, end) > 0) {
			size = key_size(from, end);
			html_text_part(out, from, size);
			from += size;
		} else if (size > 0 && end - next >= 2 && *next == '.' && isdigit((unsigned char)next[1])) {
			while (from < next || (from < end && (*from == '.' || isdigit((unsigned char)*from))))
				fputc(*from++, out); /* of a clause */
		} else if (size > 0) {
			put_number(l, from, next, out);
			from = next;
		} else {
			html_text_part(out, from++, 1);
		}
	}
}

/* False, and nothing is written, of a text without an entry. */
static bool language_put(struct passing *p, const char *from, const char *end)
{
	const struct language_text *text;
	struct part parts[PARTS_MAX], *part = parts;

	if (!has_words(from, end)) {
		put_numbers(p->l, from, end, p->out);
		return true;
	}
	text = language_look(p, from, end);
	if (text == NULL || !fits(p, text->english, from, end, parts))
		return false;
	for (const char *s = text->other; *s != '\0'; s++) {
		if (*s == '#') {
			put_number(p->l, part->from, part->end, p->out);
			part++;
		} else if (strncmp(s, "{}", 2) == 0) {
			(void)language_put(p, part->from, part->end);
			part++;
			s++;
		} else {
			html_text_part(p->out, s, 1);
		}
	}
	return true;
}

/* ---- a page ---- */

static bool is_around(char c, const char *more)
{
	return c == ' ' || strchr(more, c) != NULL;
}

/* A text as a whole, else without the marks around it. */
static void pass_text(struct passing *p, const char *from, const char *end)
{
	const char *first = p->text, *last = decode(from, end, p->text);

	memset(p->known, 0, sizeof(p->known));
	p->looks = 0;
	while (first < last && is_around(*first, ""))
		fputc(*first++, p->out);
	end = last;
	while (last > first && is_around(last[-1], ""))
		last--;
	if (!language_put(p, first, last)) {
		while (first < last && is_around(*first, ",.;:("))
			fputc(*first++, p->out);
		while (last > first && is_around(last[-1], ",.;:)"))
			last--;
		if (!language_put(p, first, last)) {
			put_own(first, last, p->out);
			p->text[last - p->text] = '\0';
			if (p->translation->tell != NULL)
				p->translation->tell(p->translation->context, first);
			return;
		}
	}
	put_own(last, end, p->out);
}

/* From a quote of the page to the one that ends it; returns behind it. */
static const char *pass_quoted(struct passing *p, const char *from, const char *end)
{
	const char *quote = memchr(from, '"', (size_t)(end - from));

	quote = quote != NULL ? quote : end;
	pass_text(p, from, quote);
	return quote;
}

/* Bytes before the text of an attribute that people read or hear; 0: none is here. */
static size_t label_size(const char *from)
{
	static const char *const labels[] = {"aria-label=\"", "alt=\""};

	for (size_t i = 0; i < sizeof(labels) / sizeof(labels[0]); i++)
		if (strncmp(from, labels[i], strlen(labels[i])) == 0)
			return strlen(labels[i]);
	return 0;
}

/* A tag or a comment; behind it. */
static const char *pass_tag(struct passing *p, const char *from, const char *end)
{
	const bool comment = strncmp(from, "<!--", 4) == 0;
	const char *behind = comment ? strstr(from, "-->") : memchr(from, '>', (size_t)(end - from));

	behind = behind == NULL ? end : behind + (comment ? 3 : 1);
	while (from < behind) {
		size_t size = comment ? 0 : label_size(from);

		fwrite(from, 1, size, p->out);
		if (size > 0) {
			from = pass_quoted(p, from + size, behind);
		} else if (strncmp(from, "lang=\"en\"", 9) == 0) {
			fprintf(p->out, "lang=\"%s\"", p->l->code);
			from += 9;
		} else {
			fputc(*from++, p->out);
		}
	}
	return behind;
}

/* The strings of a style. */
static const char *pass_style(struct passing *p, const char *from, const char *end)
{
	const char *behind = strstr(from, "</style>");

	behind = behind != NULL ? behind : end;
	while (from < behind) {
		const char *quote = memchr(from, '"', (size_t)(behind - from));

		quote = quote != NULL ? quote + 1 : behind;
		fwrite(from, 1, (size_t)(quote - from), p->out);
		from = quote < behind ? pass_quoted(p, quote, behind) : behind;
		if (from < behind)
			fputc(*from++, p->out);
	}
	fputs(p->l->style, p->out);
	return behind;
}

static void pass_page(struct passing *p, const char *at, const char *end)
{
	while (at < end) {
		const char *tag = memchr(at, '<', (size_t)(end - at));

		tag = tag != NULL ? tag : end;
		pass_text(p, at, tag);
		at = tag < end ? pass_tag(p, tag, end) : end;
		if (end - tag > 7 && memcmp(tag, "<style>", 7) == 0)
			at = pass_style(p, at, end);
	}
}

static void write_english(const char *page, size_t size, FILE *out)
{
	for (const char *end = page + size; page < end; page++) {
		size_t length = strcspn(page, (const char[]){HTML_OWN, HTML_OWN_END, '\0'});

		length = length < (size_t)(end - page) ? length : (size_t)(end - page);
		fwrite(page, 1, length, out);
		page += length;
	}
}

int language_write(const struct translation *translation, const char *page, size_t size, FILE *out)
{
	const struct language *l = translation != NULL ? translation->language : NULL;
	struct passing *p;
	int result;

	if (l == NULL || l->count == 0) {
		write_english(page, size, out);
		return 0;
	}
	p = calloc(1, sizeof(*p));
	if (p == NULL)
		return DT_E_MEMORY;
	*p = (struct passing){.translation = translation, .l = l, .out = out, .text = malloc(size + 1)};
	if (p->text != NULL)
		pass_page(p, page, page + size);
	result = p->text != NULL ? 0 : DT_E_MEMORY;
	free(p->text);
	free(p);
	return result;
}
