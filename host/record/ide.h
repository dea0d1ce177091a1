/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_IDE_H
#define DT_HOST_RECORD_IDE_H
/*
 * What an IDE file of enDAQ (a Mide recording: EBML of document type "mide") says of its channels, and where
 * their blocks are. Layout and meaning: github.com/MideTechnology/idelib.
 *
 * A channel has subchannels, whose numbers stand together in each sample. Number to unit: the polynomial of
 * the channel, then that of the subchannel; one of two variables takes the second from another subchannel, a
 * temperature, at that time. A block has the times of its first and last sample in ticks of the channel's own
 * clock, which roll over.
 *
 * The bytes are borrowed from the source. Memory belongs to the ide: ide_free.
 */
#include "host/record/ebml.h"
#include "host/record/table_data.h"

enum { IDE_CHANNELS = 64, IDE_SUBS = 16, IDE_POLYNOMIALS = 256, IDE_COEFFICIENTS = 12 };

struct ide_polynomial {
	unsigned id, channel, sub; /* the second variable */
	bool bivariate;
	double reference, reference2;
	double coefficient[IDE_COEFFICIENTS]; /* from the highest degree; a x y, b x, c y, d */
	size_t coefficients;
	char unit[32]; /* of what it gives, "" where it does not say */
};

struct ide_number {
	enum bytes_kind kind;
	size_t at; /* within a sample */
};

struct ide_sub {
	char name[64], unit[32];
	unsigned id, calibrated; /* how many calibrations it names; then the last */
	unsigned calibration;
};

struct ide_block {
	double first,
	        last; /* ticks, rollovers counted, of its first and last sample; last is NAN if not told */
	size_t samples;
	const char *data;
};

struct ide_channel {
	unsigned id, calibrated, calibration;
	char name[64], format[32], parser[32], scale[32], rate[32];
	bool big, has_number[IDE_SUBS];
	struct ide_number number[IDE_SUBS]; /* those of a sample */
	size_t sample_bytes, subs;
	struct ide_sub sub[IDE_SUBS];
	double tick_s, rate_hz; /* rate 0: not told */
	uint64_t modulus;
	double latest, rolled; /* ticks: of the block before */
	struct ide_block *block;
	size_t blocks, room;
	bool used;         /* a block of it is in the file */
	const char *wrong; /* why its blocks cannot be read; NULL where they can */
};

struct ide {
	const struct source *source;
	char *message;
	struct ide_channel channel[IDE_CHANNELS];
	struct ide_polynomial polynomial[IDE_POLYNOMIALS];
	size_t channels, polynomials;
	double latest_s; /* of all blocks so far */
};

/* Whether a file with this beginning is one. */
bool ide_is(const struct source *source);

/* 0, or an error told in message. */
DT_MUST_USE int ide_take(struct ide *ide);
void ide_free(struct ide *ide);

int ide_refuse(const struct ide *ide, const char *why);

/* NULL where there is none. */
const struct ide_channel *ide_channel(const struct ide *ide, unsigned id);
const struct ide_polynomial *ide_polynomial(const struct ide *ide, unsigned id);

#endif
