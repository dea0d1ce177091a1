/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Foreign text: the first byte chooses what the columns are said to be, if anything, the rest is the file.
 * What is read is analysed, too.
 */
#include <math.h>
#include <stdlib.h>

#include "host/estimate/estimate.h"
#include "host/record/read.h"
#include "tests/fuzz/fuzz.h"

enum { SAMPLES_MAX = 4000 };

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
	static const char *const columns[] = {"time:s,a:g",
	                                      "time:ms,a:g,b:-m/s2",
	                                      "a:g@10000",
	                                      "time:s,a:m/s2,b:g,-,-",
	                                      "-,time:us,-,a:g",
	                                      "a:g@51200,b:m/s^2@51200,c:-g@51200",
	                                      "time:clock,a:mV/(10mV/g)",
	                                      NULL};
	char message[READ_MESSAGE_MAX] = "";
	const struct estimate_options options = {0};
	struct analysis analysis;
	struct record record;
	const char *path;
	size_t samples = 0;

	if (size < 1)
		return 0;
	path = fuzz_file(bytes + 1, size - 1);
	if (read_record(&record, path, columns[bytes[0] % (sizeof(columns) / sizeof(columns[0]))], message) !=
	    0) {
		fuzz_check_message(message, path);
		return 0;
	}
	for (size_t c = 0; c < record.channel_count; c++)
		samples += record.channels[c].count;
	if (samples <= SAMPLES_MAX && estimate_record(&record, &options, &analysis) == 0)
		estimate_free(&analysis);
	record_free(&record);
	return 0;
}
