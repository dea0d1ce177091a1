/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Universal files, dataset 58 in ASCII: functions at nodes, of which the accelerations over time are taken.
 * Fields stand in fixed columns. README.md tells how our own say more than the dataset has fields for.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "common/units.h"
#include "host/record/drop.h"
#include "host/record/fields.h"
#include "host/record/number.h"
#include "host/record/source.h"
#include "host/record/uff58.h"

enum { ID_LINES = 5 };

/* The head of one dataset. */
struct head {
	uint64_t line; /* of the first identification */
	char id[ID_LINES][UFF58_ID_CHARS + 1];
	int function, node, direction; /* record 6 */
	int precision;                 /* record 7 */
	size_t count;
	bool even;
	double start_s, step_s;
	int quantity; /* record 9 */
	char unit[21];
};

struct reading {
	const struct source *source;
	struct source_line line;
	char *message;
	struct record *record;
	bool foreign;   /* some channel is not ours */
	size_t samples; /* announced */
};

#define REFUSE(reading, code, ...) \
	source_refuse((reading)->message, code, (reading)->source->file, (reading)->line.number, __VA_ARGS__)

/* ---- columns ---- */

/* The characters of a field without the blanks around it; "" where the line has ended. */
static void take(const struct source_line *line, size_t first, size_t width, char *text, size_t size)
{
	size_t end = first + width < line->length ? first + width : line->length;
	size_t length;

	while (first < end && line->text[first] == ' ')
		first++;
	while (end > first && line->text[end - 1] == ' ')
		end--;
	length = end > first ? end - first : 0;
	if (length >= size)
		length = size - 1;
	memcpy(text, line->text + (length ? first : 0), length);
	text[length] = '\0';
}

static bool take_number(const struct source_line *line, size_t first, size_t width, double *value)
{
	char text[32];

	take(line, first, width, text, sizeof(text));
	for (char *p = text; *p; p++)
		if (*p == 'D' || *p == 'd') /* Fortran's double precision */
			*p = 'E';
	return number_parse(text, strlen(text), '.', value);
}

/* A field left blank is 0, as in Fortran. */
static bool take_whole(const struct source_line *line, size_t first, size_t width, int *value)
{
	double number = 0;
	char text[32];

	take(line, first, width, text, sizeof(text));
	if (text[0] && !number_parse(text, strlen(text), '.', &number))
		return false;
	if (fabs(number) > 2147483647.0 || number != trunc(number))
		return false;
	*value = (int)number;
	return true;
}

static bool is_delimiter(const struct source_line *line)
{
	char text[8];

	take(line, 0, line->length, text, sizeof(text));
	return strcmp(text, "-1") == 0;
}

static int next_line(struct reading *reading, const char *what)
{
	if (source_next_line(reading->source, &reading->line))
		return 0;
	return REFUSE(reading, DT_E_FORMAT, "the file ends, expected %s", what);
}

static int skip_dataset(struct reading *reading)
{
	while (source_next_line(reading->source, &reading->line))
		if (is_delimiter(&reading->line))
			return 0;
	return REFUSE(reading, DT_E_FORMAT, "the file ends inside a dataset, expected a line with -1");
}

/* ---- the head ---- */

/* Format(2(I5,I10),2(1X,10A1,I10,I4)) */
static int read_record_6(struct reading *reading, struct head *head)
{
	int error = next_line(reading, "record 6");

	if (error)
		return error;
	if (!take_whole(&reading->line, 0, 5, &head->function) ||
	    !take_whole(&reading->line, 41, 10, &head->node) ||
	    !take_whole(&reading->line, 51, 4, &head->direction))
		return REFUSE(reading, DT_E_FORMAT,
		              "record 6, expected whole numbers in columns 1-5, 42-51 and 52-55");
	return 0;
}

/* Format(3I10,3E13.5) */
static int read_record_7(struct reading *reading, struct head *head)
{
	int error = next_line(reading, "record 7"), count = 0, spacing = 0;

	if (error)
		return error;
	if (!take_whole(&reading->line, 0, 10, &head->precision) ||
	    !take_whole(&reading->line, 10, 10, &count) || !take_whole(&reading->line, 20, 10, &spacing) ||
	    !take_number(&reading->line, 30, 13, &head->start_s) ||
	    !take_number(&reading->line, 43, 13, &head->step_s) || count < 0)
		return REFUSE(reading, DT_E_FORMAT,
		              "record 7, expected three whole numbers in 10 columns each and two numbers in "
		              "13 columns each");
	head->count = (size_t)count;
	head->even = spacing == 1;
	return 0;
}

