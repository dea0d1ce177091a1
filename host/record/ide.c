/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/ide.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/base/number.h"

enum {
	ID_EBML = 0x1A45DFA3,
	ID_DOCTYPE = 0x4282,
	ID_SESSION = 0x18538067,
	ID_PROPERTIES = 0x18526570,
	ID_CHANNELS = 0x5270,
	ID_CHANNEL = 0x5271,
	ID_SUB = 0x52A0,
	ID_CALIBRATIONS = 0x4B00,
	ID_UNIVARIATE = 0x4B01,
	ID_BIVARIATE = 0x4B02,
	ID_SIMPLE_BLOCK = 0xA0,
	ID_BLOCK = 0xA1,
};
static const double TICK_S = 1.0 / 32768;

int ide_refuse(const struct ide *ide, const char *why)
{
	return source_refuse(ide->message, DT_E_FORMAT, ide->source->file, 0, "IDE file: %s", why);
}

const struct ide_channel *ide_channel(const struct ide *ide, unsigned id)
{
	for (size_t i = 0; i < ide->channels; i++)
		if (ide->channel[i].id == id)
			return &ide->channel[i];
	return NULL;
}

/* The last of that number, as later ones replace those before. */
const struct ide_polynomial *ide_polynomial(const struct ide *ide, unsigned id)
{
	for (size_t i = ide->polynomials; i-- > 0;)
		if (ide->polynomial[i].id == id)
			return &ide->polynomial[i];
	return NULL;
}

static bool take_id(const struct ebml_element *element, unsigned *id)
{
	uint64_t value;
	bool right = ebml_whole(element, &value) && value <= UINT32_MAX;

	if (right)
		*id = (unsigned)value;
	return right;
}

/* ---- calibrations ---- */

static bool take_coefficient(const struct ebml_element *element, struct ide_polynomial *polynomial)
{
	return polynomial->coefficients < IDE_COEFFICIENTS &&
	       ebml_real(element, &polynomial->coefficient[polynomial->coefficients++]);
}

static int take_polynomial(struct ide *ide, const struct ebml_element *of)
{
	struct ide_polynomial polynomial = {.bivariate = of->id == ID_BIVARIATE};
	struct ebml inside = ebml_inside(of);
	struct ebml_element element;
	bool right = true;
	int more;

	while ((more = ebml_next(&inside, &element)) > 0 && right) {
		if (element.id == 0x4B03)
			right = take_id(&element, &polynomial.id);
		else if (element.id == 0x4B04)
			right = ebml_real(&element, &polynomial.reference);
		else if (element.id == 0x4B05)
			right = ebml_real(&element, &polynomial.reference2);
		else if (element.id == 0x4B06)
			right = take_id(&element, &polynomial.channel);
		else if (element.id == 0x4B07)
			right = take_id(&element, &polynomial.sub);
		else if (element.id == 0x4B08)
			right = take_coefficient(&element, &polynomial);
		else if (element.id == 0x4B30)
			ebml_text(&element, polynomial.unit, sizeof(polynomial.unit));
	}
	if (more < 0 || !right || polynomial.coefficients == 0 ||
	    (polynomial.bivariate && polynomial.coefficients != 4))
		return ide_refuse(ide,
		                  "a calibration that is no polynomial of up to 12 coefficients, or of two "
		                  "variables with 4: cut or damaged");
	if (ide->polynomials == IDE_POLYNOMIALS)
		return ide_refuse(ide, "more than 256 calibrations");
	ide->polynomial[ide->polynomials++] = polynomial;
	return 0;
}

/* What is in an element, as far as it is of one of two kinds. */
static int take_inside(struct ide *ide, const struct ebml_element *of, uint32_t id, uint32_t other,
                       int (*take)(struct ide *ide, const struct ebml_element *element), const char *cut)
{
	struct ebml inside = ebml_inside(of);
	struct ebml_element element;
	int more, error = 0;

	while ((more = ebml_next(&inside, &element)) > 0 && !error)
		if (element.id == id || element.id == other)
			error = take(ide, &element);
	return more < 0 ? ide_refuse(ide, cut) : error;
}

