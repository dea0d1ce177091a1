/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Universal files, dataset 58 in ASCII: functions at nodes, of which the accelerations over time are taken.
 * README.md tells how our own say more than the dataset has fields for.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/base/number.h"
#include "host/base/mapped.h"
#include "host/record/drop.h"
#include "host/record/metadata.h"
#include "host/record/seal.h"
#include "host/record/timebase.h"
#include "host/record/uff58_text.h"
#include "host/record/unit.h"

struct reading {
	struct uff58_text text;
	struct record *record;
	bool foreign;                 /* some channel is not ours */
	size_t samples;               /* announced */
	uint64_t line[DROP_CHANNELS]; /* of the first samples of each of the first channels */
};

/* ---- channels ---- */

/* Number in the file times this is g; 0 for a unit that is none of acceleration. */
static double unit_factor_g(const char *text)
{
	const struct unit *unit = unit_find(text, strlen(text));

	return unit && unit->kind == UNIT_ACCELERATION && unit->divisor >= 1 ? 1 / unit->divisor : 0;
}

static bool can_be(const struct reading *reading, const char *name)
{
	return name[0] && strcmp(name, "NONE") != 0 && !record_channel(reading->record, name);
}

/* The description if it can be a name, else node and direction, else the channel's number. */
static void name_channel(const struct reading *reading, const struct uff58_head *head, char name[32])
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

static int read_uff58_check_channel(struct reading *reading, const struct uff58_head *head, size_t least)
{
	struct source_line at = reading->text.line;
	int error = 0;

	reading->text.line.number = head->line + 6; /* record 7 */
	if (head->precision != UFF58_SINGLE && head->precision != UFF58_DOUBLE)
		error = UFF58_REFUSE(&reading->text, DT_E_FORMAT,
		                     "\"%.32s\" has data of type %d, expected 2 or 4 (real)", head->id[0],
		                     head->precision);
	else if (head->even && !(head->step > 0))
		error = UFF58_REFUSE(&reading->text, DT_E_FORMAT,
		                     "\"%.32s\" has a step of %g, expected more than 0", head->id[0],
		                     head->step);
	/* a number takes so many bytes at least: this bounds the memory */
	else if (head->count < 2 || head->count > (reading->text.source->size - reading->samples) / least)
		error = UFF58_REFUSE(&reading->text, DT_E_FORMAT,
		                     "\"%.32s\" has %zu samples, expected 2 to what the file holds",
		                     head->id[0], head->count);
	reading->text.line.number = head->line + 7; /* record 8 */
	if (!error && unit_seconds(head->time_unit) == 0)
		error = UFF58_REFUSE(&reading->text, DT_E_FORMAT,
		                     "the abscissa of \"%.32s\" is in \"%s\", expected s", head->id[0],
		                     head->time_unit);
	reading->text.line.number = head->line + 8; /* record 9 */
	if (!error && unit_factor_g(head->unit) == 0)
		error = UFF58_REFUSE(&reading->text, DT_E_FORMAT,
		                     "\"%.32s\" is in \"%s\", expected g or m/s^2", head->id[0], head->unit);
	reading->text.line = at;
	return error;
}

static void settle_samples(struct channel *channel, double factor)
{
	for (size_t k = 0; k < channel->count; k++) {
		channel->value_g[k] *= factor;
		channel->sample[k] = isfinite(channel->value_g[k]) ? 0 : SAMPLE_BAD;
		record_seen(k, sizeof(double) + 1);
	}
}

/* Times stand in six digits. */
static int settle_times(struct reading *reading, const struct uff58_head *head, uint64_t line,
                        struct channel *channel, const double *time_s)
{
	double largest = fmax(fabs(time_s[0]), fabs(time_s[channel->count - 1]));
	size_t pairs = head->precision == UFF58_DOUBLE ? 2 : 3;
	struct timebase timebase;
	struct timebase_fault fault;
	int error = timebase_find(time_s, channel->count, pow(10, floor(log10(largest)) - 5), 0, &timebase,
	                          &fault);

