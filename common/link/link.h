/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_COMMON_LINK_LINK_H
#define DT_COMMON_LINK_LINK_H
/*
 * One small interface in front of every CAN transport a Linux program of ours uses.
 *
 *   unix:PATH    a bus of processes on this machine, no CAN driver needed. The first to open it serves
 *                the others (SOCK_SEQPACKET); every frame reaches every other process on it. When the server
 *                goes, the others go on with one of them as the server.
 *   can:IF       SocketCAN: can0, vcan0, ... with FD, kernel receive times, error frames, SO_RXQ_OVFL.
 *   slcan:DEV    a serial or USB adapter that speaks SLCAN; 'd' 'D' 'b' 'B' for FD as the CANable 2.
 *                slcan:DEV@BAUD sets the line's speed (default 3000000; no matter on USB).
 *   log:FILE     candump text (candump -L form). Opened for reading it delivers the file's frames with
 *                the file's times and then DT_E_CLOSED; opened for writing it appends ("-" = stdout).
 *
 * A link is used by one thread. Nothing blocks except link_receive, for at most its timeout.
 * Losses never pass in silence: link_counters tells them.
 */
#include <stdint.h>

#include "common/error.h"
#include "common/frame.h"

struct link;

enum link_mode {
	LINK_READ_WRITE,
	LINK_READ,  /* log: a file to read */
	LINK_WRITE, /* log: a file to write */
};

struct link_counters {
	uint64_t sent, received;
	uint64_t send_retried; /* the queue was full, the frame went later */
	uint64_t send_lost;    /* no room, or the interface is down: dropped, DT_E_FULL returned */
	uint64_t receive_lost; /* the kernel or a peer's queue dropped it before us */
	uint64_t errors;       /* error frames received */
	uint64_t malformed;    /* text or bytes that are no frame, skipped */
	uint64_t restarts;     /* interface went down and came back, or the bus has a new server */
};

/* Opens url. On error returns NULL and writes one line of explanation (no newline) into message, which
 * has room for size bytes: "unix:/tmp/bus: no such directory, ..." */
struct link *link_open(const char *url, enum link_mode mode, char *message, unsigned size);
/* The log at path. */
struct link *link_open_log(const char *path, enum link_mode mode, char *message, unsigned size);

/* 0, DT_E_FULL (the queue stayed full for 10 ms, or a SocketCAN interface is down; a later frame may go),
 * DT_E_CLOSED, DT_E_LINK, DT_E_SYSTEM (a log that cannot be written), DT_E_STATE (opened for reading), or
 * DT_E_ARGUMENT (a frame this transport cannot carry, or none at all). frame->time_us is written to log:
 * links; 0 there means now. */
DT_MUST_USE int link_send(struct link *link, const struct frame *frame);

/* 1 with a frame in *frame, 0 when timeout_ms passed without one (0 = do not wait, negative = for ever),
 * DT_E_CLOSED at the end of a log or when a bus cannot be joined again, DT_E_LINK, DT_E_SYSTEM, DT_E_STATE
 * (opened for writing). A SocketCAN interface that is down is waited for and
 * counted, it is not an error. Error reports arrive as frames with FRAME_ERROR. A log line that is not
 * a frame is skipped and counted. time_us is never 0 on
 * return: kernel time for can:, else the time it was read, or the log's. */
DT_MUST_USE int link_receive(struct link *link, struct frame *frame, int timeout_ms);

const struct link_counters *link_counters(const struct link *link);
const char *link_url(const struct link *link);

/* Hands what was written so far to the system, so that it outlives this program, not a power failure. 0, or
 * DT_E_SYSTEM if it cannot be kept. Links that hold nothing back do nothing. */
DT_MUST_USE int link_flush(struct link *link);

/* Of a clock that nobody sets, for deadlines; and since the epoch, for a frame's time_us. */
int64_t link_now_us(void);
int64_t link_clock_us(void);

/* Flushes and frees; NULL is allowed. 0 or DT_E_SYSTEM if what was written could not be kept. */
int link_close(struct link *link);

#endif
