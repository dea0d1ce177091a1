/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HIL_BENCH_PRIVATE_H
#define DT_HIL_BENCH_PRIVATE_H
/*
 * What the bench's own files share: the state of a run. bench.c is the run as a whole, bench_plant.c moves
 * the tower from request to request, bench_bus.c carries the frames, bench_events.c is what goes wrong and
 * when, bench_foreign.c other hosts than the operator, bench_control.c what happens by word from outside.
 */
#include <math.h>
#include <stdint.h>
#include <stdio.h>

#include "common/link/link.h"
#include "common/ring.h"
#include "common/wire.h"
#include "hil/adc_log.h"
#include "hil/bench.h"
#include "hil/target.h"
#include "hil/tower.h"

enum {
	BENCH_GRID_PER_MS = 70,  /* both sample grids, k/7 and k/10 ms, are whole numbers of this */
	BENCH_QUEUE_FRAMES = 64, /* on their way to the firmware; a power of two */
	BENCH_TAPE_FRAMES = 512, /* of hosts that are kept, to be replayed */
};

struct bench {
	const struct bench_options *options;
	struct bench_watch *watch; /* NULL: nobody looks */
	struct tower *tower;
	struct target *target;
	struct link *link; /* NULL: the script is the host */
	struct script script;
	FILE *log, *truth;
	struct adc_log codes;

	struct busfault to_host, to_tower;
	struct ring queue;
	struct frame queue_storage[BENCH_QUEUE_FRAMES];
	struct tape {
		unsigned count;
		struct frame frame[BENCH_TAPE_FRAMES];
		int64_t ms[BENCH_TAPE_FRAMES];
		unsigned next;   /* to be replayed ... */
		int64_t late_ms; /* ... so long after it was sent */
		bool replayed;   /* nothing more is kept */
	} tape;
	uint16_t bus_errors; /* error reports of the host's link since the answer before */

	int64_t base_grid;  /* virtual time of the firmware's latest reset, 1/70 ms */
	int64_t now_grid;   /* of the present answer ... */
	int64_t asked_grid; /* ... and of the latest request */
	double tower_rate;  /* the tower's seconds in one of the firmware's */
	bool running;       /* a request came */
	uint16_t outputs;
	uint8_t kept;    /* what the firmware keeps over a reset */
	uint64_t random; /* for its port_random */
	uint64_t dice;   /* of the forger */

	uint8_t state, fault; /* the firmware's, from its status before the injector */
	int64_t safe_ms;      /* since when it is safe with the frame down, negative: it is not */
	double impact_s;      /* of the latest impact seen */
	bool burst_waiting;   /* for its time after that impact */

	bool event_done[EVENTS_MAX];
	unsigned events_done;            /* how many */
	uint8_t event_state;             /* the state events count from ... */
	int64_t entered_ms[WIRE_STATES]; /* ... and when each was entered last, negative: never */
	int64_t chain_ms;                /* the entry that the latest event at a state counted from */
	int64_t until_ms[EVENT_ACTIONS]; /* end of a span */
	int64_t done_ms;                 /* since when there is nothing left to do, negative: there is */
	bool restart;                    /* the firmware, after this answer */
	unsigned restart_cause;
	bool hang; /* its main loop, with this answer */

	int control; /* socket, -1: none */
	uint8_t control_sequence;

	unsigned impacts;
	uint64_t edges_outside; /* output edges that were not in their request's span */
	uint64_t queue_lost;    /* no room on the way to the firmware */
	uint64_t not_carried;   /* from the host's link, not for an 11-bit bus */
	uint64_t link_full;     /* the link's queue stayed full */

	bool stop;
	int status; /* BENCH_* */
};

/* The first reason to stop is the one that is told and decides the exit status. */
__attribute__((format(printf, 3, 4))) void bench_fail(struct bench *bench, int status, const char *format,
                                                      ...);

/* ---- virtual time ---- */

static inline int64_t bench_grid_us(int64_t grid)
{
	return grid * 1000 / BENCH_GRID_PER_MS;
}

static inline double bench_grid_s(int64_t grid)
{
	return (double)grid / (1000.0 * BENCH_GRID_PER_MS);
}

static inline double bench_now_s(const struct bench *bench)
{
	return bench_grid_s(bench->now_grid);
}

static inline int64_t bench_now_ms(const struct bench *bench)
{
	return bench->now_grid / BENCH_GRID_PER_MS;
}

/* The tower's time: its clock is the true one. */
static inline double bench_tower_s(const struct bench *bench, int64_t grid)
{
	return bench_grid_s(grid) * bench->tower_rate;
}

/* ---- bench_plant.c ---- */

/* Takes over the request's instant and outputs and samples there; false when the request makes no sense. */
bool bench_plant_move(struct bench *bench, const struct sensorbus_request *request,
                      struct sensorbus_answer *answer);

/* The request that the next instant of this tick would bring, without edges or frames; false after the last.
 */
bool bench_plant_next(const struct bench *bench, struct sensorbus_request *request);

/* So many sample instants after grid, and no later than limit. */
int64_t bench_instant_after(int64_t grid, unsigned instants, int64_t limit);

/* Each ms: the technician. */
void bench_plant_attend(struct bench *bench);

/* ---- bench_bus.c ---- */

void bench_from_firmware(struct bench *bench, const struct frame *frame);
void bench_from_host(struct bench *bench, const struct frame *frame);

/* What comes to the firmware with this answer. */
void bench_to_firmware(struct bench *bench, struct sensorbus_answer *answer, struct frame *received);

/* Each ms: the host, on its link or the script. */
void bench_host(struct bench *bench);

/* ---- bench_events.c ---- */

bool bench_in_span(const struct bench *bench, enum event_action action);
bool bench_events_done(const struct bench *bench);

/* Makes it happen now. */
void bench_event(struct bench *bench, const struct event *event);

/* Each ms, and what of it goes with an answer. */
void bench_events(struct bench *bench);
void bench_events_answer(struct bench *bench, struct sensorbus_answer *answer);

/* ---- bench_foreign.c ---- */

/* A command of the operator, or of the second host, as whoever hears the bus can make it. */
void bench_verb(struct bench *bench, const struct event *event);

/* Keeps what a host sent. */
void bench_keep(struct bench *bench, const struct frame *frame);
void bench_replay_start(struct bench *bench);

/* Each ms. */
void bench_foreign(struct bench *bench);

/* ---- bench_control.c: the socket of --control, which hil/README.md describes ---- */

void bench_control_open(struct bench *bench);
void bench_control_close(struct bench *bench);

/* Each ms. */
void bench_control(struct bench *bench);

#endif
