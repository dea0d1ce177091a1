/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Recordings of enDAQ (ide.h) as columns: one for each subchannel, in its unit. The samples of a block lie
 * evenly between its times. The blocks of a channel follow each other on one grid; what is missing between
 * two of them are samples that were lost. A channel of accelerations whose blocks overlap, change their rate
 * or leave the grid, and one whose calibration cannot be applied, is refused; any other is left out, and
 * told.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/base/mapped.h"
#include "host/record/ide.h"
#include "host/record/unit.h"

/* A tick is what a time is rounded to. */
static const double TICKS = 1.01, STEP_PART = 0.1, RATE_PART = 1e-3, DRIFT = 2e-4;
enum { PAUSES_MOST = 16, PLACES_FEW = 1 << 20 };

/* ---- the grid of a channel ---- */

struct grid {
	double first, step; /* ticks */
	size_t *place;      /* [blocks], of the first sample */
	size_t places;
	bool uneven;
};

static int by_value(const void *a, const void *b)
{
	double one = *(const double *)a, other = *(const double *)b;

	return (one > other) - (one < other);
}

/* Ticks from sample to sample: as told, else the median of the blocks, of one that does not tell its end up
 * to the next. */
static const char *find_step(const struct ide_channel *channel, double *step, int *error)
{
	double *steps = calloc(channel->blocks, sizeof(*steps));
	size_t count = 0;

	if (steps == NULL) {
		*error = DT_E_MEMORY;
		return NULL;
	}
	for (size_t b = 0; b < channel->blocks; b++) {
		const struct ide_block *block = &channel->block[b];

		if (block->samples > 1 && block->last > block->first)
			steps[count++] = (block->last - block->first) / (double)(block->samples - 1);
		else if (b + 1 < channel->blocks && block[1].first > block->first)
			steps[count++] = (block[1].first - block->first) / (double)block->samples;
	}
	qsort(steps, count, sizeof(*steps), by_value);
	*step = count > 0 ? steps[count / 2] : 0;
	free(steps);
	if (channel->rate_hz > 0) {
		double told = 1 / (channel->rate_hz * channel->tick_s);

		if (*step > 0 && fabs(*step / told - 1) > 0.01 && fabs(*step - told) > TICKS)
			return "whose blocks have another rate than it tells";
		*step = told;
	}
	return *step > 0 ? NULL : "whose rate cannot be told from its blocks";
}

static double end_of(const struct ide_block *block, double step)
{
	return isnan(block->last) ? block->first + (double)(block->samples - 1) * step : block->last;
}

/* Each block behind the one before; a pause is so many samples as fit. */
static const char *place_blocks(const struct ide_channel *channel, struct grid *grid)
{
	double samples = (double)channel->block[0].samples, places = samples;

	for (size_t b = 1; b < channel->blocks; b++) {
		const struct ide_block *block = &channel->block[b];
		double pause = block->first - end_of(block - 1, grid->step), lost = 0;

		if (pause < 0.5 * grid->step - TICKS)
			return "whose blocks overlap";
		if (pause > fmax(grid->step + TICKS, 1.5 * grid->step))
			lost = round(pause / grid->step) - 1;
		samples += (double)block->samples;
		if (places + lost > PAUSES_MOST * samples + PLACES_FEW)
			return "with pauses much longer than what was recorded";
		grid->place[b] = (size_t)(places + lost);
		places += lost + (double)block->samples;
	}
	grid->places = (size_t)places;
	return NULL;
}

/* The straight line through the times of the blocks' ends. */
static void fit_line(const struct ide_channel *channel, struct grid *grid)
{
	double n = 0, place = 0, time = 0, square = 0, product = 0;

	for (size_t b = 0; b < 2 * channel->blocks; b++) {
		const struct ide_block *block = &channel->block[b / 2];

		place += (double)(grid->place[b / 2] + (b % 2) * (block->samples - 1));
		time += b % 2 ? end_of(block, grid->step) : block->first;
		n++;
	}
	place /= n;
	time /= n;
	for (size_t b = 0; b < 2 * channel->blocks; b++) {
		const struct ide_block *block = &channel->block[b / 2];
		double x = (double)(grid->place[b / 2] + (b % 2) * (block->samples - 1)) - place;

		square += x * x;
		product += x * ((b % 2 ? end_of(block, grid->step) : block->first) - time);
	}
	if (square > 0)
		grid->step = product / square;
	grid->first = time - place * grid->step;
}