	if (error == DT_E_FORMAT)
		return source_refuse(reading->text.message, error, reading->text.source->file,
		                     line + fault.row / pairs, "\"%.32s\": %s", head->id[0], fault.why);
	if (!error) {
		channel->rate_hz = 1 / timebase.step_s;
		channel->start_s = time_s[0];
		channel->flags |= timebase.uneven ? RECORD_FLAG_UNEVEN : 0;
		error = timebase_spread(&timebase, channel);
		timebase_free(&timebase);
	}
	return error ? UFF58_REFUSE(&reading->text, error, "%s", error_text(error)) : 0;
}

static int read_uff58_channel(struct reading *reading, const struct uff58_head *head,
                              const struct uff58_binary *binary)
{
	struct channel *channel;
	double *time_s = NULL;
	int error = read_uff58_check_channel(reading, head, binary != NULL ? 4 : 13);
	double unit_s;
	uint64_t line;
	char name[32];

	if (error)
		return error;
	unit_s = unit_seconds(head->time_unit);
	reading->samples += head->count;
	name_channel(reading, head, name);
	channel = record_add_channel(reading->record, name, head->even ? 1 / (head->step * unit_s) : 1,
	                             head->count);
	if (!channel)
		return UFF58_REFUSE(&reading->text, DT_E_MEMORY, "%s", error_text(DT_E_MEMORY));
	channel->start_s = head->start * unit_s;
	if (!head->even)
		time_s = mapped_array(head->count, sizeof(*time_s));
	if (!head->even && !time_s)
		return UFF58_REFUSE(&reading->text, DT_E_MEMORY, "%s", error_text(DT_E_MEMORY));
	line = reading->text.line.number + 1;
	if (reading->record->channel_count <= DROP_CHANNELS)
		reading->line[reading->record->channel_count - 1] = line;
	error = binary != NULL ? uff58_read_bytes(&reading->text, head, binary, channel->value_g)
	                       : uff58_read_data(&reading->text, head, channel->value_g, time_s);
	if (!error)
		settle_samples(channel, unit_factor_g(head->unit));
	for (size_t k = 0; !error && time_s && k < head->count; k++) {
		time_s[k] *= unit_s;
		record_seen(k, sizeof(double));
	}
	if (!error && time_s)
		error = settle_times(reading, head, line, channel, time_s);
	mapped_free(time_s);
	return error;
}

/* ---- what our own say beside ---- */

/* "operator=Ann Smith", alone in its line. */
static int read_words(struct reading *reading, const char *line)
{
	const char *value = strchr(line, '=');
	const struct metadata_entry *entry;
	char name[32];

	if (strcmp(line, "NONE") == 0)
		return 0;
	snprintf(name, sizeof(name), "%.*s", (int)(value ? value - line : 0), line);
	entry = metadata_find(name);
	if (!entry || entry->kind != METADATA_TEXT || metadata_parse(reading->record, entry, value + 1) != 0)
		return UFF58_REFUSE(&reading->text, DT_E_FORMAT,
		                    "identification \"%.80s\", expected NONE or name=words", line);
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
		const struct metadata_entry *entry;

		if (value)
			*value++ = '\0';
		entry = value ? metadata_find(word) : NULL;
		if (!entry || metadata_parse(reading->record, entry, value) != 0)
			return UFF58_REFUSE(&reading->text, DT_E_FORMAT,
			                    "identification \"%.80s\", expected name=value words", line);
	}
	return 0;
}

static int read_own_channel(struct reading *reading, const struct uff58_head *head)
{
	struct channel *channel = &reading->record->channels[reading->record->channel_count - 1];
	double rate_hz, start_s, range_g;
	int uneven, error, end = 0, end_2 = 0;

	if (sscanf(head->id[1], UFF58_OWN "rate_hz=%lf start_s=%lf%n", &rate_hz, &start_s, &end) != 2 ||
	    head->id[1][end] ||
	    sscanf(head->id[3], "range_g=%lf uneven=%d%n", &range_g, &uneven, &end_2) != 2 ||
	    head->id[3][end_2] || !(rate_hz > 0) || !isfinite(1 / rate_hz) || !isfinite(start_s) ||
	    !isfinite(range_g))
		return UFF58_REFUSE(&reading->text, DT_E_FORMAT,
		                    "dataset of \"%.32s\", expected identification \"" UFF58_OWN
		                    "rate_hz= start_s=\" and \"range_g= uneven=\"",
		                    head->id[0]);
	channel->rate_hz = rate_hz;
	channel->start_s = start_s;
	channel->range_g = range_g;
	channel->flags = uneven ? RECORD_FLAG_UNEVEN : 0;
	error = read_words(reading, head->id[2]);
	if (error != 0 || strncmp(head->id[4], SEAL_WORD, strlen(SEAL_WORD)) == 0)
		return error;
	return read_fields(reading, head->id[4]);
}

