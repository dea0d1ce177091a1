/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_COMMON_LINK_TRANSPORT_H
#define DT_COMMON_LINK_TRANSPORT_H
/*
 * Private to common/link: what a transport (unix.c, socketcan.c, slcan.c, log.c) provides behind link.h,
 * and what it may use. A transport's own struct begins with a struct link and lives on the heap from its
 * open to its close. link.c checks frames, direction and URL, and counts sent, received and errors; all
 * other counters are the transport's.
 */
#include <stdbool.h>
#include <stdint.h>

#include "common/link/link.h"

/* How long a full queue is waited for before a frame is given up. */
#define LINK_PATIENCE_US 10000
#define LINK_FOREVER INT64_MAX

struct link_message {
	const char *url;
	char *text;
	unsigned size;
};

struct link_ops {
	const char *scheme;
	/* rest: the URL behind "scheme:", never empty. NULL after link_complain. */
	struct link *(*open)(const char *rest, enum link_mode mode, struct link_message *message);
	int (*send)(struct link *link, const struct frame *frame);
	/* deadline in us of link_now_us, LINK_FOREVER for none */
	int (*receive)(struct link *link, struct frame *frame, int64_t deadline_us);
	int (*close)(struct link *link);
	int (*flush)(struct link *link); /* NULL: nothing is held back */
};

struct link {
	const struct link_ops *ops;
	char *url;
	enum link_mode mode;
	struct link_counters counters;
};

extern const struct link_ops link_unix, link_can, link_slcan, link_log;

/* Writes "URL: <text>" into the message. */
__attribute__((format(printf, 2, 3))) void link_complain(struct link_message *message, const char *format,
                                                         ...);

/* True for a frame that can stand on a bus (or be an error report): identifier, flags and length agree. */
bool link_frame_valid(const struct frame *frame);

/* Bytes of data that a data length code of 0 to 15 stands for in CAN FD; the least code that holds so many.
 */
unsigned link_length_of_code(unsigned code);
unsigned link_code_of_length(unsigned length);

/* Milliseconds until the deadline as poll and epoll_wait want them: rounded up, -1 for ever. */
int link_poll_ms(int64_t deadline_us);

/* Polls one descriptor, through interrupts, until the deadline: its revents, 0, or DT_E_SYSTEM. */
int link_poll(int descriptor, short events, int64_t deadline_us);

#endif