static const char *check_line(const struct ide_channel *channel, struct grid *grid)
{
	double largest = 0;

	for (size_t b = 0; b < channel->blocks; b++) {
		const struct ide_block *block = &channel->block[b];
		double at = grid->first + (double)grid->place[b] * grid->step,
		       length = (double)(block->samples - 1) * grid->step;

		if (fabs(end_of(block, grid->step) - block->first - length) > 2 * TICKS + RATE_PART * length)
			return "whose blocks have different rates";
		largest = fmax(largest, fabs(block->first - at));
		largest = fmax(largest, fabs(end_of(block, grid->step) - at - length));
	}
	grid->uneven = largest > fmax(STEP_PART * grid->step, TICKS);
	if (largest > fmax(fmax(0.5 * grid->step, TICKS), DRIFT * (double)grid->places * grid->step))
		return "whose clock runs away or jumps";
	return NULL;
}

/* Why there is none, NULL where there is; *error is DT_E_MEMORY. */
static const char *find_grid(const struct ide_channel *channel, struct grid *grid, int *error)
{
	const char *wrong = channel->wrong;

	*grid = (struct grid){.place = calloc(channel->blocks + 1, sizeof(*grid->place))};
	if (grid->place == NULL)
		*error = DT_E_MEMORY;
	if (!*error && wrong == NULL)
		wrong = find_step(channel, &grid->step, error);
	if (!*error && wrong == NULL)
		wrong = place_blocks(channel, grid);
	if (!*error && wrong == NULL) {
		fit_line(channel, grid);
		wrong = check_line(channel, grid);
	}
	return wrong;
}

/* ---- calibrations ---- */

static double univariate(const struct ide_polynomial *polynomial, double x)
{
	double y = 0;

	for (size_t k = 0; k < polynomial->coefficients; k++)
		y = y * (x - polynomial->reference) + polynomial->coefficient[k];
	return y;
}

static bool has_second(const struct ide_polynomial *polynomial)
{
	return polynomial != NULL && polynomial->bivariate &&
	       (polynomial->coefficient[0] != 0 || polynomial->coefficient[2] != 0);
}

/* What becomes of a number. */
struct chain {
	const struct ide_channel *channel;
	const struct ide_sub *sub;
	const struct ide_number *number;
	const struct ide_polynomial *polynomial[2]; /* NULL where there is none */
	const struct chain *second; /* of which the second variable is; NULL where there is none */
	size_t at;                  /* block that was looked up last, of the second */
};

static double raw(const struct chain *chain, const struct ide_block *block, size_t k)
{
	return bytes_value(block->data + k * chain->channel->sample_bytes + chain->number->at,
	                   chain->number->kind, chain->channel->big);
}

/* The first sample of a block, with polynomials of one variable. */
static double value_of(const struct chain *chain, const struct ide_block *block)
{
	double x = raw(chain, block, 0);

	for (size_t i = 0; i < 2; i++)
		if (chain->polynomial[i] != NULL)
			x = univariate(chain->polynomial[i], x);
	return x;
}

/* The second variable at a time: on the straight line between blocks. */
static double second_at(struct chain *chain, double time_s)
{
	const struct ide_channel *of = chain->second->channel;
	const struct ide_block *block;
	double time = time_s / of->tick_s, part;

	while (chain->at + 1 < of->blocks && of->block[chain->at + 1].first <= time)
		chain->at++;
	block = &of->block[chain->at];
	if (chain->at + 1 == of->blocks || time <= block->first)
		return value_of(chain->second, block);
	part = (time - block->first) / (block[1].first - block->first);
	return value_of(chain->second, block) +
	       part * (value_of(chain->second, block + 1) - value_of(chain->second, block));
}