/* The line of sample k of one of the first channels of ours; 0 of another. */
static uint64_t read_uff58_line_of(const struct reading *reading, const struct channel *channel, size_t k)
{
	size_t i = (size_t)(channel - reading->record->channels);

	return i < DROP_CHANNELS ? reading->line[i] + k / UFF58_DOUBLES : 0;
}

/* A field that is no number is no good sample, whatever its mask says. */
static int check_good(const struct reading *reading, const struct channel *channel)
{
	for (size_t k = 0; k < channel->count; k++) {
		record_seen(k, sizeof(double) + 1);
		if (!isfinite(channel->value_g[k]) && !(channel->sample[k] & (SAMPLE_LOST | SAMPLE_BAD)))
			return source_refuse(reading->text.message, DT_E_FORMAT, reading->text.source->file,
			                     read_uff58_line_of(reading, channel, k),
			                     "sample %zu of %s is no number and its mask calls it good, "
			                     "expected a number",
			                     k + 1, channel->name);
	}
	return 0;
}

/* The samples of a drop are counts. */
static int check_sample(const struct reading *reading, const struct channel *channel, size_t k)
{
	double value_g = channel->value_g[k];

	if (isfinite(value_g) && !drop_is_count(value_g))
		return source_refuse(reading->text.message, DT_E_FORMAT, reading->text.source->file,
		                     read_uff58_line_of(reading, channel, k),
		                     "%.15g g for %s, expected a whole count of 1/32 g within full scale",
		                     value_g, channel->name);
	if ((channel->sample[k] & SAMPLE_CLIPPED) != drop_mark(channel, value_g))
		return source_refuse(
		        reading->text.message, DT_E_FORMAT, reading->text.source->file,
		        read_uff58_line_of(reading, channel, k),
		        "%.15g g for %s has the mask %u, expected 4 beyond %g g and nowhere else", value_g,
		        channel->name, channel->sample[k], channel->range_g);
	return 0;
}

static int read_uff58_check_samples(const struct reading *reading)
{
	int error = 0;

	for (size_t i = 0; i < reading->record->channel_count; i++)
		for (size_t k = 0; k < reading->record->channels[i].count && !error; k++)
			error = check_sample(reading, &reading->record->channels[i], k);
	return error;
}

static int read_mask(struct reading *reading, const struct uff58_head *head)
{
	struct record *record = reading->record;
	struct channel *channel = record->channel_count ? &record->channels[record->channel_count - 1] : NULL;
	double *mask;
	int error;

	if (!channel || strcmp(channel->name, head->id[0]) != 0 || channel->count != head->count ||
	    head->precision != UFF58_SINGLE || !head->even)
		return UFF58_REFUSE(&reading->text, DT_E_FORMAT,
		                    "mask of \"%.32s\", expected it behind its channel, as long",
		                    head->id[0]);
	mask = mapped_array(head->count, sizeof(*mask));
	if (!mask)
		return UFF58_REFUSE(&reading->text, DT_E_MEMORY, "%s", error_text(DT_E_MEMORY));
	error = uff58_read_data(&reading->text, head, mask, NULL);
	for (size_t k = 0; k < head->count && !error; k++) {
		if (!(mask[k] >= 0 && mask[k] <= UFF58_MASK && mask[k] == trunc(mask[k])))
			error = UFF58_REFUSE(&reading->text, DT_E_FORMAT,
			                     "mask %g, expected a whole number from 0 to %d", mask[k],
			                     UFF58_MASK);
		else
			channel->sample[k] = (uint8_t)mask[k];
		if (channel->sample[k] & (SAMPLE_LOST | SAMPLE_BAD))
			channel->value_g[k] = NAN;
		record_seen(k, 2 * sizeof(double) + 1);
	}
	mapped_free(mask);
	if (!error)
		error = check_good(reading, channel);
	for (int line = 2; line < UFF58_ID_LINES && !error; line++)
		error = read_fields(reading, head->id[line]);
	return error;
}