static int take_calibrations(struct ide *ide, const struct ebml_element *of)
{
	return take_inside(ide, of, ID_UNIVARIATE, ID_BIVARIATE, take_polynomial,
	                   "cut or damaged in its calibrations");
}

/* ---- channels ---- */

static bool take_sub(struct ide_channel *channel, const struct ebml_element *of)
{
	struct ide_sub *sub = &channel->sub[channel->subs++];
	struct ebml inside = ebml_inside(of);
	struct ebml_element element;
	char label[64] = "";
	bool right = true;
	int more;

	while ((more = ebml_next(&inside, &element)) > 0 && right) {
		if (element.id == 0x52A1)
			right = take_id(&element, &sub->id);
		else if (element.id == 0x52A2)
			ebml_text(&element, sub->name, sizeof(sub->name));
		else if (element.id == 0x52A3 && ++sub->calibrated > 0)
			right = take_id(&element, &sub->calibration);
		else if (element.id == 0x52A5)
			ebml_text(&element, label, sizeof(label));
		else if (element.id == 0x52A6)
			ebml_text(&element, sub->unit, sizeof(sub->unit));
	}
	if (sub->name[0] == '\0')
		memcpy(sub->name, label, sizeof(label));
	return right && more == 0;
}

static bool take_element(struct ide_channel *channel, const struct ebml_element *element)
{
	if (element->id == 0x5272)
		return take_id(element, &channel->id);
	if (element->id == 0x5273)
		ebml_text(element, channel->name, sizeof(channel->name));
	else if (element->id == 0x5274 && ++channel->calibrated > 0)
		return take_id(element, &channel->calibration);
	else if (element->id == 0x5275)
		ebml_text(element, channel->format, sizeof(channel->format));
	else if (element->id == 0x5276)
		ebml_text(element, channel->parser, sizeof(channel->parser));
	else if (element->id == 0x5277)
		ebml_text(element, channel->scale, sizeof(channel->scale));
	else if (element->id == 0x5278)
		return ebml_whole(element, &channel->modulus);
	else if (element->id == 0x5279)
		ebml_text(element, channel->rate, sizeof(channel->rate));
	else if (element->id == ID_SUB)
		return channel->subs < IDE_SUBS && take_sub(channel, element);
	return true;
}

/* A number, or one divided by another. */
static bool take_ratio(const char *text, double *value)
{
	const char *stroke = strchr(text, '/');
	char first[32];
	double divisor = 1;
	bool right;

	snprintf(first, sizeof(first), "%.*s", (int)(stroke != NULL ? stroke - text : 31), text);
	right = number_read(first, 1e-12, 1e12, value) &&
	        (stroke == NULL || number_read(stroke + 1, 1e-12, 1e12, &divisor));
	*value /= divisor;
	return right;
}

/* Letters as in Python's struct, behind the order of bytes. */
static const char *take_format(struct ide_channel *channel)
{
	static const char letters[] = "bBhHiIlLqQfd";
	static const enum bytes_kind kinds[] = {BYTES_I8,  BYTES_U8,  BYTES_I16, BYTES_U16,
	                                        BYTES_I32, BYTES_U32, BYTES_I32, BYTES_U32,
	                                        BYTES_I64, BYTES_U64, BYTES_F32, BYTES_F64};
	size_t numbers = 0;

	if (channel->parser[0] != '\0')
		return "whose samples are in a layout of their own";
	if (channel->format[0] != '<' && channel->format[0] != '>')
		return "whose layout does not tell the order of its bytes";
	channel->big = channel->format[0] == '>';
	for (const char *at = channel->format + 1; *at != '\0'; at++) {
		const char *letter = strchr(letters, *at);

		if (*at == 'x') {
			channel->sample_bytes++;
		} else if (*at != ' ') {
			if (letter == NULL || numbers == IDE_SUBS)
				return "whose layout is not known";
			channel->number[numbers] =
			        (struct ide_number){kinds[letter - letters], channel->sample_bytes};
			channel->has_number[numbers] = true;
			channel->sample_bytes += bytes_size(kinds[letter - letters]);
			numbers++;
		}
	}
	return numbers > 0 ? NULL : "whose layout is not known";
}

