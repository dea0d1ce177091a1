/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/command/verify_data.h"

#include <stdbool.h>
#include <stdio.h>
#include <string.h>

enum { SHOWN_MAX = 60 /* letters of a cell in a message */ };

/* A piece of a table: a line, or a cell with its quotes. */
struct piece {
	const char *at;
	size_t length;
};

struct table_pair {
	struct piece head[2]; /* of what was, of what is */
	const char *rows[2];
	void (*tell)(void *context, const char *text);
	void *context;
	int wrong;
};

static bool is_same_text(struct piece a, struct piece b)
{
	return a.length == b.length && memcmp(a.at, b.at, a.length) == 0;
}

/* The line at *text, which goes behind it; false at the end. Texts in cells have no line ends. */
static bool take_line(const char **text, struct piece *line)
{
	if (**text == '\0')
		return false;
	line->at = *text;
	line->length = strcspn(*text, "\n");
	*text += line->length + ((*text)[line->length] == '\n');
	line->length -= line->length > 0 && line->at[line->length - 1] == '\r';
	return true;
}

/* Cell number index of a line; false when it has fewer. */
static bool cell_of(struct piece line, size_t index, struct piece *cell)
{
	bool quoted = false;
	size_t begin = 0;

	for (size_t i = 0; i <= line.length; i++) {
		if (i < line.length && line.at[i] == '"')
			quoted = !quoted;
		if (i < line.length && (quoted || line.at[i] != ','))
			continue;
		if (index-- == 0) {
			*cell = (struct piece){line.at + begin, i - begin};
			return true;
		}
		begin = i + 1;
	}
	return false;
}

/* The cell below a title. */
static bool cell_named(struct piece head, struct piece line, struct piece title, struct piece *cell)
{
	struct piece t;

	for (size_t i = 0; cell_of(head, i, &t); i++)
		if (is_same_text(t, title))
			return cell_of(line, i, cell);
	return false;
}

static struct piece named(const char *title)
{
	return (struct piece){title, strlen(title)};
}

static void tell_cell(struct table_pair *p, struct piece number, struct piece title, struct piece was,
                      struct piece is)
{
	char text[400];

	snprintf(text, sizeof(text), "drop %.*s: %.*s is %.*s in its table, the archive has %.*s",
	         number.length < SHOWN_MAX ? (int)number.length : SHOWN_MAX, number.at,
	         title.length < SHOWN_MAX ? (int)title.length : SHOWN_MAX, title.at,
	         was.length < SHOWN_MAX ? (int)was.length : SHOWN_MAX, was.at,
	         is.length < SHOWN_MAX ? (int)is.length : SHOWN_MAX, is.at);
	p->tell(p->context, text);
	p->wrong++;
}

static void hold_row(struct table_pair *p, struct piece number, struct piece was, struct piece is)
{
	struct piece title, a, b;

	for (size_t i = 0; cell_of(p->head[0], i, &title) && cell_of(was, i, &a); i++)
		if (!is_same_text(title, named("note")) && cell_named(p->head[1], is, title, &b) &&
		    !is_same_text(a, b))
			tell_cell(p, number, title, a, b);
}

static bool find_row(const struct table_pair *p, struct piece number, struct piece *row)
{
	const char *at = p->rows[1];
	struct piece other;

	while (take_line(&at, row))
		if (cell_named(p->head[1], *row, named("number"), &other) && is_same_text(number, other))
			return true;
	return false;
}

int verify_data(const char *was, const char *is, void (*tell)(void *context, const char *text), void *context)
{
	struct table_pair p = {.rows = {was, is}, .tell = tell, .context = context};
	struct piece row, number, other;
	char text[100];

	for (int i = 0; i < 2; i++)
		if (!take_line(&p.rows[i], &p.head[i]) ||
		    !cell_named(p.head[i], p.head[i], named("number"), &number))
			return -1;
	for (const char *at = p.rows[0]; take_line(&at, &row);) {
		if (!cell_named(p.head[0], row, named("number"), &number))
			return -1;
		if (find_row(&p, number, &other)) {
			hold_row(&p, number, row, other);
			continue;
		}
		snprintf(text, sizeof(text), "drop %.*s of its table is not in the archive",
		         number.length < SHOWN_MAX ? (int)number.length : SHOWN_MAX, number.at);
		tell(context, text);
		p.wrong++;
	}
	return p.wrong;
}