static double calibrated(struct chain *chain, double x, double time_s)
{
	for (size_t i = 0; i < 2; i++) {
		const struct ide_polynomial *p = chain->polynomial[i];
		double y;

		if (p == NULL)
			continue;
		if (!p->bivariate) {
			x = univariate(p, x);
			continue;
		}
		y = has_second(p) ? second_at(chain, time_s) - p->reference2 : 0;
		x -= p->reference;
		x = p->coefficient[0] * x * y + p->coefficient[1] * x + p->coefficient[2] * y +
		    p->coefficient[3];
	}
	return x;
}

/* Why there is none; NULL where there is. */
static const char *take_chain(const struct ide *ide, const struct ide_channel *channel, size_t s,
                              struct chain *chain)
{
	const struct ide_sub *sub = &channel->sub[s];

	*chain = (struct chain){.channel = channel, .sub = sub};
	if (channel->wrong != NULL)
		return channel->wrong;
	if (sub->id >= IDE_SUBS || !channel->has_number[sub->id])
		return "with more subchannels than its layout has numbers";
	chain->number = &channel->number[sub->id];
	if (channel->calibrated > 1 || sub->calibrated > 1)
		return "with two calibrations of one thing";
	if (channel->calibrated > 0)
		chain->polynomial[0] = ide_polynomial(ide, channel->calibration);
	if (sub->calibrated > 0)
		chain->polynomial[1] = ide_polynomial(ide, sub->calibration);
	if ((channel->calibrated > 0 && chain->polynomial[0] == NULL) ||
	    (sub->calibrated > 0 && chain->polynomial[1] == NULL))
		return "with a calibration that is not in the file";
	return NULL;
}

static const struct ide_polynomial *second_of(const struct chain *chain)
{
	for (size_t i = 0; i < 2; i++)
		if (has_second(chain->polynomial[i]))
			return chain->polynomial[i];
	return NULL;
}

/* The chain of the second variable, where it needs one. */
static const char *take_second(const struct ide *ide, struct chain *chain, struct chain *second)
{
	const struct ide_polynomial *p = second_of(chain);
	const struct ide_channel *channel = p != NULL ? ide_channel(ide, p->channel) : NULL;
	size_t s = 0;

	if (p == NULL)
		return NULL;
	if (has_second(chain->polynomial[0]) && has_second(chain->polynomial[1]))
		return "with two calibrations by another channel";
	while (channel != NULL && s < channel->subs && channel->sub[s].id != p->sub)
		s++;
	if (channel == NULL || s == channel->subs || channel->blocks == 0 ||
	    take_chain(ide, channel, s, second) != NULL)
		return "whose calibration needs another channel, of which there is no sample";
	for (size_t i = 0; i < 2; i++)
		if (second->polynomial[i] != NULL && second->polynomial[i]->bivariate)
			return "whose calibration needs a channel that needs another one";
	for (size_t b = 1; b < channel->blocks; b++)
		if (!(channel->block[b].first > channel->block[b - 1].first))
			return "whose calibration needs another channel, which goes back in time";
	chain->second = second;
	return NULL;
}

/* ---- columns ---- */

static const char *unit_of(const struct chain *chain)
{
	for (size_t i = 2; i-- > 0;)
		if (chain->polynomial[i] != NULL && chain->polynomial[i]->unit[0] != '\0')
			return chain->polynomial[i]->unit;
	return chain->sub->unit;
}

static bool is_acceleration(const char *text)
{
	const struct unit *unit = unit_find(text, strlen(text));

	return unit != NULL && unit->kind == UNIT_ACCELERATION;
}

/* Counts that call themselves g, and no calibration. */
static bool is_open(const struct chain *chain)
{
	return chain->polynomial[0] == NULL && chain->polynomial[1] == NULL &&
	       chain->number->kind != BYTES_F32 && chain->number->kind != BYTES_F64;
}

/* A range in brackets would be taken for a unit: "X (2000g)". */
static void open_bracket(char *name)
{
	const struct unit *unit = unit_of_name(name, strlen(name), UNIT_ACCELERATION);
	char *to = name;

	if (unit == NULL || unit->kind != UNIT_MULTIPLE)
		return;
	for (const char *from = name; *from != '\0'; from++)
		if (strchr("()[]", *from) == NULL)
			*to++ = *from;
	*to = '\0';
}

