/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/kind.h"

#include <string.h>

static const struct {
	size_t at;
	const char *magic;
	size_t length;
	const char *name;
} kinds[] = {
        {0, "PK\3\4", 4, "a zip archive or a spreadsheet: unpack it, or save the sheet as CSV"},
        {0, "\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", 8,
         "a spreadsheet or other Office file: save the sheet as CSV"},
        {257, "ustar", 5, "a tar archive: unpack it"},
        {0, "7z\xbc\xaf", 4, "a 7z archive: unpack it"},
        {0, "CDF", 3, "a NetCDF file of the classic format: nccopy -k nc4 makes HDF5 of it"},
        {0, "ARROW1", 6, "an Arrow file: export it as CSV"},
        {0, "\x1a\x45\xdf\xa3", 4,
         "an EBML file, but no recording of enDAQ (IDE), whose document type is mide"},
        {0, "MDF     ", 8, "an MDF file of ASAM: export it as CSV"},
        {0, "UnFinMF ", 8, "an MDF file of ASAM that was not finished: finish it, and export it as CSV"},
        {0, ";$FILEVERSION", 13, "a CAN trace of PEAK (TRC): save it as ASC or candump text"},
        {0, ";##", 3, "a CAN trace of PEAK (TRC): save it as ASC or candump text"},
        {0, "%PDF", 4, "a PDF"},
        {0, "\x89PNG", 4, "a picture"},
        {0, "PAR1", 4, "a Parquet file: export it as CSV"},
        {0, "SQLite format 3", 15, "an SQLite database: droptower series reads an archive"},
        {0, "{", 1, "JSON: it is no recording"},
};

int kind_refuse(const struct source *source, char message[READ_MESSAGE_MAX])
{
	for (size_t i = 0; i < sizeof(kinds) / sizeof(kinds[0]); i++)
		if (source->size >= kinds[i].at + kinds[i].length &&
		    memcmp(source->bytes + kinds[i].at, kinds[i].magic, kinds[i].length) == 0)
			return source_refuse(message, DT_E_UNKNOWN, source->file, 0, "this is %s",
			                     kinds[i].name);
	return 0;
}
