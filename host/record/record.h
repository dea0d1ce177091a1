/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_RECORD_H
#define DT_HOST_RECORD_RECORD_H
/*
 * A record: one drop, or one foreign recording, as channels at their native rates. Everything that
 * reads (live frames, candump, LCM, CSV, delimited text) ends here, everything that analyses starts here.
 *
 * Memory belongs to the record: record_init, fill, record_free. No thread safety needed or given.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "common/wire.h"
#include "host/base/mapped.h"

/* What is known of one sample; 0 is a good one. A sample keeps its place whatever it is. */
enum {
	SAMPLE_LOST = 1u << 0, /* its frame never came; value is NAN */
	SAMPLE_BAD =
	        1u << 1, /* the firmware marked it not taken, or the file holds no number; value is NAN */
	SAMPLE_CLIPPED = 1u << 2, /* beyond the sensor's range or at full scale; value as read */
	SAMPLE_SPIKE = 1u << 3,   /* an outlier of one or two samples: set by the analysis */
};

/* What is remarkable about a channel or a record. Bits; names by record_flag_name. */
enum {
	RECORD_FLAG_LOST = 1u << 0,       /* "lost_samples" */
	RECORD_FLAG_BAD = 1u << 1,        /* "bad_samples" */
	RECORD_FLAG_CLIPPED = 1u << 2,    /* "clipped" */
	RECORD_FLAG_INCOMPLETE = 1u << 3, /* "incomplete": the capture's CRC-32 could not be reached */
	RECORD_FLAG_NO_CRC = 1u << 4,     /* "crc_unknown": frames, but no capture end */
	RECORD_FLAG_SLOW_FRAME = 1u << 5, /* "slow_frame" */
	RECORD_FLAG_NO_IMPACT = 1u << 6,  /* "no_impact" */
	RECORD_FLAG_FAULT = 1u << 7,      /* "fault" */
	RECORD_FLAG_UNEVEN = 1u << 8, /* "uneven_sampling": the time column is a little off an even grid */
	RECORD_FLAG_FULL_SCALE = 1u << 9,  /* "full_scale" */
	RECORD_FLAG_OVERRUN = 1u << 10,    /* "overrun" */
	RECORD_FLAG_ZERO_SHIFT = 1u << 11, /* "zero_shift": offset after the drop not the one before */
	RECORD_FLAG_CABLE = 1u << 12,      /* "cable": a sensor's bias was lost */
	RECORD_FLAG_STUCK =
	        1u << 13, /* "stuck": a channel gave one value for 20 ms, or held one on a flank */
	/* found by the analysis, and cured where it says so */
	RECORD_FLAG_SPIKE = 1u << 14,  /* "spike": outliers of one or two samples, left out */
	RECORD_FLAG_ZEROED = 1u << 15, /* "zeroed": a run of exact zeros in a signal that is not; left out */
	RECORD_FLAG_OFFSET = 1u << 16, /* "offset": zero is far from zero before the pulse; taken off */
	RECORD_FLAG_DRIFT = 1u << 17,  /* "drift": zero moves before the pulse; taken off */
	RECORD_FLAG_HUM = 1u << 18,    /* "hum": mains or another hum shows before the pulse; taken off */
	RECORD_FLAG_SHORT = 1u << 19,  /* "too_short": ends inside its pulse, or has hardly a sample */
	RECORD_FLAG_ZERO_UNSURE = 1u << 20, /* "zero_unsure": more than noise before the pulse */
	RECORD_FLAG_UNFILTERED = 1u << 21, /* "unfiltered": too slow for the low-pass asked for, left alone */
	RECORD_FLAG_SETTLING =
	        1u << 24, /* "settling": zero decays from the record's beginning on; taken off */
	/* of foreign text */
	RECORD_FLAG_NO_LINE_END = 1u << 22, /* "no_line_end": the last row may be cut */
	RECORD_FLAG_SAME_NAMES = 1u << 23,  /* "same_names": two columns are named alike in the file */
	/* of a drop by our tower */
	RECORD_FLAG_ALTERED = 1u << 25, /* "altered": the capture end or the parameters are not what their
	                                   checksum is of */
	RECORD_FLAG_SEPARATED_LATE = 1u << 26,  /* "separated_late" */
	RECORD_FLAG_DROPOUT_CHANGED = 1u << 27, /* "dropout_changed": of the magnet */
	RECORD_FLAG_FRAME_NOT_DOWN = 1u << 28,  /* "frame_not_down" */
	RECORD_FLAG_ASSUMED = 1u << 29, /* "assumed": of foreign text, the unit of time; read_as says which */
	/* of the sensors' files */
	RECORD_FLAG_OVERDUE = 1u << 30,      /* "overdue": a calibration was due before the drop */
	RECORD_FLAG_DEFAULT_USED = 1u << 31, /* "default_used": an uncertainty is not in the file */
};

struct channel {
	char name[32];     /* "S1X", or the name given in --columns */
	uint8_t sensor;    /* of our tower: 1 or 2; 0 of another, whatever its name (drop_set_axes) */
	char axis;         /* of it: 'X' 'Y' 'Z'; else 0 */
	double rate_hz;    /* native rate */
	double start_s;    /* time of sample 0, s after the record's first instant; sample k is at start_s +
	                      k/rate_hz */
	size_t count;      /* samples */
	double *value_g;   /* [count]; NAN where SAMPLE_LOST or SAMPLE_BAD */
	uint8_t *sample;   /* [count], SAMPLE_* bits */
	double range_g;    /* sensor range when known, else 0 */
	double highpass_s; /* time constant of its supply by its sensor's file; 0: not known */
	unsigned flags;    /* RECORD_FLAG_* */
};

