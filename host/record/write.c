/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/write.h"

#include <inttypes.h>
#include <lcm/lcm.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/base/number.h"
#include "common/base/text.h"
#include "common/link/candump.h"
#include "common/wire.h"
#include "common/wire_table.h"
#include "host/base/atomic_file.h"
#include "host/record/blocks.h"
#include "host/record/digest.h"
#include "host/record/drop.h"
#include "host/record/hdf5.h"
#include "host/record/lcm_codec.h"
#include "host/record/lcm_log.h"
#include "host/record/log_index.h"
#include "host/record/mat.h"
#include "host/record/metadata.h"
#include "host/record/mme.h"
#include "host/record/seal.h"
#include "host/record/uff58.h"

/* ---- frames ---- */

static bool clips(const struct record *record, unsigned channel, uint32_t tick, unsigned per_tick)
{
	const uint8_t *sample = record->channels[channel].sample + (size_t)tick * per_tick;

	for (unsigned i = 0; i < per_tick; i++)
		if (sample[i] & SAMPLE_CLIPPED)
			return true;
	return false;
}

/* false if the block is lost */
static bool make_block(const struct record *record, unsigned sensor, uint32_t tick, struct frame *frame)
{
	static const uint32_t ids[WIRE_SENSORS] = {WIRE_ID_BLOCK_S1, WIRE_ID_BLOCK_S2};
	struct wire_block block = {.drop_id = record->drop_id, .tick_ms = record->first_tick_ms + tick};
	unsigned first = 3 * (sensor - 1), status = WIRE_STATE_CAPTURED;

	if (!drop_get(record, sensor, tick, block.x, block.y, block.z))
		return false;
	if ((tick + 1) / 1e3 > record->trigger_s)
		status |= WIRE_STATUS_TRIGGERED;
	if (clips(record, first, tick, WIRE_X_PER_TICK))
		status |= WIRE_STATUS_CLIP_X;
	if (clips(record, first + 1, tick, WIRE_YZ_PER_TICK))
		status |= WIRE_STATUS_CLIP_Y;
	if (clips(record, first + 2, tick, WIRE_YZ_PER_TICK))
		status |= WIRE_STATUS_CLIP_Z;
	block.status = (uint8_t)status;
	wire_pack_block(frame, ids[sensor - 1], &block);
	wire_seal_block(frame);
	return true;
}

/* What follows the capture end. */
static int send_told(const struct record *record, int (*send)(void *context, const struct frame *frame),
                     void *context, struct frame *frame)
{
	int result = 0;

	if (record->measured_known) {
		struct wire_measured measured = record->measured;

		measured.drop_id = record->drop_id;
		wire_pack_measured(frame, WIRE_ID_MEASURED, &measured);
		wire_seal_measured(frame);
		result = send(context, frame);
	}
	for (unsigned i = 0; i < WIRE_PARAMETERS && result == 0; i++) {
		struct wire_parameter parameter = {.drop_id = record->drop_id,
		                                   .index = wire_parameters[i].index,
		                                   .value = record->parameters[i]};

		wire_pack_parameter(frame, WIRE_ID_PARAMETER, &parameter);
		if (record->parameters_held >> i & 1u)
			result = send(context, frame);
	}
	return result;
}

/* When the capture was complete: in the tower's clock, on the day where that is known. */
static int64_t write_end_us(const struct record *record)
{
	return record->time_s != 0 ? record->time_s * 1000000
	                           : ((int64_t)record->first_tick_ms + drop_ticks(record)) * 1000;
}

int write_frames(const struct record *record, int (*send)(void *context, const struct frame *frame),
                 void *context)
{
	struct frame frame = {0};
	int result = 0;

	if (!record->is_drop)
		return DT_E_ARGUMENT;
	for (uint32_t tick = 0; tick < drop_ticks(record) && result == 0; tick++) {
		/* a block can leave when its last sample is taken */
		frame.time_us = write_end_us(record) - ((int64_t)drop_ticks(record) - tick - 1) * 1000;
		for (unsigned sensor = 1; sensor <= WIRE_SENSORS && result == 0; sensor++)
			if (make_block(record, sensor, tick, &frame))
				result = send(context, &frame);
	}
	if (result == 0 && record->crc_known) {
		drop_capture_end(record, &frame);
		result = send(context, &frame);
		if (result == 0)
			result = send_told(record, send, context, &frame);
	}
	return result;
}

