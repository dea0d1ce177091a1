/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/report/laboratory.h"

#include <string.h>

#include "common/plain.h"
#include "common/base/date.h"

const struct laboratory_row laboratory_rows[LABORATORY_FIELDS] = {
#define LABORATORY_FIELD(section, key, clause, need, label) {#section, #key, clause, need, label},
#include "host/report/laboratory.def"
#undef LABORATORY_FIELD
};

struct laboratory_reading {
	struct settings settings;
	struct laboratory *laboratory;
};

static bool is_date_field(size_t field)
{
	return field == LABORATORY_report_issued || field == LABORATORY_item_received;
}

static int laboratory_entry(struct settings *settings, const char *section, const char *name,
                            const char *value)
{
	struct laboratory_reading *reading = (struct laboratory_reading *)settings;

	for (size_t i = 0; i < LABORATORY_FIELDS; i++) {
		char *text = reading->laboratory->text[i];

		if (strcmp(section, laboratory_rows[i].section) != 0 ||
		    strcmp(name, laboratory_rows[i].key) != 0)
			continue;
		if (text[0] != '\0')
			return settings_fail(settings, DT_E_FORMAT, "%.60s is given twice", name);
		if (strlen(value) > LABORATORY_TEXT_MAX || !plain_is_line(value, strlen(value)))
			return settings_fail(settings, DT_E_FORMAT,
			                     "%.60s is no line of at most %d bytes of UTF-8", name,
			                     LABORATORY_TEXT_MAX);
		if (is_date_field(i) && !date_is_day(value))
			return settings_fail(settings, DT_E_FORMAT, "%.60s is '%.60s', expected YYYY-MM-DD",
			                     name, value);
		memcpy(text, value, strlen(value) + 1);
		return 1;
	}
	if (strcmp(section, "s1") == 0 || strcmp(section, "s2") == 0)
		return settings_fail(settings, DT_E_FORMAT,
		                     "[%s] stands in the sensor's file, which the series' --chain names",
		                     section);
	return settings_fail(settings, DT_E_FORMAT, "unknown key '%.60s' in [%.60s]", name, section);
}

int laboratory_read(struct laboratory *laboratory, const char *file, char message[SETTINGS_MESSAGE_MAX])
{
	struct laboratory_reading reading = {
	        .settings = {.file = file, .message = message, .entry = laboratory_entry},
	        .laboratory = laboratory};

	memset(laboratory, 0, sizeof(*laboratory));
	return settings_read(&reading.settings);
}

unsigned laboratory_missing(const struct laboratory *laboratory)
{
	unsigned missing = 0;

	for (size_t i = 0; i < LABORATORY_FIELDS; i++)
		missing += laboratory_rows[i].needed && laboratory->text[i][0] == '\0';
	return missing;
}
