/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_SENSOR_SENSORS_H
#define DT_HOST_SENSOR_SENSORS_H
/*
 * The sensors of a recording, from their files, and what they say of its channels: put right in one place,
 * before anything is estimated.
 *
 * A channel named in a file is multiplied by what its g were made with over what the certificate says, gain
 * and temperature included, with its polarity; it is moved back in time by its filter's delay and its skew;
 * and what each axis reads of the others is taken off, all three at one instant. The supply's high-pass is
 * left to the estimates, which know zero (channel.highpass_s).
 */
#include "common/scenes/transducer.h"
#include "host/record/digest.h"
#include "host/record/record.h"

enum { SENSORS_MAX = 4 };

/* One of them; for the table of quantities. */
struct sensor_used {
	struct transducer transducer;
	const char *serial, *model, *certificate, *laboratory, *date, *due, *file_sha256; /* of it, and: */
	char digest[DIGEST_CHARS];
	char name[8];     /* "S1": what its channels' names begin with, else the serial number's beginning */
	double age_years; /* of the calibration at the drop */
	double e_n;       /* the largest of its checks by this recording; NAN: none */
	bool overdue, default_used;
};

struct sensors {
	size_t count;
	struct sensor_used used[SENSORS_MAX]; /* must not move */
};

/* Reads the files that list names, with commas or blanks between; day of the drop in days after 1970. 0 or
 * DT_E_* with a line in message. */
DT_MUST_USE int sensors_read(struct sensors *sensors, const char *list, double day,
                             char message[SETTINGS_MESSAGE_MAX]);

/* "S1 12345;S2 12346": names and serial numbers, as a record has them (record.sensors); cut where it is full.
 */
void sensors_serials(const struct sensors *sensors, char text[], size_t size);

/* The one that a channel belongs to, and which axis of it; NULL: none. */
const struct sensor_used *sensors_of(const struct sensors *sensors, const char *channel, unsigned *axis);

/* By how much a channel of it is late, s. */
double sensors_delay_s(const struct transducer *transducer, unsigned axis);

/* A copy of record that is put right; to be freed. DT_E_UNKNOWN: a file names a channel that is not there, or
 * names none that is; DT_E_ARGUMENT: two files name one, or a matrix is singular; DT_E_MEMORY. Message as
 * above. */
DT_MUST_USE int sensors_correct(const struct sensors *sensors, const struct record *record,
                                struct record *corrected, char message[SETTINGS_MESSAGE_MAX]);

#endif
