/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_LOG_WALK_H
#define DT_HOST_RECORD_LOG_WALK_H
/*
 * A log from one end to the other in constant memory: every capture in its order, complete or not, drops that
 * began and never ended, and what else happened to the tower. candump text and LCM event logs alike; what is
 * their own stands in read_candump.c and read_lcm.c, which feed the walk.
 */
#include "host/record/log_capture.h"
#include "host/record/join.h"
#include "host/record/log_file.h"

struct log_event {
	enum log_event_kind {
		LOG_START,      /* the tower started, or started again */
		LOG_FAULT,      /* latched; fault 0: cleared */
		LOG_HEARTBEATS, /* of the tower, since it started or the log began */
	} kind;
	uint64_t at; /* byte of the log */
	int64_t time_us;
	unsigned fault, emcy; /* WIRE_FAULT_*, CiA 301 error code */
	uint32_t tick_ms;     /* of the fault */
	uint64_t count;       /* of heartbeats; the last came at time_us */
	int64_t first_us, longest_us;
};

enum { LOG_EVERY = 0xFFFFFFFFu };

struct log_visitor {
	void *context;
	unsigned wanted; /* number of the capture that comes with its record, LOG_EVERY, or 0: none */

	/* *record belongs to who is called, and is NULL when it is not wanted or no block is held. What is
	 * returned ends the walk if it is not 0. */
	int (*capture)(void *context, const struct log_capture *capture, struct record *record);
	int (*event)(void *context, const struct log_event *event); /* may be NULL */
};

/* What was in the log, for those who found no capture. */
struct log_contents {
	unsigned captures;
	uint64_t frames; /* or events */
	uint64_t refused;
	uint64_t first_refused; /* line */
	unsigned column;
};

/* The bytes [from, to) of a log; a walk of the whole log begins at 0 and ends at log->size. 0, what the
 * visitor returned, or DT_E_* told in message. */
DT_MUST_USE int log_walk(struct log_file *log, uint64_t from, uint64_t to, struct log_visitor *visitor,
                         struct log_contents *contents, char message[READ_MESSAGE_MAX]);

/* Whether it is such a log, by its head. */
bool log_is(struct log_file *log);

/* "candump" or "lcm". */
const char *log_format(struct log_file *log);

/* ---- for read_candump.c and read_lcm.c ---- */

enum { LOG_PLACES = 64 };

struct log_place {
	uint64_t at;
	bool known;
	uint32_t tick_ms; /* newest block before it */
};

/* A bus that the tower was heard on last, of a log that names it. */
enum { LOG_BUS_MAX = 16 };
struct log_bus {
	char name[LOG_BUS_MAX];
	int64_t time_us;
};

struct log_walk {
	struct log_visitor *visitor;
	struct log_contents *contents;
	struct join *join;
	const char *file;
	char *message; /* READ_MESSAGE_MAX */
	int result;    /* not 0 ends the walk */
	bool no_memory;

	/* the frame or message at hand */
	uint64_t at, next;
	int64_t time_us;
	uint64_t corrupt; /* what was none, since the last capture */

	/* places to begin reading at, of this run and behind the last capture; the newest at place_count - 1
	 */
	struct log_place place[LOG_PLACES];
	unsigned place_count;
	bool end_in_segments;
	uint64_t end_at; /* of a capture end that comes in segments */

	/* the last capture that ended; the join has it, or it is held */
	struct log_capture ended;
	bool ended_in_run; /* of the tower */
	bool tail_open;    /* what comes belongs to it, too */
	uint64_t tail_at;  /* where the last frame of it ended */

	/* a drop in motion that has not ended yet: blocks tell, or the status where none are live */
	bool live;
	bool begun;
	uint16_t begun_drop;
	uint16_t armed_drop; /* the number that ARM was answered with last */

	/* given to the visitor when it is known what follows */
	bool has_held, held_is_ended;
	struct log_capture held;
	struct record *held_record;
	struct record record;
	unsigned number;

	struct log_event heartbeats;
	struct log_bus bus, bus_before;
	unsigned bus_returns; /* from one of the two to the other and back, without a pause */
	struct log_capture_parameters parameters;
	struct wire_sdo request;
};

/* Whether the drop of the next message may have to come with its samples. */
bool log_walk_may_want(const struct log_walk *walk);
void log_walk_frame(struct log_walk *walk, const struct frame *frame);
/* The record belongs to it from here on, and needs its samples only if log_walk_may_want. */
void log_walk_drop(struct log_walk *walk, struct record *record);
/* Behind a drop that log_walk_drop was given: its message is what was sealed. It ends where the seal does. */
void log_walk_sealed(struct log_walk *walk);
/* A value of metadata.h that any record can have, of the same drop. DT_E_FORMAT: none; DT_E_RANGE: not as it
 * is. */
DT_MUST_USE int log_walk_told(struct log_walk *walk, const char *name, const char *value);
/* Or it is not what was sealed: the walk ends with DT_E_CORRUPT. */
void log_walk_altered(struct log_walk *walk, const char *found, const char *expected);

void read_candump(struct log_walk *walk, struct log_file *log, uint64_t from, uint64_t to);
void read_lcm(struct log_walk *walk, struct log_file *log, uint64_t from, uint64_t to);
bool candump_is(struct log_file *log);

#endif
