/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/kind.h"

#include <string.h>

#define NETCDF "a NetCDF file of the classic format: nccopy -k nc4 makes HDF5 of it"
#define PEAK_TRACE "a CAN trace of PEAK (TRC): save it as ASC or candump text"

enum { PART_BYTES = 1024 };

/* Letters that a text could begin with count only where what no text has stands behind them, or a word of the
 * kind's own in the first part of the file. */
static const struct {
	size_t at;
	const char *magic;
	size_t length;
	const char *name;
	const char *word; /* NULL: the magic is enough */
	size_t word_length;
} kinds[] = {
        {0, "PK\3\4", 4, "a zip archive or a spreadsheet: unpack it, or save the sheet as CSV", NULL, 0},
        {0, "\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", 8,
         "a spreadsheet or other Office file: save the sheet as CSV", NULL, 0},
        {257, "ustar\0", 6, "a tar archive: unpack it", NULL, 0},
        {257, "ustar  \0", 8, "a tar archive: unpack it", NULL, 0},
        {0, "7z\xbc\xaf\x27\x1c", 6, "a 7z archive: unpack it", NULL, 0},
        {0, "CDF\1", 4, NETCDF, NULL, 0},
        {0, "CDF\2", 4, NETCDF, NULL, 0},
        {0, "CDF\5", 4, NETCDF, NULL, 0},
        {0, "ARROW1\0\0", 8, "an Arrow file: export it as CSV", NULL, 0},
        {0, "\x1a\x45\xdf\xa3", 4,
         "an EBML file, but no recording of enDAQ (IDE), whose document type is mide", NULL, 0},
        {0, "MDF     ", 8, "an MDF file of ASAM: export it as CSV", "\0", 1},
        {0, "UnFinMF ", 8, "an MDF file of ASAM that was not finished: finish it, and export it as CSV", "\0",
         1},
        {0, ";$FILEVERSION=", 14, PEAK_TRACE, NULL, 0},
        {0, ";##", 3, PEAK_TRACE, "+-current number in actual sample", 33},
        {0, "%PDF-1.", 7, "a PDF", NULL, 0},
        {0, "%PDF-2.", 7, "a PDF", NULL, 0},
        {0, "\x89PNG\r\n\x1a\n", 8, "a picture", NULL, 0},
        {0, "PAR1\x15", 5, "a Parquet file: export it as CSV", NULL, 0},
        {0, "SQLite format 3\0", 16, "an SQLite database: droptower series reads an archive", NULL, 0},
        {0, "{", 1, "JSON: it is no recording", "\":", 2},
};

static bool is_kind(const struct source *source, size_t i)
{
	const size_t part = source->size < PART_BYTES ? source->size : PART_BYTES;

	return source->size >= kinds[i].at + kinds[i].length &&
	       memcmp(source->bytes + kinds[i].at, kinds[i].magic, kinds[i].length) == 0 &&
	       (kinds[i].word == NULL ||
	        memmem(source->bytes, part, kinds[i].word, kinds[i].word_length) != NULL);
}

int kind_refuse(const struct source *source, char message[READ_MESSAGE_MAX])
{
	for (size_t i = 0; i < sizeof(kinds) / sizeof(kinds[0]); i++)
		if (is_kind(source, i))
			return source_refuse(message, DT_E_UNKNOWN, source->file, 0, "this is %s",
			                     kinds[i].name);
	return 0;
}
