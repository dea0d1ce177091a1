/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "tests/unit/archive_trial.h"
#include "tests/unit/scratch.h"

char trial_folder[64];
char trial_message[ARCHIVE_MESSAGE_MAX];

int trial_make_folder(void **state)
{
	(void)state;
	return mkdtemp(scratch_name(trial_folder, "archive")) == NULL;
}

int trial_remove_folder(void **state)
{
	char command[100];

	(void)state;
	snprintf(command, sizeof(command), "rm -rf %s", trial_folder);
	return system(command);
}

struct archive *trial_open(enum archive_mode mode)
{
	struct archive *archive = archive_open(trial_folder, mode, trial_message);

	if (archive == NULL)
		fail_msg("%s", trial_message);
	return archive;
}

struct archive *trial_with_series(const char *name)
{
	struct archive *archive = trial_open(ARCHIVE_CREATE);

	assert_int_equal(archive_new_series(archive, name, "trial", TRIAL_SCENE, 25, NAN, NULL, 5), 0);
	return archive;
}

void trial_write_log(const struct archive_recording *r, const char *text)
{
	FILE *out = fopen(r->log, "a");

	assert_non_null(out);
	fputs(text, out);
	assert_int_equal(fclose(out), 0);
}

unsigned trial_record(struct archive *archive, const char *series, const char *text)
{
	struct archive_recording r;

	assert_int_equal(archive_begin(archive, series, "Ann", ".log", false, &r), 0);
	trial_write_log(&r, text);
	assert_int_equal(archive_finish(archive, &r, 0, ""), 0);
	return r.number;
}

void trial_result(struct archive *archive, const char *drop, const char *version, double s1x, double s2x)
{
	struct channel channels[] = {{.name = "S1X", .rate_hz = 7000}, {.name = "S2X", .rate_hz = 7000}};
	struct record record = {.channels = channels, .channel_count = 2};
	struct estimate_channel estimates[] = {
	        {.peak = {.value_g = s1x, .sigma_g = 0.5}},
	        {.peak = {.value_g = s2x, .sigma_g = NAN, .how = {.status = ESTIMATE_CLIPPED}},
	         .flags = RECORD_FLAG_CLIPPED},
	};
	struct analysis analysis = {.channels = estimates,
	                            .channel_count = 2,
	                            .resultants = {{.sensor = "S2", .peak_g = 7.5, .sigma_g = 1}},
	                            .resultant_count = 1};
	struct estimate_options options = {.tolerance = 0};
	struct result said = result_of(&record, &analysis, &options);
	char json[700];

	snprintf(json, sizeof(json),
	         "{\"quantities\":\"%s\",\"flags\":[\"clipped\"],\"channels\":[{\"name\":\"S1X\",\"rate_hz\":"
	         "7000,\"flags\":[],"
	         "\"peak\":{\"value_g\":%.17g,"
	         "\"sigma_g\":0.5,\"status\":\"ok\"}},{\"name\":\"S2X\",\"rate_hz\":7000,\"flags\":"
	         "[\"clipped\"],\"peak\":{"
	         "\"value_g\":%.17g,\"sigma_g\":null,\"status\":\"clipped\"}}],\"resultants\":[{\"sensor\":"
	         "\"S2\","
	         "\"peak_g\":7.5,\"sigma_g\":1,\"status\":\"ok\"}],\"lag\":null,\"plate\":null}",
	         quantity_version(), s1x, s2x);
	assert_int_equal(archive_result(archive, drop, version, &said, json), 0);
}

int trial_see(void *context, const struct archive_drop *drop)
{
	struct trial_seen *seen = context;

	if (seen->count++ > 0)
		return 0;
	snprintf(seen->state, sizeof(seen->state), "%s", drop->state);
	snprintf(seen->decision, sizeof(seen->decision), "%s", drop->decision);
	snprintf(seen->hash, sizeof(seen->hash), "%s", drop->sha256);
	snprintf(seen->raw, sizeof(seen->raw), "%s", drop->raw);
	snprintf(seen->flags, sizeof(seen->flags), "%s", drop->flags);
	snprintf(seen->reason, sizeof(seen->reason), "%s", drop->reason);
	snprintf(seen->version, sizeof(seen->version), "%s", drop->version != NULL ? drop->version : "none");
	seen->s1x = drop->value[ARCHIVE_S1_X];
	seen->s2x = drop->value[ARCHIVE_S2_X];
	seen->s2r = drop->value[ARCHIVE_S2_R];
	seen->sigma = drop->sigma[ARCHIVE_S1_X];
	seen->not_ok = drop->not_ok;
	seen->simulated = drop->simulated;
	return 0;
}

struct trial_seen trial_look(struct archive *archive, const char *series, unsigned number,
                             const char *version)
{
	struct archive_filter filter = archive_filter_none();
	struct trial_seen seen = {.count = 0};

	filter.series = series;
	filter.number = number;
	filter.version = version;
	assert_int_equal(archive_each_drop(archive, &filter, trial_see, &seen), 0);
	return seen;
}

char *trial_printed(struct archive *archive, const struct archive_filter *filter, enum table_format format,
                    bool drops)
{
	char *text = NULL;
	size_t size;
	FILE *out = open_memstream(&text, &size);

	assert_non_null(out);
	if (drops)
		assert_int_equal(print_drops(archive, filter, true, format, out), 0);
	else
		assert_int_equal(print_series(archive, filter, format, out), 0);
	fclose(out);
	return text;
}

sqlite3 *trial_index(void)
{
	char path[128];
	sqlite3 *index;

	snprintf(path, sizeof(path), "%s/index.sqlite", trial_folder);
	assert_int_equal(sqlite3_open(path, &index), SQLITE_OK);
	return index;
}

void trial_sql(const char *text)
{
	sqlite3 *index = trial_index();
	char *why = NULL;

	if (sqlite3_exec(index, text, NULL, NULL, &why) != SQLITE_OK)
		fail_msg("%s", why);
	sqlite3_close(index);
}

void trial_count(void *context, const char *text)
{
	(void)text;
	(*(int *)context)++;
}
