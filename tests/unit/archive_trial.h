/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_ARCHIVE_TRIAL_H
#define DT_TESTS_ARCHIVE_TRIAL_H
/*
 * An archive to try things on, in a folder of its own for each test. What goes wrong fails the test.
 */
#include <cjson/cJSON.h>
#include <sqlite3.h>

#include "host/archive/print.h"

#define TRIAL_SCENE "common/scenes/geometry-2A.ini"
#define TRIAL_BARE "common/scenes/geometry-1.ini"

/* FIPS 180-4: SHA-256 of "abc" */
#define TRIAL_HASH_OF_ABC "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"

#define IN_A_TRIAL(test) cmocka_unit_test_setup_teardown(test, trial_make_folder, trial_remove_folder)

extern char trial_folder[64];
extern char trial_message[ARCHIVE_MESSAGE_MAX]; /* of archive_open */

int trial_make_folder(void **state);
int trial_remove_folder(void **state);

struct archive *trial_open(enum archive_mode mode);

/* A new archive with this series: TRIAL_SCENE at 25 degrees, five drops planned, in the campaign "trial". */
struct archive *trial_with_series(const char *name);

void trial_write_log(const struct archive_recording *r, const char *text);

/* A drop whose log is text, by Ann; its number. */
unsigned trial_record(struct archive *archive, const char *series, const char *text);

/* What an analysis would say, with these peaks. */
void trial_result(struct archive *archive, const char *drop, const char *version, double s1x, double s2x);

/* The first drop that passes; its texts are copied. */
struct trial_seen {
	int count;
	char state[16], decision[16], hash[72], raw[160], version[64], flags[64], reason[64];
	double s1x, s2x, s2r, sigma;
	unsigned not_ok;
	bool simulated;
};

int trial_see(void *context, const struct archive_drop *drop);
struct trial_seen trial_look(struct archive *archive, const char *series, unsigned number,
                             const char *version);

/* What `series drops` prints, else `series list`; to be freed. */
char *trial_printed(struct archive *archive, const struct archive_filter *filter, enum table_format format,
                    bool drops);

sqlite3 *trial_index(void); /* to be closed */
void trial_sql(const char *text);

/* Adds to the int that context is. */
void trial_count(void *context, const char *text);

#endif