enum { RECORD_PART = 1 << 14 }; /* samples of a pass through a channel, then mapped_seen is told */

/* Of a pass at sample k: tells that at each part's beginning, of so many bytes a sample. */
static inline void record_seen(size_t k, size_t bytes)
{
	if (k % RECORD_PART == 0)
		mapped_seen(RECORD_PART * bytes);
}

struct record_gap {
	unsigned sensor;        /* 1 or 2 */
	uint32_t first_tick_ms; /* inclusive */
	uint32_t last_tick_ms;
};

enum { RECORD_PARAMETERS_ALL = (1 << WIRE_PARAMETERS) - 1 }; /* of parameters_held */
_Static_assert(WIRE_PARAMETERS < 31, "a bit for each");

/* What happened to the frames of the capture on their way. */
struct record_counters {
	uint64_t blocks;    /* distinct blocks held */
	uint64_t repeated;  /* a block that was already there */
	uint64_t reordered; /* a live block that came after a newer one of its sensor */
	uint64_t corrupt;   /* CRC-8 or length does not agree, a segment is missing, or what a log holds is no
	                       frame; not used */
	uint64_t gaps;      /* runs of ticks that were missing when the capture end came */
	uint64_t resent;    /* blocks that came on request, needed or not */
	uint64_t conflicting; /* repeated with other samples: the first is kept */
};

struct record {
	char file[4096];   /* as given on the command line, or the link's URL */
	char format[16];   /* "live" "candump" "lcm" "csv" "uff58" "hdf5" "delimited" "lvm" ... */
	char read_as[400]; /* of a foreign file, what was understood of it without --columns; else "" */
	int64_t time_s;    /* when it was made, since 1970; 0: not known */
	char operator_name[64], scene[64], sensors[64]; /* who dropped it, the scene's name, serial numbers of
	                                                 * sensors; "": not known */
	uint16_t simulated;                             /* 1: no product fell */
	unsigned shock, shocks; /* of a long record: which of its shocks this is a stretch about; else 0 */
	bool file_sealed;       /* the file says its own SHA-256, and that is so */
	struct channel *channels;
	size_t channel_count;

	/* Of a drop by our tower; zero for foreign recordings. */
	bool is_drop;
	unsigned log_number; /* which of the drops of its log, from 1; 0: it is the only one */
	uint16_t drop_id;
	uint16_t marks; /* WIRE_MARK_* */
	uint32_t first_tick_ms, last_tick_ms;
	double trigger_s;       /* after the first instant; NAN if unknown */
	uint32_t trigger_us;    /* as sent, where trigger_s is not known; if crc_known */
	double frame_speed_m_s; /* between the gates; NAN if unknown */
	uint32_t crc32;         /* as sent in the capture end */
	int16_t camera_frame;   /* video frame, 1 000 a second, at the first instant; if crc_known */
	bool crc_known, crc_agrees;
	bool seal_known, seal_agrees;
	uint32_t seal;             /* as sent in the capture end: checksum of all of it */
	uint32_t parameters_crc32; /* of the set that the drop was made with; if crc_known */
	uint32_t parameters_held;  /* bit i: parameters[i] has come; none if one lacks, or the end */
	uint32_t parameters[WIRE_PARAMETERS];
	bool parameters_known; /* all of them, and their CRC-32 agrees; drop_close finds out */
	bool measured_known;   /* what the drop has measured of its tower */
	struct wire_measured measured;
	struct record_counters counters;
	struct record_gap *gaps; /* what stayed missing */
	size_t gap_count;

	uint64_t lost_samples; /* over all channels */
	unsigned flags;        /* RECORD_FLAG_*, union over channels and the drop's own */
};

void record_init(struct record *record);
void record_free(struct record *record);

/* Appends an empty channel with room for count samples, all SAMPLE_LOST; NULL without memory. The pointer
 * is valid until the next call. Of record_add_room who calls it fills all samples and marks. */
struct channel *record_add_channel(struct record *record, const char *name, double rate_hz, size_t count);
struct channel *record_add_room(struct record *record, const char *name, double rate_hz, size_t count);

/* Whether it is a drop from a file that should say its SHA-256 and does not: by an older version, or by
 * another program. Logs have the capture's CRC-32 instead. */
bool record_lacks_seal(const struct record *record);

/* NULL if there is none of that name. */
const struct channel *record_channel(const struct record *record, const char *name);

/* That of our tower which measured this: "S1X" to "S2Z". NULL if there is none: a name alone is none. */
const struct channel *record_axis(const struct record *record, const char *which);

/* The earliest channel begins at 0, whenever a foreign clock began. */
void record_begin_at_zero(struct record *record);

/* Recomputes lost_samples and every flag that follows from samples, gaps, CRC and marks. Readers call it
 * last. */
void record_finish(struct record *record);

/* Name of the lowest flag bit in flags; "" for 0. */
const char *record_flag_name(unsigned flags);

#endif