static int take_channel(struct ide *ide, const struct ebml_element *of)
{
	struct ide_channel *channel = &ide->channel[ide->channels];
	struct ebml inside = ebml_inside(of);
	struct ebml_element element;
	int more;

	if (ide->channels == IDE_CHANNELS)
		return ide_refuse(ide, "more than 64 channels");
	*channel = (struct ide_channel){.tick_s = TICK_S};
	while ((more = ebml_next(&inside, &element)) > 0)
		if (!take_element(channel, &element))
			return ide_refuse(ide, "cut or damaged in a channel, or more than 16 subchannels");
	if (more < 0)
		return ide_refuse(ide, "cut or damaged in a channel");
	if (ide_channel(ide, channel->id) != NULL)
		return ide_refuse(ide, "two channels of one number");
	channel->wrong = take_format(channel);
	if (channel->scale[0] != '\0' && !take_ratio(channel->scale, &channel->tick_s))
		channel->wrong = "whose clock has a scale that is no number";
	if (channel->rate[0] != '\0' && !take_ratio(channel->rate, &channel->rate_hz))
		channel->wrong = "whose rate is no number";
	if (channel->modulus == 0)
		channel->modulus = 1 << 24;
	ide->channels++;
	return 0;
}

static int take_channels(struct ide *ide, const struct ebml_element *of)
{
	return take_inside(ide, of, ID_CHANNEL, ID_CHANNEL, take_channel, "cut or damaged in its channels");
}

static int take_properties(struct ide *ide, const struct ebml_element *of)
{
	return take_inside(ide, of, ID_CHANNELS, ID_CHANNELS, take_channels,
	                   "cut or damaged in its properties");
}

/* ---- blocks ---- */

/* A time that is less than the one before has rolled over; one beyond the modulus never does. A channel
 * begins where it is nearest to the others. */
static double without_rollover(struct ide *ide, struct ide_channel *channel, uint64_t ticks)
{
	double time = (double)ticks, modulus = (double)channel->modulus;

	if (ticks >= channel->modulus)
		channel->rolled = 0;
	else if (!channel->used)
		channel->rolled =
		        modulus * fmax(0, round((ide->latest_s / channel->tick_s - time) / modulus));
	else if (time + channel->rolled < channel->latest)
		channel->rolled += modulus;
	channel->latest = time + channel->rolled;
	channel->used = true;
	ide->latest_s = channel->latest * channel->tick_s;
	return channel->latest;
}

static int add_block(struct ide *ide, struct ide_channel *channel, struct ide_block block)
{
	size_t room = channel->room > 0 ? 2 * channel->room : 64;
	struct ide_block *more;

	if (channel->blocks == channel->room) {
		more = realloc(channel->block, room * sizeof(*more));
		if (more == NULL)
			return source_no_memory(ide->message, ide->source->file);
		channel->block = more;
		channel->room = room;
	}
	channel->block[channel->blocks++] = block;
	return 0;
}

struct ide_told {
	unsigned channel;
	uint64_t first, last;
	bool has_channel, has_first, has_last;
	struct ebml_element data;
};

static bool take_block_element(struct ide_told *told, const struct ebml_element *element)
{
	if (element->id == 0xB0)
		return told->has_channel = take_id(element, &told->channel);
	if (element->id == 0xB8 || element->id == 0xBA)
		return told->has_first = ebml_whole(element, &told->first);
	if (element->id == 0xB9 || element->id == 0xBB)
		return told->has_last = ebml_whole(element, &told->last);
	if (element->id == 0xB2)
		told->data = *element;
	return true;
}