/* Records 8 to 11, of which the ordinate says what was measured: Format(I10,3I5,2(1X,20A1)) */
static int read_axes(struct reading *reading, struct head *head)
{
	for (int record = 8; record <= 11; record++) {
		int error = next_line(reading, "records 8 to 11");

		if (error)
			return error;
		if (record != 9)
			continue;
		if (!take_whole(&reading->line, 0, 10, &head->quantity))
			return REFUSE(reading, DT_E_FORMAT,
			              "record 9, expected a whole number in columns 1-10");
		take(&reading->line, 47, 20, head->unit, sizeof(head->unit));
	}
	return 0;
}

static int read_head(struct reading *reading, struct head *head)
{
	int error = 0;

	head->line = reading->line.number + 1;
	for (int i = 0; i < ID_LINES && !error; i++) {
		error = next_line(reading, "five lines of identification");
		if (!error)
			take(&reading->line, 0, UFF58_ID_CHARS, head->id[i], sizeof(head->id[i]));
	}
	if (!error)
		error = read_record_6(reading, head);
	if (!error)
		error = read_record_7(reading, head);
	return error ? error : read_axes(reading, head);
}

/* ---- the data ---- */

/* Fields of the data records, one after the other. */
struct cells {
	size_t per_line, next; /* numbers in a line, and the one to be read */
	size_t column;
};

static int next_cell(struct reading *reading, struct cells *cells, size_t width, double *value)
{
	char text[32];

	if (cells->next == cells->per_line) {
		int error = next_line(reading, "data");

		if (error)
			return error;
		cells->next = cells->column = 0;
	}
	take(&reading->line, cells->column, width, text, sizeof(text));
	if (text[0] == '\0' || is_delimiter(&reading->line))
		return REFUSE(reading, DT_E_FORMAT,
		              "fewer numbers than announced, expected one in columns %zu-%zu",
		              cells->column + 1, cells->column + width);
	if (!take_number(&reading->line, cells->column, width, value))
		*value = NAN;
	cells->column += width;
	cells->next++;
	return 0;
}

/* The place of a sample is its number; times only have to agree with it. */
static void settle_times(struct channel *channel, const double *time_s)
{
	double span_s = time_s[channel->count - 1] - time_s[0];
	double step_s = span_s / (double)(channel->count - 1);

	channel->rate_hz = 1 / step_s;
	channel->start_s = time_s[0];
	for (size_t k = 0; k < channel->count; k++)
		if (!(fabs(time_s[k] - time_s[0] - (double)k * step_s) <= 0.1 * step_s))
			channel->flags |= RECORD_FLAG_UNEVEN;
}

/* Values as they stand in the file; time_s only for uneven spacing, else NULL. */
static int read_data(struct reading *reading, const struct head *head, double *value, double *time_s)
{
	size_t width = head->precision == UFF58_DOUBLE ? 20 : 13;
	size_t pairs_per_line = head->precision == UFF58_DOUBLE ? 2 : 3;
	size_t per_line = time_s ? 2 * pairs_per_line : head->precision == UFF58_DOUBLE ? 4 : 6;
	struct cells cells = {.per_line = per_line, .next = per_line};
	int error = 0;

	for (size_t k = 0; k < head->count && !error; k++) {
		if (time_s)
			error = next_cell(reading, &cells, 13, &time_s[k]);
		if (!error)
			error = next_cell(reading, &cells, width, &value[k]);
		if (!error && time_s && !(isfinite(time_s[k]) && (k == 0 || time_s[k] > time_s[k - 1])))
			error = REFUSE(reading, DT_E_FORMAT, "time %g after %g, expected times that increase",
			               time_s[k], k ? time_s[k - 1] : 0.0);
	}
	return error;
}

/* ---- channels ---- */

/* Number in the file times this is g; 0 for a unit that is none of acceleration. */
static double unit_factor_g(const char *unit)
{
	static const char *const metric[] = {"m/s2", "m/s^2", "m/s**2", "m/s/s", "m/sec2", "m/sec^2"};

	if (strcasecmp(unit, "g") == 0)
		return 1;
	for (size_t i = 0; i < sizeof(metric) / sizeof(metric[0]); i++)
		if (strcasecmp(unit, metric[i]) == 0)
			return 1 / UNITS_G_M_S2;
	return 0;
}

static bool can_be(const struct reading *reading, const char *name)
{
	return name[0] && strcmp(name, "NONE") != 0 && !record_channel(reading->record, name);
}

/* The description if it can be a name, else node and direction, else the channel's number. */
static void name_channel(const struct reading *reading, const struct head *head, char name[32])
{
	static const char axes[] = "?XYZ";
	int axis = abs(head->direction);

	snprintf(name, 32, "%.31s", head->id[0]);
	for (char *p = name; *p; p++)
		if ((unsigned char)*p < ' ' || *p == ',')
			*p = ' ';
	if (!can_be(reading, name))
		snprintf(name, 32, "%d%c%s", head->node, axes[axis < 4 ? axis : 0],
		         head->direction < 0 ? "-" : "");
	if (!can_be(reading, name))
		snprintf(name, 32, "channel %zu", reading->record->channel_count + 1);
}

