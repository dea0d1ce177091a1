/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Binary tables and CAN logs: the first byte chooses a format, whose magic is put in front, and what the
 * columns are said to be.
 */
#include <stdlib.h>
#include <string.h>

#include "host/record/read.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
	static const struct {
		const char *magic;
		size_t length;
	} magics[] = {{"\x93NUMPY\1", 7},
	              {"RIFF", 4},
	              {"TDSm", 4},
	              {"UNITS OF G\n", 11},
	              {"    -1\n    58b ", 15},
	              {"LOGG\x20\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0", 32},
	              {"\x1a\x45\xdf\xa3\x87\x42\x82\x84mide", 12}};
	static const char *const columns[] = {NULL, "a:g@1000", "time:s,a:g"};
	char message[READ_MESSAGE_MAX] = "";
	struct record record;
	const char *path;
	uint8_t *whole;
	size_t i, length;

	if (size < 1)
		return 0;
	i = bytes[0] % 16 % (sizeof(magics) / sizeof(magics[0]));
	length = magics[i].length;
	whole = malloc(length + size);
	if (whole == NULL)
		return 0;
	memcpy(whole, magics[i].magic, length);
	memcpy(whole + length, bytes + 1, size - 1);
	path = fuzz_file(whole, length + size - 1);
	free(whole);
	if (read_record(&record, path, columns[bytes[0] / 16 % 3], message) != 0) {
		fuzz_check_message(message, path);
		return 0;
	}
	record_free(&record);
	return 0;
}
