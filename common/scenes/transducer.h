/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_COMMON_SCENES_TRANSDUCER_H
#define DT_COMMON_SCENES_TRANSDUCER_H
/*
 * A sensor with its measuring chain, by serial number, read from an .ini file: what its certificate says, how
 * it is wired, and how unsure that is. Linux side only. The keys stand in transducer.def. A sensor is data:
 * what is done with it is the host's (host/sensor).
 */
#include <stdbool.h>

#include "common/scenes/settings.h"

enum { TRANSDUCER_AXES = 3, TRANSDUCER_TEXT_MAX = 120, TRANSDUCER_NAME_MAX = 32 };

enum transducer_filter { TRANSDUCER_NO_FILTER, TRANSDUCER_BUTTERWORTH, TRANSDUCER_BESSEL };

struct transducer {
#define TRANSDUCER_TEXT(section, key, NEED, doc) char section##_##key[TRANSDUCER_TEXT_MAX];
#define TRANSDUCER_KEY(section, key, min, max, initial, NEED, doc) double section##_##key;
#include "common/scenes/transducer.def"
	/* what follows from these */
	char channel[TRANSDUCER_AXES][TRANSDUCER_NAME_MAX]; /* of X, Y, Z; "": none */
	enum transducer_filter filter;
	bool has_matrix;
	bool default_used; /* an uncertainty that the file should give is taken from transducer.def */
};

/* Reads and checks a file. 0, or DT_E_* with "FILE:LINE: what is wrong, what was expected" in message and
 * *transducer unchanged. */
DT_MUST_USE int transducer_read(struct transducer *transducer, const char *file,
                                char message[SETTINGS_MESSAGE_MAX]);

/* Of the key's three values that of an axis: sensitivity, scaled, polarity, cutoff, skew. */
#define TRANSDUCER_OF(transducer, first, axis) ((&(transducer)->first)[axis])

/* What an axis reads of another, by the matrix. */
double transducer_reads(const struct transducer *transducer, unsigned axis, unsigned other);

#endif