/* ---- the file ---- */

/* Programs also call an acceleration general, and tell it by its unit. */
static bool is_acceleration(const struct uff58_head *head)
{
	return head->function == UFF58_TIME_RESPONSE &&
	       (head->quantity == UFF58_ACCELERATION || head->quantity == UFF58_UNKNOWN ||
	        (head->quantity == UFF58_GENERAL && unit_factor_g(head->unit) > 0));
}

static int read_dataset(struct reading *reading, const struct uff58_binary *binary)
{
	struct uff58_head head = {.function = 0};
	int error = uff58_read_head(&reading->text, &head);
	bool own = binary == NULL && strncmp(head.id[1], UFF58_OWN, strlen(UFF58_OWN)) == 0;
	size_t data = reading->text.line.next;

	if (error)
		return error;
	if (own && head.function == UFF58_UNKNOWN) {
		error = read_mask(reading, &head);
	} else if (is_acceleration(&head)) {
		error = read_uff58_channel(reading, &head, binary);
		if (!error && own)
			error = read_own_channel(reading, &head);
		reading->foreign |= !own;
	}
	if (binary != NULL)
		uff58_skip_bytes(&reading->text, data, binary);
	return error ? error : uff58_skip_dataset(&reading->text);
}

static int read_uff58_all(struct reading *reading)
{
	char number[16];
	int error = 0;

	while (!error && source_next_line(reading->text.source, &reading->text.line)) {
		uff58_take(&reading->text.line, 0, reading->text.line.length, number, sizeof(number));
		if (number[0] == '\0')
			continue;
		if (!uff58_is_delimiter(&reading->text.line))
			return UFF58_REFUSE(&reading->text, DT_E_FORMAT,
			                    "\"%s\" between datasets, expected -1", number);
		error = uff58_next_line(&reading->text, "the number of a dataset");
		if (error)
			return error;
		uff58_take(&reading->text.line, 0, reading->text.line.length, number, sizeof(number));
		if (strncmp(number, "58b", 3) == 0) {
			struct uff58_binary binary;

			error = uff58_read_binary(&reading->text, &binary);
			if (!error)
				error = read_dataset(reading, &binary);
		} else {
			error = strcmp(number, "58") == 0 ? read_dataset(reading, NULL)
			                                  : uff58_skip_dataset(&reading->text);
		}
	}
	if (!error && reading->record->channel_count == 0)
		return UFF58_REFUSE(&reading->text, DT_E_FORMAT,
		                    "no acceleration over time, expected a dataset 58 of function type 1");
	return error;
}

static int read_uff58_finish(struct reading *reading)
{
	struct record *record = reading->record;
	int error;

	if (reading->foreign)
		record_begin_at_zero(record);
	if (!record->is_drop) {
		record_finish(record);
		return 0;
	}
	error = drop_check(record);
	if (error)
		return source_refuse(
		        reading->text.message, error, reading->text.source->file, 0,
		        "channels are not those of a drop of these ticks, expected S1X to S2Z with "
		        "7 and 10 samples a tick and a range of %g g",
		        drop_range_g(record));
	error = read_uff58_check_samples(reading);
	if (error)
		return error;
	error = drop_close(record);
	return error ? source_refuse(reading->text.message, error, reading->text.source->file, 0, "%s",
	                             error_text(error))
	             : 0;
}

int read_uff58(struct record *record, const struct source *source, char message[READ_MESSAGE_MAX])
{
	struct record filled;
	struct reading reading = {.text = {.source = source, .message = message}, .record = &filled};
	int error;

	record_init(&filled);
	error = read_uff58_all(&reading);
	if (!error)
		error = read_uff58_finish(&reading);
	if (error) {
		record_free(&filled);
		return error;
	}
	strcpy(filled.format, "uff58");
	*record = filled;
	return 0;
}