static void fill_column(const struct grid *grid, struct chain *chain, struct table_column *column)
{
	const struct ide_channel *channel = chain->channel;

	for (size_t k = 0; k < column->count; k++)
		column->value[k] = NAN;
	for (size_t b = 0; b < channel->blocks; b++) {
		mapped_seen(channel->block[b].samples * 2 * sizeof(double));
		for (size_t k = 0; k < channel->block[b].samples; k++) {
			size_t place = grid->place[b] + k;
			double time_s = (grid->first + (double)place * grid->step) * channel->tick_s;

			column->value[place] = calibrated(chain, raw(chain, &channel->block[b], k), time_s);
		}
	}
}

static int add_column(const struct ide *ide, struct table_data *table, const struct grid *grid,
                      struct chain *chain)
{
	const struct ide_channel *channel = chain->channel;
	struct table_column *column = table_data_add(table, grid->places);

	if (column == NULL)
		return source_no_memory(ide->message, ide->source->file);
	fill_column(grid, chain, column);
	snprintf(column->name, sizeof(column->name), "%s", chain->sub->name);
	open_bracket(column->name);
	for (size_t i = 0; i + 1 < table->count; i++)
		if (strcmp(table->column[i].name, column->name) == 0)
			snprintf(column->name, sizeof(column->name), "%.31s %.31s", channel->name,
			         chain->sub->name);
	snprintf(column->unit, sizeof(column->unit), "%s", unit_of(chain));
	column->rate_hz = 1 / (grid->step * channel->tick_s);
	column->start_s = grid->first * channel->tick_s;
	column->uneven = grid->uneven;
	column->gaps = true;
	column->exact = true;
	if (is_open(chain))
		snprintf(column->doubt, sizeof(column->doubt), "counts without a calibration, or %s",
		         column->unit);
	return 0;
}

/* An acceleration is refused, all others are told. */
static int refuse_or_leave(const struct ide *ide, struct table_data *table, const struct chain *chain,
                           const char *why)
{
	size_t used = strlen(table->left_out);

	if (is_acceleration(unit_of(chain)))
		return source_refuse(ide->message, DT_E_FORMAT, ide->source->file, 0,
		                     "IDE file: %.40s %.40s, %s", chain->channel->name, chain->sub->name,
		                     why);
	snprintf(table->left_out + used, sizeof(table->left_out) - used, "%s%.30s", used > 0 ? " " : "",
	         chain->sub->name);
	return 0;
}

static int add_channel(const struct ide *ide, struct table_data *table, const struct ide_channel *channel)
{
	struct grid grid;
	int error = 0;
	const char *no_grid = find_grid(channel, &grid, &error);

	if (error)
		error = source_no_memory(ide->message, ide->source->file);
	for (size_t s = 0; s < channel->subs && !error; s++) {
		struct chain chain, second;
		const char *wrong = take_chain(ide, channel, s, &chain);

		if (wrong == NULL)
			wrong = no_grid != NULL ? no_grid : take_second(ide, &chain, &second);
		error = wrong != NULL ? refuse_or_leave(ide, table, &chain, wrong)
		                      : add_column(ide, table, &grid, &chain);
	}
	free(grid.place);
	return error;
}

int read_ide(struct table_data *table, const struct source *source, char message[READ_MESSAGE_MAX])
{
	struct ide *ide = calloc(1, sizeof(*ide));
	int error;

	table->format = "ide";
	if (ide == NULL)
		return source_no_memory(message, source->file);
	ide->source = source;
	ide->message = message;
	error = ide_take(ide);
	for (size_t i = 0; i < ide->channels && !error; i++)
		if (ide->channel[i].blocks > 0 || (ide->channel[i].used && ide->channel[i].wrong != NULL))
			error = add_channel(ide, table, &ide->channel[i]);
	if (!error && table->count == 0)
		error = ide_refuse(ide, "no channel with samples");
	ide_free(ide);
	free(ide);
	return error;
}
