/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * WAV (RIFF, and RF64 for more than 4 GiB): whole numbers are +-1 of full scale, which the file does not
 * tell: --columns "a:g*500" does. Floats are as they stand.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "host/record/table_data.h"

enum { WAV_PCM = 1, WAV_FLOAT = 3, WAV_EXTENSIBLE = 0xFFFE, WAV_CHANNELS_MOST = COLUMNS_MAX };

struct wav {
	unsigned format, channels, bits;
	double rate_hz;
	const char *data;
	size_t bytes;
};

static int wav_format(struct wav *wav, const char *at, size_t size, const struct source *source,
                      char *message)
{
	if (size < 16)
		return source_refuse(message, DT_E_FORMAT, source->file, 0,
		                     "WAV file with a cut format chunk");
	wav->format = (unsigned)bytes_whole(at, 2, false);
	wav->channels = (unsigned)bytes_whole(at + 2, 2, false);
	wav->rate_hz = (double)bytes_whole(at + 4, 4, false);
	wav->bits = (unsigned)bytes_whole(at + 14, 2, false);
	if (wav->format == WAV_EXTENSIBLE && size >= 26)
		wav->format = (unsigned)bytes_whole(at + 24, 2, false);
	if ((wav->format == WAV_PCM &&
	     (wav->bits == 8 || wav->bits == 16 || wav->bits == 24 || wav->bits == 32)) ||
	    (wav->format == WAV_FLOAT && (wav->bits == 32 || wav->bits == 64)))
		return 0;
	return source_refuse(message, DT_E_FORMAT, source->file, 0,
	                     "WAV file of coding %u in %u bits, expected whole numbers or floats",
	                     wav->format, wav->bits);
}

static int wav_chunks(struct wav *wav, const struct source *source, char *message)
{
	static const size_t ELSEWHERE = UINT32_MAX; /* the size stands in ds64 */
	size_t at = 12, told = ELSEWHERE;

	if (source->size < 12 || memcmp(source->bytes + 8, "WAVE", 4) != 0)
		return source_refuse(message, DT_E_FORMAT, source->file, 0, "RIFF file that is no WAV");
	while (at + 8 <= source->size) {
		const char *chunk = source->bytes + at;
		size_t size = (size_t)bytes_whole(chunk + 4, 4, false), room = source->size - at - 8;
		int error;

		if (memcmp(chunk, "ds64", 4) == 0 && size >= 16 && size <= room)
			told = (size_t)bytes_whole(chunk + 16, 8, false);
		if (memcmp(chunk, "data", 4) == 0 && size == ELSEWHERE)
			size = told;
		if (size > room)
			return source_refuse(message, DT_E_FORMAT, source->file, 0,
			                     "WAV file cut: a chunk of %zu bytes, %zu are there", size, room);
		if (memcmp(chunk, "fmt ", 4) == 0) {
			error = wav_format(wav, chunk + 8, size, source, message);
			if (error)
				return error;
		} else if (memcmp(chunk, "data", 4) == 0 && wav->data == NULL) {
			wav->data = chunk + 8;
			wav->bytes = size;
		}
		at += 8 + size + size % 2;
	}
	if (wav->channels > 0 && wav->channels <= WAV_CHANNELS_MOST && wav->data != NULL &&
	    wav->rate_hz > 0 && wav->bytes % (wav->channels * wav->bits / 8) == 0)
		return 0;
	return source_refuse(message, DT_E_FORMAT, source->file, 0,
	                     "WAV file without format, rate or whole samples: cut or damaged");
}

int read_wav(struct table_data *table, const struct source *source, char message[READ_MESSAGE_MAX])
{
	struct wav wav = {.format = 0};
	int error = wav_chunks(&wav, source, message);
	size_t width = wav.bits / 8, rows;
	enum bytes_kind kind = wav.format == WAV_FLOAT ? (width == 4 ? BYTES_F32 : BYTES_F64)
	                       : width == 1            ? BYTES_U8
	                       : width == 2            ? BYTES_I16
	                       : width == 3            ? BYTES_I24
	                                               : BYTES_I32;
	double full = wav.format == WAV_FLOAT ? 1 : ldexp(1, (int)wav.bits - 1);

	table->format = "wav";
	if (error)
		return error;
	rows = wav.bytes / (wav.channels * width);
	for (size_t c = 0; c < wav.channels; c++) {
		struct table_column *column =
		        table_data_view(table, rows,
		                        (struct bytes_view){wav.data + c * width, wav.channels * width, kind,
		                                            false, kind == BYTES_U8 ? 128 : 0, full});

		if (column == NULL)
			return source_no_memory(message, source->file);
		snprintf(column->name, sizeof(column->name), "ch%zu", c + 1);
		column->rate_hz = wav.rate_hz;
	}
	return 0;
}
