/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_UFF58_H
#define DT_HOST_RECORD_UFF58_H
/*
 * What reader and writer of universal files share. The format: "Universal Dataset Number 58, Function at
 * Nodal DOF", revision of 30 June 1999, Structural Dynamics Research Laboratory, University of Cincinnati.
 */
#include <stdio.h>

#include "host/record/source.h"

/* Numbers of the format. */
enum {
	UFF58_UNKNOWN = 0,       /* function type, quantity */
	UFF58_TIME_RESPONSE = 1, /* function type */
	UFF58_GENERAL = 1,       /* quantity */
	UFF58_ACCELERATION = 12, /* quantity */
	UFF58_TIME = 17,         /* quantity */
	UFF58_SINGLE = 2,        /* real data, 13 columns a number */
	UFF58_DOUBLE = 4,        /* real data, 20 columns a number */
	UFF58_DOUBLES = 4,       /* of them in a line */
	UFF58_ID_CHARS = 80,
};

/* How the second identification line of ours begins. */
#define UFF58_OWN "droptower 1 "

/* What of a sample's state is stored: what the analysis finds is found again. */
enum { UFF58_MASK = SAMPLE_LOST | SAMPLE_BAD | SAMPLE_CLIPPED };

/* Begins with a delimiter and a dataset's number in their columns. */
bool uff58_is(const struct source *source);

DT_MUST_USE int read_uff58(struct record *record, const struct source *source,
                           char message[READ_MESSAGE_MAX]);

/* With an empty seal. 0; DT_E_ARGUMENT if a channel's name cannot be written; DT_E_SYSTEM if out did not take
 * it all. */
DT_MUST_USE int write_uff58(const struct record *record, FILE *out);

#endif
