/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/sensor/sensors.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "common/base/date.h"
#include "common/scenes/scene.h"
#include "host/sensor/lowpass.h"

#define DAYS_A_YEAR 365.25

/* "S1" of S1X S1Y S1Z, else of the serial number as much as there is room for. */
static void sensors_name(struct sensor_used *used)
{
	const struct transducer *t = &used->transducer;
	const char *stem = NULL;
	size_t length = 0;

	for (size_t i = 0; i < TRANSDUCER_AXES; i++) {
		const char *channel = t->channel[i];
		size_t here = strlen(channel);

		if (here == 0)
			continue;
		if (here < 2 ||
		    (stem != NULL && (here != length + 1 || strncmp(stem, channel, length) != 0))) {
			stem = NULL;
			break;
		}
		stem = channel;
		length = here - 1;
	}
	if (stem == NULL || length >= sizeof(used->name))
		snprintf(used->name, sizeof(used->name), "%.7s", t->sensor_serial);
	else
		snprintf(used->name, sizeof(used->name), "%.*s", (int)length, stem);
}

/* A file as it was read last: of thousands of drops each has the same. Another time or size: read again. */
struct known_file {
	char name[SETTINGS_MESSAGE_MAX], digest[DIGEST_CHARS];
	struct stat status;
	struct transducer transducer;
};

static bool is_known(const struct known_file *known, const char *file, const struct stat *now)
{
	const struct stat *then = &known->status;

	return strcmp(known->name, file) == 0 && then->st_ino == now->st_ino && then->st_dev == now->st_dev &&
	       then->st_size == now->st_size && then->st_mtim.tv_sec == now->st_mtim.tv_sec &&
	       then->st_mtim.tv_nsec == now->st_mtim.tv_nsec && then->st_ctim.tv_sec == now->st_ctim.tv_sec &&
	       then->st_ctim.tv_nsec == now->st_ctim.tv_nsec;
}

static int sensors_file(struct sensor_used *used, size_t place, const char *file,
                        char message[SETTINGS_MESSAGE_MAX])
{
	static _Thread_local struct known_file known[SENSORS_MAX];
	struct known_file *k = &known[place];
	struct stat now;
	int64_t bytes;
	bool there = stat(file, &now) == 0;
	int result;

	if (!there || !is_known(k, file, &now)) {
		k->name[0] = '\0';
		result = transducer_read(&k->transducer, file, message);
		if (result != 0)
			return result;
		if (digest_file(file, k->digest, &bytes, -1) != 0) {
			snprintf(message, SETTINGS_MESSAGE_MAX, "%.300s: %s", file, strerror(errno));
			return DT_E_SYSTEM;
		}
		k->status = now;
		if (there)
			snprintf(k->name, sizeof(k->name), "%s", file);
	}
	used->transducer = k->transducer;
	memcpy(used->digest, k->digest, sizeof(k->digest));
	return 0;
}

static int sensors_add(struct sensors *sensors, const char *file, double day,
                       char message[SETTINGS_MESSAGE_MAX])
{
	struct sensor_used *used = &sensors->used[sensors->count];
	const struct transducer *t = &used->transducer;
	double calibrated = 0.0, due = 0.0;
	int result = sensors_file(used, sensors->count, file, message);

	if (result != 0)
		return result;
	used->serial = t->sensor_serial;
	used->model = t->sensor_model;
	used->certificate = t->calibration_certificate;
	used->laboratory = t->calibration_laboratory;
	used->date = t->calibration_date;
	used->due = t->calibration_due;
	used->file_sha256 = used->digest;
	(void)date_days(used->date, &calibrated); /* checked on reading */
	(void)date_days(used->due, &due);
	used->age_years = fmax(0.0, day - calibrated) / DAYS_A_YEAR;
	used->overdue = floor(day) > due;
	used->e_n = (double)NAN;
	used->default_used = t->default_used;
	sensors_name(used);
	sensors->count++;
	return 0;
}

int sensors_read(struct sensors *sensors, const char *list, double day, char message[SETTINGS_MESSAGE_MAX])
{
	char file[SETTINGS_MESSAGE_MAX];
	size_t length;
	int result = 0;

	sensors->count = 0;
	for (const char *at = list; result == 0 && (length = scene_chain_file(&at)) > 0; at += length) {
		if (sensors->count == SENSORS_MAX || length >= sizeof(file)) {
			snprintf(message, SETTINGS_MESSAGE_MAX, "%.300s: expected at most %d sensor files",
			         list, SENSORS_MAX);
			return DT_E_ARGUMENT;
		}
		snprintf(file, sizeof(file), "%.*s", (int)length, at);
		result = sensors_add(sensors, file, day, message);
	}
	return result;
}

void sensors_serials(const struct sensors *sensors, char text[], size_t size)
{
	size_t used = 0;

	text[0] = '\0';
	for (size_t i = 0; i < sensors->count && used < size; i++)
		used += (size_t)snprintf(text + used, size - used, "%s%s %s", i > 0 ? ";" : "",
		                         sensors->used[i].name, sensors->used[i].serial);
}

const struct sensor_used *sensors_of(const struct sensors *sensors, const char *channel, unsigned *axis)
{
	for (size_t s = 0; s < sensors->count; s++)
		for (unsigned i = 0; i < TRANSDUCER_AXES; i++)
			if (channel[0] != '\0' &&
			    strcmp(sensors->used[s].transducer.channel[i], channel) == 0) {
				*axis = i;
				return &sensors->used[s];
			}
	return NULL;
}

double sensors_delay_s(const struct transducer *t, unsigned axis)
{
	return lowpass_delay_s(t->filter, (unsigned)t->chain_order,
	                       TRANSDUCER_OF(t, chain_cutoff_x_hz, axis)) +
	       TRANSDUCER_OF(t, chain_skew_x_us, axis) * 1e-6;
}