static int check_channel(struct reading *reading, const struct head *head)
{
	struct source_line at = reading->line;
	int error = 0;

	reading->line.number = head->line + 6; /* record 7 */
	if (head->precision != UFF58_SINGLE && head->precision != UFF58_DOUBLE)
		error = REFUSE(reading, DT_E_FORMAT, "\"%.32s\" has data of type %d, expected 2 or 4 (real)",
		               head->id[0], head->precision);
	else if (head->even && !(head->step_s > 0))
		error = REFUSE(reading, DT_E_FORMAT, "\"%.32s\" has a step of %g s, expected more than 0",
		               head->id[0], head->step_s);
	/* a number takes 13 bytes at least: this bounds the memory */
	else if (head->count < 2 || head->count > (reading->source->size - reading->samples) / 13)
		error = REFUSE(reading, DT_E_FORMAT,
		               "\"%.32s\" has %zu samples, expected 2 to what the file holds", head->id[0],
		               head->count);
	reading->line.number = head->line + 8; /* record 9 */
	if (!error && unit_factor_g(head->unit) == 0)
		error = REFUSE(reading, DT_E_FORMAT, "\"%.32s\" is in \"%s\", expected g or m/s^2",
		               head->id[0], head->unit);
	reading->line = at;
	return error;
}

static void settle_samples(struct channel *channel, double factor)
{
	for (size_t k = 0; k < channel->count; k++) {
		channel->value_g[k] *= factor;
		channel->sample[k] = isfinite(channel->value_g[k]) ? 0 : SAMPLE_BAD;
	}
}

static int read_channel(struct reading *reading, const struct head *head)
{
	struct channel *channel;
	double *time_s = NULL;
	int error = check_channel(reading, head);
	char name[32];

	if (error)
		return error;
	reading->samples += head->count;
	name_channel(reading, head, name);
	channel = record_add_channel(reading->record, name, head->even ? 1 / head->step_s : 1, head->count);
	if (!channel)
		return REFUSE(reading, DT_E_MEMORY, "%s", error_text(DT_E_MEMORY));
	channel->start_s = head->start_s;
	if (!head->even)
		time_s = malloc(head->count * sizeof(*time_s));
	if (!head->even && !time_s)
		return REFUSE(reading, DT_E_MEMORY, "%s", error_text(DT_E_MEMORY));
	error = read_data(reading, head, channel->value_g, time_s);
	if (!error) {
		settle_samples(channel, unit_factor_g(head->unit));
		if (time_s)
			settle_times(channel, time_s);
	}
	free(time_s);
	return error;
}

/* ---- what our own say beside ---- */

static int read_own_channel(struct reading *reading, const struct head *head)
{
	struct channel *channel = &reading->record->channels[reading->record->channel_count - 1];
	double rate_hz, start_s, range_g;
	int uneven, end = 0, end_2 = 0;

	if (sscanf(head->id[1], UFF58_OWN "rate_hz=%lf start_s=%lf%n", &rate_hz, &start_s, &end) != 2 ||
	    head->id[1][end] ||
	    sscanf(head->id[3], "range_g=%lf uneven=%d%n", &range_g, &uneven, &end_2) != 2 ||
	    head->id[3][end_2] || !(rate_hz > 0) || !isfinite(1 / rate_hz) || !isfinite(start_s) ||
	    !isfinite(range_g))
		return REFUSE(reading, DT_E_FORMAT,
		              "dataset of \"%.32s\", expected identification \"" UFF58_OWN
		              "rate_hz= start_s=\" and \"range_g= uneven=\"",
		              head->id[0]);
	channel->rate_hz = rate_hz;
	channel->start_s = start_s;
	channel->range_g = range_g;
	channel->flags = uneven ? RECORD_FLAG_UNEVEN : 0;
	return 0;
}

/* "drop_id=3 marks=8 ..." */
static int read_fields(struct reading *reading, const char *line)
{
	char text[UFF58_ID_CHARS + 1], *rest = text;

	if (strcmp(line, "NONE") == 0)
		return 0;
	strcpy(text, line);
	for (char *word = strtok_r(text, " ", &rest); word; word = strtok_r(NULL, " ", &rest)) {
		char *value = strchr(word, '=');
		const struct fields_entry *entry;
		double number;

		if (value)
			*value++ = '\0';
		entry = value ? fields_find(word) : NULL;
		if (!entry || !number_parse(value, strlen(value), '.', &number) ||
		    fields_set(reading->record, entry, number) != 0)
			return REFUSE(reading, DT_E_FORMAT,
			              "identification \"%.80s\", expected name=value words", line);
	}
	return 0;
}

