/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/shock/limit.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/base/number.h"
#include "host/record/source.h"

#define SPECTRUM_NAMES "frequency_hz,limit"
#define BAND_NAMES "time_s,lower_g,upper_g"

enum { NUMBERS_MAX = 3, POINTS_FIRST = 64 };

static bool is_separator(char c)
{
	return c == ',' || c == ';' || c == '\t' || c == ' ';
}

/* The numbers of a line: how many words there are, and whether each of the first NUMBERS_MAX is a number. */
static size_t limit_split(const struct source_line *line, double number[NUMBERS_MAX], bool *numbers)
{
	size_t i = 0, words = 0;

	*numbers = true;
	for (;;) {
		size_t from;

		while (i < line->length && is_separator(line->text[i]))
			i++;
		if (i == line->length)
			return words;
		from = i;
		while (i < line->length && !is_separator(line->text[i]))
			i++;
		if (words < NUMBERS_MAX && !number_parse(line->text + from, i - from, '.', &number[words]))
			*numbers = false;
		words++;
	}
}

static int limit_append(struct limit_curve *curve, size_t *room, struct limit_point point)
{
	if (curve->count == *room) {
		size_t more = *room > 0 ? 2 * *room : POINTS_FIRST;
		struct limit_point *grown = realloc(curve->point, more * sizeof(*grown));

		if (!grown)
			return DT_E_MEMORY;
		curve->point = grown;
		*room = more;
	}
	curve->point[curve->count++] = point;
	return 0;
}

/* Why the point cannot follow those before it; NULL when it can. */
static const char *objection(const struct limit_curve *curve, enum limit_kind kind, struct limit_point point)
{
	if (curve->count > 0 && !(point.x > curve->point[curve->count - 1].x))
		return kind == LIMIT_SPECTRUM ? "frequency does not increase" : "time does not increase";
	if (kind == LIMIT_SPECTRUM && !(point.x > 0))
		return "frequency is not above 0";
	if (kind == LIMIT_SPECTRUM && !(point.upper > 0))
		return "limit is not above 0";
	if (kind == LIMIT_BAND && !(point.upper >= point.lower))
		return "upper is below lower";
	return NULL;
}

static int read_points(struct limit_curve *curve, const struct source *source, enum limit_kind kind,
                       char message[READ_MESSAGE_MAX])
{
	size_t columns = kind == LIMIT_SPECTRUM ? 2 : 3, room = 0;
	const char *names = kind == LIMIT_SPECTRUM ? SPECTRUM_NAMES : BAND_NAMES;
	struct source_line line = {0};
	bool first = true;

	while (source_next_line(source, &line)) {
		double number[NUMBERS_MAX] = {NAN};
		struct limit_point point;
		const char *why;
		bool numbers, header;
		size_t words = limit_split(&line, number, &numbers);

		if (words == 0 || line.text[0] == '#')
			continue;
		header = first && isnan(number[0]);
		first = false;
		if (header)
			continue;
		if (words != columns || !numbers)
			return source_refuse(message, DT_E_FORMAT, source->file, line.number,
			                     "not a point of the curve, expected the %zu numbers %s", columns,
			                     names);
		point = (struct limit_point){number[0], kind == LIMIT_SPECTRUM ? 0 : number[1],
		                             number[columns - 1]};
		why = objection(curve, kind, point);
		if (why)
			return source_refuse(message, DT_E_FORMAT, source->file, line.number,
			                     "%s, expected %s", why, names);
		if (limit_append(curve, &room, point) != 0)
			return source_refuse(message, DT_E_MEMORY, source->file, line.number, "%s",
			                     error_text(DT_E_MEMORY));
	}
	if (curve->count < 2)
		return source_refuse(message, DT_E_FORMAT, source->file, 0,
		                     "%zu points, expected 2 or more of %s", curve->count, names);
	return 0;
}

int limit_read(struct limit_curve *curve, const char *file, enum limit_kind kind,
               char message[READ_MESSAGE_MAX])
{
	static const char *const expected[] = {
	        [LIMIT_SPECTRUM] = "a limit curve of lines " SPECTRUM_NAMES,
	        [LIMIT_BAND] = "a tolerance band of lines " BAND_NAMES,
	};
	struct limit_curve read = {0};
	struct source source;
	int result = source_load(&source, file, expected[kind], message);

	if (result != 0)
		return result;
	result = read_points(&read, &source, kind, message);
	source_free(&source);
	if (result != 0)
		limit_free(&read);
	else
		*curve = read;
	return result;
}

void limit_free(struct limit_curve *curve)
{
	free(curve->point);
	curve->point = NULL;
	curve->count = 0;
}

bool limit_at(const struct limit_curve *curve, enum limit_kind kind, double x, struct limit_point *at)
{
	size_t i = 1;
	const struct limit_point *a, *b;
	double part;

	/* The ends may have been written with fewer digits than the result has. */
	if (!(x >= curve->point[0].x - 1e-9 * fabs(curve->point[0].x)) ||
	    !(x <= curve->point[curve->count - 1].x + 1e-9 * fabs(curve->point[curve->count - 1].x)))
		return false;
	while (i + 1 < curve->count && x > curve->point[i].x)
		i++;
	a = &curve->point[i - 1];
	b = &curve->point[i];
	at->x = x;
	if (kind == LIMIT_SPECTRUM) {
		part = log(x / a->x) / log(b->x / a->x);
		at->upper = a->upper * exp(part * log(b->upper / a->upper));
		at->lower = a->lower > 0 ? a->lower * exp(part * log(b->lower / a->lower)) : 0;
		return true;
	}
	part = (x - a->x) / (b->x - a->x);
	at->lower = a->lower + part * (b->lower - a->lower);
	at->upper = a->upper + part * (b->upper - a->upper);
	return true;
}

static void limit_judge(struct limit_verdict *verdict, double margin, double x)
{
	verdict->checked++;
	if (!(margin >= verdict->margin)) {
		verdict->margin = margin;
		verdict->margin_x = x;
	}
	if (margin < 0 && isnan(verdict->first_x))
		verdict->first_x = x;
}

static struct limit_verdict verdict_begin(void)
{
	return (struct limit_verdict){.margin = INFINITY, .margin_x = NAN, .first_x = NAN};
}

static struct limit_verdict verdict_end(struct limit_verdict verdict)
{
	verdict.pass = verdict.checked > 0 && isnan(verdict.first_x);
	if (verdict.checked == 0)
		verdict.margin = NAN;
	return verdict;
}

struct limit_verdict limit_spectrum(const struct limit_curve *curve, const double *frequency_hz,
                                    const double *value, size_t count)
{
	struct limit_verdict verdict = verdict_begin();
	struct limit_point at;

	for (size_t i = 0; i < count; i++)
		if (limit_at(curve, LIMIT_SPECTRUM, frequency_hz[i], &at))
			limit_judge(&verdict, 20 * log10(at.upper / value[i]), frequency_hz[i]);
	return verdict_end(verdict);
}

struct limit_verdict limit_pulse(const struct limit_curve *curve, const struct trace *trace, double zero_s)
{
	struct limit_verdict verdict = verdict_begin();
	struct limit_point at;

	for (size_t k = 0; k < trace->count; k++) {
		double x = trace_time(trace, k) - zero_s, value = trace->value_g[k];

		if (!limit_at(curve, LIMIT_BAND, x, &at))
			continue;
		if (trace_good(trace, k))
			limit_judge(&verdict, fmin(at.upper - value, value - at.lower), x);
		else
			verdict.missing++;
	}
	return verdict_end(verdict);
}
