/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/sniff_private.h"

#include <ctype.h>
#include <math.h>

#include "common/base/number.h"

/* A line of a head without the marks before its words. */
static struct piece head_words(const struct source_line *line)
{
	struct piece text = {line->text, line->length};

	while (text.length > 0 && strchr("#\"; \t%/", text.text[0])) {
		text.text++;
		text.length--;
	}
	return text;
}

/* The number at *at of a line, and *at behind it. NAN: it may be one of two, as 20,000; 0: there is none. */
static double told_number(const struct piece *text, struct cells_style style, size_t *at)
{
	size_t from = *at, end = from, digits = 0;
	double value = 0;
	char sign = '.';

	while (end < text->length && strchr("0123456789.+-eE", text->text[end]))
		end++;
	if (end < text->length && text->text[end] == ',') {
		while (end + 1 + digits < text->length &&
		       isdigit((unsigned char)text->text[end + 1 + digits]))
			digits++;
		if (digits == 3 && style.decimal != ',')
			return NAN;
		if (digits > 0 && style.separator != ',') {
			sign = ',';
			end += 1 + digits;
		}
	}
	*at = end;
	if (sign == '.' && style.decimal == ',' && memchr(text->text + from, '.', end - from) != NULL)
		return NAN; /* where a comma is the decimal sign a point may stand for thousands */
	return number_parse(text->text + from, end - from, sign, &value) && value > 0 ? value : 0;
}

/* A blank of the word is a blank, a stroke, an underscore or nothing in the text. How much of it is the word;
 * 0: it does not begin with it. */
static size_t begins_with(struct piece text, const char *word)
{
	size_t at = 0;

	for (; *word != '\0'; word++) {
		if (*word == ' ') {
			at += at < text.length && strchr(" _-", text.text[at]) != NULL;
			continue;
		}
		if (at == text.length || tolower((unsigned char)text.text[at]) != (unsigned char)*word)
			return 0;
		at++;
	}
	return at < text.length && sniff_is_letter(text.text[at]) ? 0 : at;
}

enum sniff_key sniff_key(struct piece text, size_t *length)
{
	static const struct {
		enum sniff_key key;
		const char *word;
	} words[] = {{SNIFF_RATE, "sample rate"},
	             {SNIFF_RATE, "sampling rate"},
	             {SNIFF_RATE, "sample frequency"},
	             {SNIFF_RATE, "sampling frequency"},
	             {SNIFF_RATE, "abtastrate"},
	             {SNIFF_RATE, "scan rate"},
	             {SNIFF_RATE, "fs"},
	             {SNIFF_STEP, "sample interval"},
	             {SNIFF_STEP, "sampling interval"},
	             {SNIFF_STEP, "sampling period"},
	             {SNIFF_STEP, "time step"},
	             {SNIFF_STEP, "delta t"},
	             {SNIFF_STEP, "dt"},
	             {SNIFF_STEP, "interval"},
	             {SNIFF_STEP, "abtastintervall"}};

	for (size_t i = 0; i < sizeof(words) / sizeof(words[0]); i++) {
		*length = begins_with(text, words[i].word);
		if (*length > 0)
			return words[i].key;
	}
	return SNIFF_NO_KEY;
}

double sniff_rate(const struct source_line *line, struct cells_style style)
{
	struct piece text = head_words(line);
	const struct unit *unit;
	enum sniff_key key;
	double value;
	size_t at, end;

	key = sniff_key(text, &at);
	if (key == SNIFF_NO_KEY)
		return 0;
	for (at = 0; at < text.length && !(text.text[at] >= '0' && text.text[at] <= '9');)
		at++;
	end = at;
	value = told_number(&text, style, &end);
	if (!(value > 0))
		return value;
	while (end < text.length && strchr(" \t,;\"", text.text[end]))
		end++;
	at = end;
	while (end < text.length && !strchr(" \t,;\"", text.text[end]))
		end++;
	unit = unit_find(text.text + at, end - at);
	if (unit == NULL) /* in the key: "Sample rate (kHz);51.2" */
		unit = unit_of_name(text.text, at, UNIT_TIME);
	if (key == SNIFF_STEP)
		return unit != NULL && unit->kind == UNIT_TIME && unit->divisor >= 1 ? unit->divisor / value
		                                                                     : 0;
	if (unit == NULL)
		return 0;
	return value * unit_hertz(unit);
}

/* Those from SCALE_ANYWHERE on may follow other words: "Amplifier gain", but neither "Full scale" nor "Crest
 * factor". */
static const char *const scale_words[] = {"scale",
                                          "factor",
                                          "faktor",
                                          "scale factor",
                                          "scaling",
                                          "scaling factor",
                                          "multiplier",
                                          "skalierung",
                                          "skalenfaktor",
                                          "y multiplier",
                                          "conversion factor",
                                          "skalierungsfaktor",
                                          "verstaerkung",
                                          "gain",
                                          "verst\xc3\xa4rkung"};
enum { SCALE_WORDS = sizeof(scale_words) / sizeof(scale_words[0]), SCALE_ANYWHERE = 3 };

bool sniff_is_scale(struct piece key)
{
	for (size_t i = 0; i < SCALE_WORDS; i++)
		if (key.length > 0 && begins_with(key, scale_words[i]) == key.length)
			return true;
	return false;
}

/* Each number from at on, as many as there are channels, up to what is none. */
static bool tells_other_than_one(const struct piece *text, struct cells_style style, size_t at)
{
	size_t digit;

	for (;;) {
		while (at < text->length && strchr(" \t:=;,\"", text->text[at]))
			at++;
		digit = at;
		while (digit < text->length && strchr("+-.", text->text[digit]))
			digit++;
		if (digit == text->length || !isdigit((unsigned char)text->text[digit]))
			return false;
		if (!(fabs(told_number(text, style, &at) - 1) < 1e-12))
			return true;
	}
}

bool sniff_tells_scale(const struct source_line *line, struct cells_style style)
{
	struct piece text = head_words(line), rest;
	size_t length;

	if (piece_has(text, "polarit") && (piece_has(text, "invert") || piece_has(text, "negativ")))
		return true;
	for (size_t at = 0; at < text.length && strchr(":=;,\t", text.text[at]) == NULL; at++) {
		rest = (struct piece){text.text + at, text.length - at};
		for (size_t i = at == 0 ? 0 : SCALE_ANYWHERE; i < SCALE_WORDS; i++) {
			length = begins_with(rest, scale_words[i]);
			if (length > 0 && (length == rest.length || !sniff_is_letter(rest.text[length])) &&
			    (at == 0 || !sniff_is_letter(rest.text[-1])) &&
			    tells_other_than_one(&rest, style, length))
				return true;
		}
	}
	return false;
}