static int read_mask(struct reading *reading, const struct head *head)
{
	struct record *record = reading->record;
	struct channel *channel = record->channel_count ? &record->channels[record->channel_count - 1] : NULL;
	double *mask;
	int error;

	if (!channel || strcmp(channel->name, head->id[0]) != 0 || channel->count != head->count ||
	    head->precision != UFF58_SINGLE || !head->even)
		return REFUSE(reading, DT_E_FORMAT,
		              "mask of \"%.32s\", expected it behind its channel, as long", head->id[0]);
	mask = malloc(head->count * sizeof(*mask));
	if (!mask)
		return REFUSE(reading, DT_E_MEMORY, "%s", error_text(DT_E_MEMORY));
	error = read_data(reading, head, mask, NULL);
	for (size_t k = 0; k < head->count && !error; k++) {
		if (!(mask[k] >= 0 && mask[k] <= UFF58_MASK && mask[k] == trunc(mask[k])))
			error = REFUSE(reading, DT_E_FORMAT, "mask %g, expected a whole number from 0 to %d",
			               mask[k], UFF58_MASK);
		else
			channel->sample[k] = (uint8_t)mask[k];
		if (channel->sample[k] & (SAMPLE_LOST | SAMPLE_BAD))
			channel->value_g[k] = NAN;
	}
	free(mask);
	if (!error)
		error = read_fields(reading, head->id[3]);
	return error ? error : read_fields(reading, head->id[4]);
}

/* ---- the file ---- */

static int read_dataset(struct reading *reading)
{
	struct head head = {.function = 0};
	int error = read_head(reading, &head);
	bool own = strncmp(head.id[1], UFF58_OWN, strlen(UFF58_OWN)) == 0;

	if (error)
		return error;
	if (own && head.function == UFF58_UNKNOWN) {
		error = read_mask(reading, &head);
	} else if (head.function == UFF58_TIME_RESPONSE &&
	           (head.quantity == UFF58_ACCELERATION || head.quantity == UFF58_UNKNOWN)) {
		error = read_channel(reading, &head);
		if (!error && own)
			error = read_own_channel(reading, &head);
		reading->foreign |= !own;
	}
	return error ? error : skip_dataset(reading);
}

static int read_all(struct reading *reading)
{
	char number[16];
	int error = 0;

	while (!error && source_next_line(reading->source, &reading->line)) {
		take(&reading->line, 0, reading->line.length, number, sizeof(number));
		if (number[0] == '\0')
			continue;
		if (!is_delimiter(&reading->line))
			return REFUSE(reading, DT_E_FORMAT, "\"%s\" between datasets, expected -1", number);
		error = next_line(reading, "the number of a dataset");
		if (error)
			return error;
		take(&reading->line, 0, reading->line.length, number, sizeof(number));
		if (strncmp(number, "58b", 3) == 0)
			return REFUSE(reading, DT_E_FORMAT, "dataset 58b is binary, expected ASCII (58)");
		error = strcmp(number, "58") == 0 ? read_dataset(reading) : skip_dataset(reading);
	}
	if (!error && reading->record->channel_count == 0)
		return REFUSE(reading, DT_E_FORMAT,
		              "no acceleration over time, expected a dataset 58 of function type 1");
	return error;
}

/* A record begins at 0, whenever a foreign clock began. */
static void shift(struct record *record)
{
	double first_s = INFINITY;

	for (size_t i = 0; i < record->channel_count; i++)
		first_s = fmin(first_s, record->channels[i].start_s);
	for (size_t i = 0; i < record->channel_count; i++)
		record->channels[i].start_s -= first_s;
}

static int finish(struct reading *reading)
{
	struct record *record = reading->record;
	int error;

	if (reading->foreign)
		shift(record);
	if (!record->is_drop) {
		record_finish(record);
		return 0;
	}
	error = drop_check(record);
	if (!error)
		error = drop_close(record);
	return error ? source_refuse(reading->message, error, reading->source->file, 0,
	                             "channels are not those of a drop of these ticks")
	             : 0;
}

bool uff58_is(const struct source *source)
{
	struct source_line line = {0};
	int number;

	return source_next_line(source, &line) && is_delimiter(&line) && line.length >= 6 &&
	       line.text[4] == '-' && source_next_line(source, &line) && line.length >= 6 &&
	       line.text[5] != ' ' && take_whole(&line, 0, 6, &number);
}

int read_uff58(struct record *record, const struct source *source, char message[READ_MESSAGE_MAX])
{
	struct record filled;
	struct reading reading = {.source = source, .message = message, .record = &filled};
	int error;

	record_init(&filled);
	error = read_all(&reading);
	if (!error)
		error = finish(&reading);
	if (error) {
		record_free(&filled);
		return error;
	}
	strcpy(filled.format, "uff58");
	*record = filled;
	return 0;
}