/* ---- CSV ---- */

static void write_put_number(FILE *out, double value)
{
	char text[NUMBER_CHARS];

	number_format(text, value, 15);
	fputs(text, out);
}

/* What is known of it by name, a line each behind a mark; of_drop: what only a drop has, too. */
static void put_fields(const struct record *record, const char *mark, bool of_drop, FILE *out)
{
	const struct metadata_entry *entry;
	char text[METADATA_TEXT_MAX];

	for (size_t i = 0; (entry = metadata_entry(i)) != NULL; i++) {
		if (!metadata_known(record, entry) || (entry->of_drop && !of_drop))
			continue;
		metadata_format(record, entry, text);
		fprintf(out, "%s%s %s\n", mark, entry->name, text);
	}
}

static void write_put_channel(const struct channel *channel, const char *mark, FILE *out)
{
	fprintf(out, "%schannel rate_hz=", mark);
	write_put_number(out, channel->rate_hz);
	fputs(" start_s=", out);
	write_put_number(out, channel->start_s);
	fputs(" range_g=", out);
	write_put_number(out, channel->range_g);
	fprintf(out, " count=%zu uneven=%d name=%s\n", channel->count,
	        (channel->flags & RECORD_FLAG_UNEVEN) != 0, channel->name);
}

static void put_about_all(const struct record *record, const char *mark, FILE *out)
{
	put_fields(record, mark, true, out);
	for (size_t i = 0; i < record->channel_count; i++)
		write_put_channel(&record->channels[i], mark, out);
}

/* "" for a sample that is a number. */
static const char *word_of(const struct channel *channel, size_t k)
{
	if (channel->sample[k] & SAMPLE_LOST)
		return "lost";
	return channel->sample[k] & SAMPLE_BAD || !isfinite(channel->value_g[k]) ? "bad" : "";
}

static bool is_clipped(const struct channel *channel, size_t k)
{
	return (channel->sample[k] & SAMPLE_CLIPPED) != 0;
}

/* As text with its marks; in a table the number alone. */
static void write_put_cell(const struct channel *channel, size_t k, bool table, FILE *out)
{
	const char *word = word_of(channel, k);

	if (word[0] == '\0')
		write_put_number(out, channel->value_g[k]);
	if (!table)
		fprintf(out, "%s%s", word, is_clipped(channel, k) ? "*" : "");
}

static double sample_time(const struct channel *channel, size_t k)
{
	return channel->start_s + (double)k / channel->rate_hz;
}

static bool is_due(const struct channel *channel, size_t k, double now)
{
	return k < channel->count && sample_time(channel, k) <= now;
}

/* "S1X lost;S1Y clipped" of the samples of this instant. */
static void put_marks(const struct record *record, const size_t *next, double now, FILE *out)
{
	const char *between = "";

	for (size_t i = 0; i < record->channel_count; i++) {
		const struct channel *channel = &record->channels[i];
		const char *word;
		bool clipped;

		if (!is_due(channel, next[i], now))
			continue;
		word = word_of(channel, next[i]);
		clipped = is_clipped(channel, next[i]);
		if (word[0] == '\0' && !clipped)
			continue;
		fprintf(out, "%s%s%s%s%s", between, channel->name, word[0] ? " " : "", word,
		        clipped ? " clipped" : "");
		between = ";";
	}
}

/* The next line of what is known of the record, in a cell of its own. */
static const char *put_about(const char *about, FILE *out)
{
	size_t length = strcspn(about, "\n");

	fprintf(out, ",%.*s", (int)length, about);
	return about + length + (about[length] == '\n');
}

/* One row per instant at which any channel has a sample; about: a table, with these lines beside it, and
 * below where there are more of them. */
