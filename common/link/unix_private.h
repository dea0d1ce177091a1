/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_COMMON_LINK_UNIX_PRIVATE_H
#define DT_COMMON_LINK_UNIX_PRIVATE_H
/*
 * What the two files of unix:PATH share: unix_bus.c carries frames between the peers of a bus, unix.c joins
 * one, serves it when nobody does, and is the link.
 */
#include <sys/stat.h>
#include <sys/un.h>

#include "common/link/transport.h"

#define UNIX_PEERS_MAX 32u

/* Who an epoll event is about: a peer's number or this. */
enum { UNIX_LISTENER = UNIX_PEERS_MAX };

struct queue {
	struct frame *frames;
	unsigned first, count;
};

struct peer {
	int socket;       /* -1: free */
	bool awaits_room; /* epoll watches for EPOLLOUT */
	bool stalled;     /* stayed full: what does not fit is dropped at once, until it has caught up */
	uint32_t dropped; /* told to the peer */
	uint32_t told;    /* what the peer has dropped, as last told to us */
	struct queue queue;
};

struct bus {
	struct link link;
	char path[sizeof(((struct sockaddr_un *)0)->sun_path)];
	int poller;
	int listener; /* -1: a client, whose server is peers[0] */
	dev_t device; /* of the socket file we made */
	ino_t inode;
	struct peer peers[UNIX_PEERS_MAX];
	struct queue inbound;
};

void unix_queue_drop_first(struct queue *queue);

/* Reserved, not touched: a queue costs memory only as far as it was ever filled. */
bool unix_queue_allocate(struct queue *queue);

/* epoll_ctl. */
int unix_watch(struct bus *bus, int operation, int descriptor, unsigned who, uint32_t events);

/* Those there are; a new one, false when there is no room; what waits for one, as far as it takes it. */
unsigned unix_peer_count(const struct bus *bus);
bool unix_peer_add(struct bus *bus, int socket);
void unix_peer_flush(struct bus *bus, struct peer *peer);

/* A millisecond or so. */
void unix_nap(void);

/* False if the peer's queue stayed full. */
bool unix_peer_push(struct bus *bus, struct peer *peer, const struct frame *frame);

/* A frame to all peers but one; losses are told to whom they hit. */
void unix_bus_spread(struct bus *bus, const struct frame *frame, const struct peer *except);

/* Waits for something to happen until the deadline and handles what did. */
int unix_bus_serve(struct bus *bus, int64_t deadline_us);

#endif
