/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * archive_recorder FOLDER SERIES COUNT LOG: records drops one after the other as `droptower run` does, with
 * the bytes of LOG in pieces, and says "SERIES/NUMBER" once a drop is acknowledged. Made to be killed.
 */
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "host/archive/archive.h"

enum { PIECE_BYTES = 20000 };

static int fail(const char *message)
{
	fprintf(stderr, "archive_recorder: %s\n", message);
	return 3;
}

/* Every piece is in the file before the next one comes. */
static int copy_log(const char *from, const char *to)
{
	FILE *in = fopen(from, "r"), *out = fopen(to, "a");
	static char piece[PIECE_BYTES];
	size_t n = 0;
	int result = in != NULL && out != NULL ? 0 : -1;

	while (result == 0 && (n = fread(piece, 1, sizeof(piece), in)) > 0)
		if (fwrite(piece, 1, n, out) != n || fflush(out) != 0)
			result = -1;
	if (in != NULL)
		fclose(in);
	if (out != NULL && fclose(out) != 0)
		result = -1;
	return result;
}

static int record(struct archive *archive, const char *series, const char *log)
{
	static const char json[] =
	        "{\"flags\":[],\"channels\":[{\"name\":\"S1X\",\"rate_hz\":7000,\"flags\":[],\"peak\":{"
	        "\"value_g\":300,\"sigma_g\":1,\"status\":\"ok\"}}]}";
	struct channel channel = {.name = "S1X", .rate_hz = 7000};
	struct record said_of = {.channels = &channel, .channel_count = 1};
	struct estimate_channel estimate = {.peak = {.value_g = 300, .sigma_g = 1}};
	struct analysis analysis = {.channels = &estimate, .channel_count = 1};
	struct estimate_options options = {.tolerance = 0};
	struct result said = result_of(&said_of, &analysis, &options);
	struct archive_recording r;
	char drop[ARCHIVE_NAME_MAX + 16];
	int result = archive_begin(archive, series, "recorder", ".log", false, &r);

	if (result != 0)
		return result;
	if (copy_log(log, r.log) != 0) {
		archive_abandon(&r);
		return DT_E_SYSTEM;
	}
	result = archive_finish(archive, &r, 0, "");
	if (result != 0)
		return result;
	snprintf(drop, sizeof(drop), "%s/%u", r.series, r.number);
	puts(drop);
	fflush(stdout);
	return archive_result(archive, drop, "recorder", &said, json);
}

int main(int argc, char **argv)
{
	char message[ARCHIVE_MESSAGE_MAX];
	struct archive *archive;
	int result = 0;

	if (argc != 5)
		return fail("expected FOLDER SERIES COUNT LOG");
	archive = archive_open(argv[1], ARCHIVE_WRITE, message);
	if (archive == NULL)
		return fail(message);
	for (int i = atoi(argv[3]); i > 0 && result == 0; i--)
		result = record(archive, argv[2], argv[4]);
	if (result != 0)
		fail(archive_message(archive)[0] != '\0' ? archive_message(archive)
		                                         : "the log was not written");
	archive_close(archive);
	return result == 0 ? 0 : 3;
}