static void write_put_rows(const struct record *record, size_t *next, const char *about, FILE *out)
{
	for (;;) {
		double now = INFINITY;

		for (size_t i = 0; i < record->channel_count; i++)
			if (next[i] < record->channels[i].count)
				now = fmin(now, sample_time(&record->channels[i], next[i]));
		if (isinf(now))
			break;
		write_put_number(out, now);
		for (size_t i = 0; i < record->channel_count; i++) {
			fputc(',', out);
			if (is_due(&record->channels[i], next[i], now))
				write_put_cell(&record->channels[i], next[i], about != NULL, out);
		}
		if (about != NULL) {
			fputc(',', out);
			put_marks(record, next, now, out);
			about = put_about(about, out);
		}
		for (size_t i = 0; i < record->channel_count; i++)
			next[i] += is_due(&record->channels[i], next[i], now);
		fputc('\n', out);
	}
	while (about != NULL && *about != '\0') {
		for (size_t i = 0; i <= record->channel_count; i++)
			fputc(',', out);
		about = put_about(about, out);
		fputc('\n', out);
	}
}

static bool write_can_name(const char *name)
{
	for (const char *p = name; *p; p++)
		if ((unsigned char)*p < ' ' || *p == ',')
			return false;
	return name[0] != '\0';
}

/* Columns and rows. */
static int put_columns(const struct record *record, const char *about, FILE *out)
{
	size_t *next = calloc(record->channel_count + 1, sizeof(*next));

	if (!next)
		return DT_E_MEMORY;
	fputs("time_s", out);
	for (size_t i = 0; i < record->channel_count; i++)
		fprintf(out, ",%s_g", record->channels[i].name);
	fputs(about != NULL ? "," CSV_TABLE "\n" : "\n", out);
	write_put_rows(record, next, about, out);
	free(next);
	return fflush(out) || ferror(out) ? DT_E_SYSTEM : 0;
}

static bool can_name_all(const struct record *record)
{
	for (size_t i = 0; i < record->channel_count; i++)
		if (!write_can_name(record->channels[i].name))
			return false;
	return true;
}

int write_csv(const struct record *record, FILE *out)
{
	if (!can_name_all(record))
		return DT_E_ARGUMENT;
	fputs("# droptower csv 1\n", out);
	put_about_all(record, "# ", out);
	return put_columns(record, NULL, out);
}

/* ---- the formats, by name ---- */

static int put_frame(void *context, const struct frame *frame)
{
	char line[CANDUMP_LINE_MAX];

	candump_format(line, frame, "can0");
	return fputs(line, context) < 0 ? DT_E_SYSTEM : 0;
}

static int write_candump(const struct record *record, FILE *out)
{
	int error = write_frames(record, put_frame, out);

	if (error)
		return error;
	return fflush(out) || ferror(out) ? DT_E_SYSTEM : 0;
}

static int write_put_event(FILE *out, int64_t time_us, char *channel, uint8_t *bytes, int size)
{
	lcm_eventlog_t log = {.f = out};
	lcm_eventlog_event_t event = {
	        .timestamp = time_us,
	        .channellen = (int32_t)strlen(channel),
	        .datalen = size,
	        .channel = channel,
	        .data = bytes,
	};

	if (lcm_eventlog_write_event(&log, &event))
		return DT_E_SYSTEM;
	return fflush(out) || ferror(out) ? DT_E_SYSTEM : 0;
}

/* The drop message, what else is known of the drop, and the seal of both. */
static int put_events(const struct record *record, int64_t time_us, uint8_t *bytes, int size, FILE *out)
{
	char of_drop[] = LCM_CODEC_DROP, of_origin[] = LCM_LOG_ORIGIN, of_seal[] = LCM_LOG_SEAL,
	     seal[] = SEAL_BLANK;
	struct sha256_ctx digest;
	struct text origin;
	int error = text_open(&origin);

	if (error)
		return error;
	put_fields(record, "", false, origin.out);
	error = text_close(&origin, 0);
	sha256_init(&digest);
	sha256_update(&digest, (size_t)size, bytes);
	if (!error)
		error = write_put_event(out, time_us, of_drop, bytes, size);
	if (!error && origin.size > 0) {
		sha256_update(&digest, origin.size, (const uint8_t *)origin.bytes);
		error = write_put_event(out, time_us, of_origin, (uint8_t *)origin.bytes, (int)origin.size);
	}
	digest_end(&digest, seal + strlen(SEAL_WORD));
	free(origin.bytes);
	return error ? error : write_put_event(out, time_us, of_seal, (uint8_t *)seal, sizeof(seal) - 1);
}

