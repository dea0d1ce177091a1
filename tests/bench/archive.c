/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/bench/archive.h"

#include <ftw.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/archive/print.h"
#include "tests/unit/archive_stock.h"
#include "tests/unit/scratch.h"

static char folder[SCRATCH_MAX];
static FILE *nowhere;

static struct archive *open_it(enum archive_mode mode)
{
	char message[ARCHIVE_MESSAGE_MAX];
	struct archive *archive = archive_open(folder, mode, message);

	if (archive == NULL) {
		fprintf(stderr, "bench: %s\n", message);
		exit(1);
	}
	return archive;
}

bool bench_archive_make(void)
{
	struct archive *archive;
	int result;

	nowhere = fopen("/dev/null", "w");
	if (nowhere == NULL || mkdtemp(scratch_name(folder, "bench")) == NULL)
		return false;
	archive = open_it(ARCHIVE_CREATE);
	result = archive_new_series(archive, "first", "bench", "common/scenes/geometry-2A.ini", 25, NAN, NULL,
	                            5);
	archive_close(archive);
	return result == 0 && archive_stock_fill(folder, BENCH_ARCHIVE_DROPS, BENCH_ARCHIVE_JSON_BYTES);
}

static int remove_one(const char *path, const struct stat *status, int type, struct FTW *walk)
{
	(void)status;
	(void)type;
	(void)walk;
	return remove(path);
}

void bench_archive_remove(void)
{
	nftw(folder, remove_one, 8, FTW_DEPTH | FTW_PHYS);
	fclose(nowhere);
}

static void must(struct archive *archive, int result)
{
	if (result != 0) {
		fprintf(stderr, "bench: %s\n", archive_message(archive));
		exit(1);
	}
	archive_close(archive);
}

void bench_archive_list(void *context)
{
	struct archive_filter filter = archive_filter_none();
	struct archive *archive = open_it(ARCHIVE_READ);

	(void)context;
	must(archive, print_series(archive, &filter, TABLE_TEXT, nowhere));
}

void bench_archive_filter(void *context)
{
	struct archive_filter filter = archive_filter_none();
	struct archive *archive = open_it(ARCHIVE_READ);

	(void)context;
	filter.angle_deg = 25;
	filter.from = "2026-05-02";
	filter.to = "2026-05-04";
	must(archive, print_drops(archive, &filter, false, TABLE_TEXT, nowhere));
}

void bench_archive_text(void *context)
{
	struct archive_filter filter = archive_filter_none();
	struct archive *archive = open_it(ARCHIVE_READ);

	(void)context;
	filter.text = "CABLE bench";
	must(archive, print_drops(archive, &filter, false, TABLE_JSON, nowhere));
}

void bench_archive_newest(void *context)
{
	struct archive_filter filter = archive_filter_none();
	struct archive *archive = open_it(ARCHIVE_READ);

	(void)context;
	filter.text = "cable";
	filter.limit = 100;
	must(archive, print_series(archive, &filter, TABLE_JSON, nowhere));
}

void bench_archive_tables(void *context)
{
	struct archive_filter filter = archive_filter_none();
	struct archive *archive = open_it(ARCHIVE_READ);

	(void)context;
	must(archive, print_tables(archive, &filter, false, NULL, TABLE_JSON, nowhere));
}
