/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Any bytes as a recording whose format is found by itself: a record whose samples and bits agree, or one
 * line. What was read is written in a format and read again: equal.
 */
#include <fcntl.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "host/record/write.h"
#include "tests/fuzz/fuzz.h"

enum { SAMPLES_MAX = 3000 }; /* of a few bytes a gap of a million makes a file of 20 MB */

static size_t check_samples(const struct record *record)
{
	size_t samples = 0;

	for (size_t c = 0; c < record->channel_count; c++) {
		const struct channel *channel = &record->channels[c];

		if (memchr(channel->name, '\0', sizeof(channel->name)) == NULL || !(channel->rate_hz > 0))
			fuzz_fail("channel %zu has no name or rate", c);
		for (size_t k = 0; k < channel->count; k++)
			if ((channel->sample[k] & (SAMPLE_LOST | SAMPLE_BAD)) == 0 &&
			    isinf(channel->value_g[k]))
				fuzz_fail("%s: sample %zu is infinite and called good", channel->name, k);
		samples += channel->count;
	}
	return samples;
}

static void write_and_read(const struct record *record, const char *ending)
{
	char path[64], message[READ_MESSAGE_MAX];
	struct record again;

	snprintf(path, sizeof(path), "/dev/shm/droptower-fuzz-%ld%s", (long)getpid(), ending);
	if (write_record(record, path, message) == 0) {
		if (read_record(&again, path, NULL, message) != 0)
			fuzz_fail("written and refused: %s", message);
		fuzz_check_equal(record, &again, ending);
		record_free(&again);
	}
	unlink(path);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
	static const char *const endings[] = {".csv", ".unv", ".log", ".lcm"};
	char message[READ_MESSAGE_MAX] = "";
	const char *path = fuzz_file(bytes, size);
	struct record record;

	if (read_record(&record, path, NULL, message) != 0) {
		fuzz_check_message(message, path);
		return 0;
	}
	/* one format an input: as much is tried in a quarter of the time */
	if (check_samples(&record) < SAMPLES_MAX)
		write_and_read(&record, endings[(size + bytes[size / 2]) % (record.is_drop ? 4 : 2)]);
	record_free(&record);
	return 0;
}