static int write_lcm(const struct record *record, FILE *out)
{
	int64_t time_us = write_end_us(record);
	droptower_drop drop;
	int error = lcm_codec_drop(record, time_us, &drop), size;
	uint8_t *bytes;

	if (error)
		return error;
	size = droptower_drop_encoded_size(&drop);
	bytes = malloc((size_t)size);
	if (!bytes)
		error = DT_E_MEMORY;
	else if (droptower_drop_encode(bytes, 0, size, &drop) != size)
		error = DT_E_FORMAT;
	else
		error = put_events(record, time_us, bytes, size, out);
	free(bytes);
	lcm_codec_free_drop(&drop);
	return error;
}

int write_sealed_csv(const struct record *record, struct text *text)
{
	int error = text_open(text);

	if (error)
		return error;
	error = write_csv(record, text->out);
	if (!error && fputs("# " SEAL_BLANK "\n", text->out) < 0)
		error = DT_E_SYSTEM;
	error = text_close(text, error);
	return error ? error : seal_fill(text->bytes, text->size);
}

/* The table, with what is known of the record in its last column. */
static int put_table(const struct record *record, FILE *out)
{
	struct text about;
	int error = can_name_all(record) ? text_open(&about) : DT_E_ARGUMENT;

	if (error)
		return error;
	put_about_all(record, "", about.out);
	fputs(SEAL_BLANK "\n", about.out);
	error = text_close(&about, 0);
	if (!error)
		error = put_columns(record, about.bytes, out);
	free(about.bytes);
	return error;
}

/* What a writer makes, with its SHA-256 in it. */
static int put_sealed(const struct record *record, int (*write)(const struct record *, FILE *), FILE *out)
{
	struct text text;
	int error = text_open(&text);

	if (!error)
		error = text_close(&text, write(record, text.out));
	if (!error)
		error = seal_fill(text.bytes, text.size);
	if (!error && fwrite(text.bytes, 1, text.size, out) != text.size)
		error = DT_E_SYSTEM;
	free(text.bytes);
	return error ? error : fflush(out) ? DT_E_SYSTEM : 0;
}

static int put_csv(const struct record *record, FILE *out)
{
	return put_sealed(record, put_table, out);
}

static int put_uff58(const struct record *record, FILE *out)
{
	return put_sealed(record, write_uff58, out);
}

typedef int helper_writer(const struct record *, FILE *, const char *, char *);

/* With a message of its own, which tells more than the code. */
static int write_whole(const struct record *record, helper_writer *write, struct atomic_file *atomic,
                       char *message)
{
	char why[READ_MESSAGE_MAX];
	int result = write(record, atomic->out, atomic->file, why);
	int closed = atomic_file_close(atomic, result, message, READ_MESSAGE_MAX);

	if (result != 0)
		strcpy(message, why);
	return closed;
}

/* What the endings mean; one writer each: of bytes, by a helper, of several files. */
static const struct format {
	const char *ending;
	bool drops_only;
	int (*write)(const struct record *, FILE *);
	helper_writer *by_helper;
	int (*files)(const struct record *, const char *, char *);
} formats[] = {
        {".csv", false, .write = put_csv},         {".lcm", true, .write = write_lcm},
        {".log", true, .write = write_candump},    {".candump", true, .write = write_candump},
        {".pcapng", true, .write = write_pcapng},  {".unv", false, .write = put_uff58},
        {".uff", false, .write = put_uff58},       {".h5", false, .by_helper = write_hdf5},
        {".hdf5", false, .by_helper = write_hdf5}, {".mat", false, .by_helper = write_mat},
        {".mme", false, .files = write_mme},
};

static const char packed_ending[] = ".zst";

