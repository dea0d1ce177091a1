/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_REPORT_PAGE_H
#define DT_HOST_REPORT_PAGE_H
/*
 * HTML pages while they are written: what the page of a drop (html.c, page_*.c) and that of a series
 * (series*.c) share.
 */
#include "host/base/html.h"
#include "common/base/text.h"
#include "host/report/facts.h"
#include "host/report/language.h"

/* page_open, write to out, page_close in any case. What is written stays in memory until all pictures can be
 * drawn. */
struct page {
	FILE *out;                             /* of the body */
	FILE *whole;                           /* where all of it goes in the end */
	struct text body, scripts;             /* page_draw's, one behind the other */
	size_t *picture_at;                    /* places in the body where they come in */
	const struct report *report;           /* of a drop; NULL: of a series */
	const struct translation *translation; /* NULL: English */
	struct report_zero zero;               /* of the report */
	size_t pictures;
	int error; /* DT_E_* of what failed first, its line in message */
	char *message;
	size_t size;
};

/* A row of model against measured: up to the measured value's cell, which is open, and from its end on;
 * simpler: with how far the next simpler model is from this one, under PAGE_SIMPLER. */
#define PAGE_SIMPLER "<th>next simpler model</th>"
void page_begin_compared(FILE *out, const struct report_row *row);
void page_end_compared(FILE *out, const struct report_row *row, bool simpler);

/* "S1X" as "S1 X"; other names as they are. */
void page_channel_name(FILE *out, const char *name);

/* Of what a note or remark is, as "acc 1 peak": the channel's name is the user's. */
void page_note_subject(FILE *out, const char *of);

/* Colours, type, tables and pictures of every page. */
extern const char page_style[];

/* From the doctype to the title as heading; more: style beside page_style. */
void page_begin(FILE *out, const char *title, const char *more);

/* Where limits come from, and what the uncertainties hold. */
void page_limits_by(FILE *out, const struct verdict *verdict);

/* What wrote it, and the end; version NULL: not said. A footer is open. */
void page_end(FILE *out, const char *version);

/* A figure that stands out: label, then a value is written, then unit and note. */
void page_begin_card(FILE *out, const char *label);
void page_end_card(FILE *out, const char *unit, const char *note);

/* 0 or DT_E_MEMORY, with nothing to close. Sets out; what the caller gave of the rest stays. */
DT_MUST_USE int page_open(struct page *page, FILE *out);

/* Draws the pictures and writes the page: 0, DT_E_MEMORY, DT_E_SYSTEM of a picture, or the page's error. */
DT_MUST_USE int page_close(struct page *page);

/* Opens a gnuplot script; false, with the page's error set, without memory or after an earlier error. */
bool page_begin_script(struct page *page, struct text *script);

/* Closes and frees it; its picture comes in here. drawn: whether there is something to see. */
void page_draw(struct page *page, struct text *script, bool drawn, const char *label);

/* The sections of a drop that are pictures, and those that are tables. */
void page_pictures(struct page *page);
void page_tables(struct page *page);

#endif