static int take_block(struct ide *ide, const struct ebml_element *of)
{
	struct ebml inside = ebml_inside(of);
	struct ide_told told = {.has_channel = false};
	struct ebml_element element;
	const struct ide_channel *found;
	struct ide_channel *channel;
	struct ide_block block = {.first = 0};
	int more;

	while ((more = ebml_next(&inside, &element)) > 0)
		if (!take_block_element(&told, &element))
			return ide_refuse(ide, "cut or damaged in a block");
	if (more < 0 || !told.has_channel || !told.has_first)
		return ide_refuse(ide, "a block without its channel or its time: cut or damaged");
	found = ide_channel(ide, told.channel);
	if (found == NULL)
		return 0; /* not described: of the recorder's own */
	channel = &ide->channel[found - ide->channel];
	block.first = without_rollover(ide, channel, told.first);
	block.last = told.has_last ? without_rollover(ide, channel, told.last) : block.first;
	if (channel->wrong != NULL || told.data.size == 0)
		return 0;
	if (told.data.size % channel->sample_bytes != 0) {
		channel->wrong = "whose blocks are no whole samples";
		return 0;
	}
	block.samples = told.data.size / channel->sample_bytes;
	block.data = told.data.data;
	if (!told.has_last)
		block.last = block.samples > 1 ? NAN : block.first;
	return add_block(ide, channel, block);
}

static void refuse_simple(struct ide *ide, const struct ebml_element *element)
{
	for (size_t i = 0; i < ide->channels; i++)
		if (element->size > 3 && ide->channel[i].id == (unsigned char)element->data[2]) {
			ide->channel[i].wrong =
			        "in blocks without the time of their end (SimpleChannelDataBlock)";
			ide->channel[i].used = true;
		}
}

/* Sessions have no size of their own: what is in them stands beside them, too. */
static int take_top(struct ide *ide, bool blocks)
{
	struct ebml top = ebml_bytes(ide->source->bytes, ide->source->size);
	struct ebml_element element;
	int more, error = 0;

	while ((more = ebml_next(&top, &element)) > 0 && !error) {
		if (element.id == ID_SESSION)
			top.at = element.data;
		else if (!blocks && element.id == ID_CALIBRATIONS)
			error = take_calibrations(ide, &element);
		else if (!blocks && element.id == ID_PROPERTIES)
			error = take_properties(ide, &element);
		else if (blocks && element.id == ID_BLOCK)
			error = take_block(ide, &element);
		else if (blocks && element.id == ID_SIMPLE_BLOCK)
			refuse_simple(ide, &element);
	}
	return more < 0 ? ide_refuse(ide, "cut or damaged, expected whole elements to its end") : error;
}

bool ide_is(const struct source *source)
{
	struct ebml top = ebml_bytes(source->bytes, source->size), inside;
	struct ebml_element element;
	char type[8];

	if (ebml_next(&top, &element) <= 0 || element.id != ID_EBML)
		return false;
	inside = ebml_inside(&element);
	while (ebml_next(&inside, &element) > 0) {
		ebml_text(&element, type, sizeof(type));
		if (element.id == ID_DOCTYPE && strcmp(type, "mide") == 0)
			return true;
	}
	return false;
}

int ide_take(struct ide *ide)
{
	int error = take_top(ide, false);

	if (!error && ide->channels == 0)
		error = ide_refuse(ide,
		                   "does not describe its channels, as those of the first recorders: export "
		                   "it as CSV");
	return error ? error : take_top(ide, true);
}

void ide_free(struct ide *ide)
{
	for (size_t i = 0; i < ide->channels; i++)
		free(ide->channel[i].block);
}