bool write_packs(const char *file)
{
	size_t length = strlen(file), ending = strlen(packed_ending);

	return length > ending && strcmp(file + length - ending, packed_ending) == 0;
}

/* By the ending, or the one before that of blocks: only what is written in one go can be packed. */
static const struct format *format_of(const char *file)
{
	size_t length = strlen(file) - (write_packs(file) ? strlen(packed_ending) : 0);

	for (size_t i = 0; i < sizeof(formats) / sizeof(formats[0]); i++) {
		size_t ending = strlen(formats[i].ending);

		if (length >= ending && memcmp(file + length - ending, formats[i].ending, ending) == 0 &&
		    (!write_packs(file) || formats[i].write != NULL))
			return &formats[i];
	}
	return NULL;
}

/* In blocks (blocks.h). */
static int write_packed(const struct record *record, const struct format *format, FILE *out)
{
	struct blocks_writer *writer;
	struct text text;
	int error = text_open(&text);

	if (!error)
		error = text_close(&text, format->write(record, text.out));
	if (error)
		return error;
	error = blocks_begin(&writer, out);
	if (!error)
		error = blocks_end(writer, blocks_put(writer, text.bytes, text.size), NULL, 0);
	free(text.bytes);
	return error;
}

/* ---- a log as it is ---- */

bool write_blocks_is(struct log_file *log, const char *file)
{
	const struct format *format = write_packs(file) ? format_of(file) : NULL;

	return format != NULL && log_is(log) &&
	       format->write == (strcmp(log_format(log), "lcm") == 0 ? write_lcm : write_candump);
}

static int put_log(struct log_file *log, struct blocks_writer *writer)
{
	int error = 0;
	size_t held;

	for (uint64_t at = 0; at < log->size && !error; at += held) {
		const char *bytes = log_file_get(log, at, 1, &held);

		if (held == 0)
			break;
		error = blocks_put(writer, bytes, held);
	}
	return error;
}

int write_blocks(struct log_file *log, const char *file, char message[READ_MESSAGE_MAX])
{
	struct blocks_writer *writer;
	struct atomic_file atomic;
	struct text index;
	int error = log_index_text(log, &index, message);

	if (error)
		return error;
	error = atomic_file_open(&atomic, file, message, READ_MESSAGE_MAX);
	if (!error) {
		error = blocks_begin(&writer, atomic.out);
		if (!error)
			error = blocks_end(writer, put_log(log, writer), index.bytes, index.size);
		error = atomic_file_close(&atomic, log->failed != 0 ? DT_E_SYSTEM : error, message,
		                          READ_MESSAGE_MAX);
	}
	free(index.bytes);
	return log->failed != 0 ? log_file_error(log, message) : error;
}

int write_record(const struct record *record, const char *file, char message[READ_MESSAGE_MAX])
{
	const struct format *format = format_of(file);
	struct atomic_file atomic;
	int error;

	if (!format)
		return source_refuse(message, DT_E_ARGUMENT, file, 0,
		                     "unknown ending, expected .csv, .lcm, .log, .candump, .pcapng, .unv, "
		                     ".uff, .h5, .hdf5, .mat or .mme; .zst behind one of the first seven");
	if (format->drops_only && !record->is_drop)
		return source_refuse(message, DT_E_ARGUMENT, file, 0,
		                     "not a drop of a tower: expected .csv, .unv, .h5, .mat or .mme");
	if ((format->write == write_candump || format->write == write_pcapng) && record->seal_known &&
	    !record->seal_agrees)
		return source_refuse(message, DT_E_ARGUMENT, file, 0,
		                     "altered: the capture end is not what the tower sealed, and a log of "
		                     "frames cannot say so; expected .csv, .lcm, .unv or .h5");
	if (format->files != NULL)
		return format->files(record, file, message);
	error = atomic_file_open(&atomic, file, message, READ_MESSAGE_MAX);
	if (error)
		return error;
	if (format->by_helper != NULL)
		return write_whole(record, format->by_helper, &atomic, message);
	error = write_packs(file) ? write_packed(record, format, atomic.out)
	                          : format->write(record, atomic.out);
	return atomic_file_close(&atomic, error, message, READ_MESSAGE_MAX);
}
