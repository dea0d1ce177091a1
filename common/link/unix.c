/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * unix:PATH, a bus of processes. Whoever finds nobody listening at PATH serves: each packet it receives goes
 * to every other peer and to itself. When the server goes, the others join again, and the first of them to
 * do so serves. Joining is done under a lock of the directory, so two processes never serve one path and a
 * socket found refusing is stale and may be replaced.
 *
 * A packet is one frame: id (4 bytes, little endian), flags, length, PACKET_VERSION, 0, the count of frames
 * dropped so far because the receiver did not take them (4 bytes), 64 bytes of data.
 *
 * Server and client are the same thing, with many peers or one. What a peer's socket does not take waits in
 * that peer's queue; what this process has not asked for yet waits in `inbound`.
 */
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#include "common/link/transport.h"

#define PEERS_MAX 32u
#define QUEUE_FRAMES 32768u /* fifteen seconds of a full stream */
#define PACKET_BYTES 76u
#define PACKET_VERSION 1u
#define EVENTS_AT_ONCE 16
#define READS_AT_ONCE 32
#define JOIN_PATIENCE_US 1000000
#define REJOIN_PATIENCE_US 10000
#define CLOSE_PATIENCE_US 1000000 /* without any progress */

/* Who an epoll event is about: a peer's number or one of these. */
enum { EVENT_LISTENER = PEERS_MAX, EVENT_INBOUND };

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
	int poller, event; /* event: readable while inbound holds something */
	int listener;      /* -1: a client, whose server is peers[0] */
	dev_t device;      /* of the socket file we made */
	ino_t inode;
	struct peer peers[PEERS_MAX];
	struct queue inbound;
};

/* ---- queue ------------------------------------------------------------------------------------------ */

static bool queue_push(struct queue *queue, const struct frame *frame)
{
	if (queue->count == QUEUE_FRAMES)
		return false;
	queue->frames[(queue->first + queue->count++) % QUEUE_FRAMES] = *frame;
	return true;
}

static void queue_drop_first(struct queue *queue)
{
	queue->first = (queue->first + 1u) % QUEUE_FRAMES;
	queue->count--;
}

/* Reserved, not touched: a queue costs memory only as far as it was ever filled. */
static bool queue_allocate(struct queue *queue)
{
	*queue = (struct queue){.frames = malloc(QUEUE_FRAMES * sizeof(struct frame))};
	return queue->frames != NULL;
}

/* ---- packet ----------------------------------------------------------------------------------------- */

static void put_u32(uint8_t *p, uint32_t value)
{
	for (unsigned i = 0; i < 4; i++)
		p[i] = (uint8_t)(value >> (8u * i));
}

static uint32_t get_u32(const uint8_t *p)
{
	return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

static void packet_encode(uint8_t packet[PACKET_BYTES], const struct frame *frame, uint32_t dropped)
{
	memset(packet, 0, PACKET_BYTES);
	put_u32(packet, frame->id);
	packet[4] = frame->flags;
	packet[5] = frame->length;
	packet[6] = PACKET_VERSION;
	put_u32(packet + 8, dropped);
	memcpy(packet + 12, frame->data, frame->length);
}

static bool packet_decode(const uint8_t *packet, size_t length, struct frame *frame, uint32_t *dropped)
{
	struct frame decoded = {.time_us = link_clock_us()};

	if (length != PACKET_BYTES || packet[6] != PACKET_VERSION || packet[7] != 0)
		return false;
	decoded.id = get_u32(packet);
	decoded.flags = packet[4];
	decoded.length = packet[5];
	if (!link_frame_valid(&decoded))
		return false;
	memcpy(decoded.data, packet + 12, decoded.length);
	*frame = decoded;
	*dropped = get_u32(packet + 8);
	return true;
}

/* ---- peer ------------------------------------------------------------------------------------------- */

static int watch(struct bus *bus, int operation, int descriptor, unsigned who, uint32_t events)
{
	struct epoll_event event = {.events = events, .data.u32 = who};

	return epoll_ctl(bus->poller, operation, descriptor, &event);
}

static unsigned peer_count(const struct bus *bus)
{
	unsigned n = 0;

	for (unsigned i = 0; i < PEERS_MAX; i++)
		n += bus->peers[i].socket >= 0;
	return n;
}

/* The peer's queue stays: a client's goes to the next server. */
static void peer_remove(struct bus *bus, struct peer *peer)
{
	(void)close(peer->socket);
	peer->socket = -1;
	if (bus->listener < 0)
		return;
	free(peer->queue.frames);
	peer->queue = (struct queue){0};
	(void)watch(bus, EPOLL_CTL_MOD, bus->listener, EVENT_LISTENER, EPOLLIN);
}

static bool peer_add(struct bus *bus, int socket)
{
	unsigned i = 0;
	struct peer *peer;

	while (i < PEERS_MAX && bus->peers[i].socket >= 0)
		i++;
	if (i == PEERS_MAX)
		return false;
	peer = &bus->peers[i];
	if (peer->queue.frames == NULL && !queue_allocate(&peer->queue))
		return false;
	if (watch(bus, EPOLL_CTL_ADD, socket, i, EPOLLIN) != 0)
		return false;
	*peer = (struct peer){.socket = socket, .queue = peer->queue};
	return true;
}

/* False if the socket does not take it now. That its peer is gone is found by reading. */
static bool peer_write(struct peer *peer, const struct frame *frame)
{
	uint8_t packet[PACKET_BYTES];

	packet_encode(packet, frame, peer->dropped);
	while (send(peer->socket, packet, sizeof(packet), MSG_DONTWAIT | MSG_NOSIGNAL) < 0)
		if (errno != EINTR)
			return false;
	return true;
}

static void peer_flush(struct bus *bus, struct peer *peer)
{
	struct queue *queue = &peer->queue;

	while (queue->count > 0 && peer_write(peer, &queue->frames[queue->first]))
		queue_drop_first(queue);
	if (queue->count < QUEUE_FRAMES / 2)
		peer->stalled = false;
	if (peer->awaits_room != (queue->count > 0)) {
		peer->awaits_room = queue->count > 0;
		(void)watch(bus, EPOLL_CTL_MOD, peer->socket, (unsigned)(peer - bus->peers),
		            peer->awaits_room ? EPOLLIN | EPOLLOUT : EPOLLIN);
	}
}

static void nap(void)
{
	struct timespec millisecond = {.tv_nsec = 1000000};

	(void)nanosleep(&millisecond, NULL);
}

/* False if the peer's queue stayed full. */
static bool peer_push(struct bus *bus, struct peer *peer, const struct frame *frame)
{
	int64_t deadline_us;

	if (peer->queue.count == 0 && peer_write(peer, frame))
		return true;
	if (!queue_push(&peer->queue, frame)) {
		deadline_us = link_now_us() + LINK_PATIENCE_US;
		peer_flush(bus, peer);
		while (peer->queue.count == QUEUE_FRAMES && !peer->stalled && link_now_us() < deadline_us) {
			nap();
			peer_flush(bus, peer);
		}
		if (!queue_push(&peer->queue, frame)) {
			peer->stalled = bus->listener >= 0;
			return false;
		}
		bus->link.counters.send_retried++;
	}
	peer_flush(bus, peer);
	return true;
}

/* A frame to all peers but one; losses are told to whom they hit. */
static void bus_spread(struct bus *bus, const struct frame *frame, const struct peer *except)
{
	for (unsigned i = 0; i < PEERS_MAX; i++) {
		struct peer *peer = &bus->peers[i];

		if (peer->socket >= 0 && peer != except && !peer_push(bus, peer, frame))
			peer->dropped++;
	}
}

static void bus_deliver(struct bus *bus, const struct frame *frame)
{
	if (bus->link.mode == LINK_WRITE)
		return;
	if (!queue_push(&bus->inbound, frame))
		bus->link.counters.receive_lost++;
	else if (bus->inbound.count == 1)
		(void)eventfd_write(bus->event, 1);
}

static void peer_read(struct bus *bus, struct peer *peer)
{
	for (int i = 0; i < READS_AT_ONCE; i++) {
		uint8_t packet[PACKET_BYTES + 1];
		ssize_t n = recv(peer->socket, packet, sizeof(packet), MSG_DONTWAIT);
		struct frame frame;
		uint32_t dropped;

		if (n < 0 && (errno == EINTR || errno == ECONNRESET))
			continue; /* reset: it closed with our frames unread; its own come before its end */
		if (n < 0 && errno == EAGAIN)
			return;
		if (n <= 0) {
			peer_remove(bus, peer);
			return;
		}
		if (!packet_decode(packet, (size_t)n, &frame, &dropped)) {
			bus->link.counters.malformed++;
			continue;
		}
		bus->link.counters.receive_lost += dropped - peer->told;
		peer->told = dropped;
		bus_deliver(bus, &frame);
		if (bus->listener >= 0)
			bus_spread(bus, &frame, peer);
	}
}

/* ---- bus -------------------------------------------------------------------------------------------- */

/* With all places taken newcomers wait in the backlog; peer_remove looks there again. */
static void bus_accept(struct bus *bus)
{
	int socket;

	if (peer_count(bus) == PEERS_MAX) {
		(void)watch(bus, EPOLL_CTL_MOD, bus->listener, EVENT_LISTENER, 0);
		return;
	}
	socket = accept4(bus->listener, NULL, NULL, SOCK_CLOEXEC | SOCK_NONBLOCK);
	if (socket >= 0 && !peer_add(bus, socket))
		(void)close(socket);
}

/* Waits for something to happen until the deadline and handles what did. */
static int bus_serve(struct bus *bus, int64_t deadline_us)
{
	struct epoll_event events[EVENTS_AT_ONCE];
	int n = epoll_wait(bus->poller, events, EVENTS_AT_ONCE, link_poll_ms(deadline_us));

	if (n < 0)
		return errno == EINTR ? 0 : DT_E_SYSTEM;
	for (int i = 0; i < n; i++) {
		unsigned who = events[i].data.u32;
		struct peer *peer;

		if (who == EVENT_LISTENER)
			bus_accept(bus);
		if (who >= PEERS_MAX)
			continue;
		peer = &bus->peers[who];
		if (peer->socket >= 0 && (events[i].events & EPOLLOUT) != 0)
			peer_flush(bus, peer);
		if (peer->socket >= 0 && (events[i].events & ~(uint32_t)EPOLLOUT) != 0)
			peer_read(bus, peer);
	}
	return 0;
}

static const char *join_text(int error)
{
	switch (error) {
	case ENOENT:
	case ENOTDIR:
		return "no such directory, expected one that exists";
	case EEXIST:
		return "exists and is no socket, expected a bus or a free name";
	case EPROTOTYPE:
		return "a socket of another kind listens there, expected a bus or a free name";
	case ETIMEDOUT:
		return "the directory stays locked or the bus does not answer, expected either to be free "
		       "soon";
	default:
		return strerror(error);
	}
}

/* Opens and locks the directory of path: a descriptor or -errno. */
static int lock_directory(const char *path, int64_t deadline_us)
{
	char directory[sizeof(((struct bus *)0)->path)] = ".";
	const char *slash = strrchr(path, '/');
	int descriptor;

	if (slash != NULL) {
		size_t length = slash == path ? 1 : (size_t)(slash - path);

		memcpy(directory, path, length);
		directory[length] = '\0';
	}
	descriptor = open(directory, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
	if (descriptor < 0)
		return -errno;
	while (flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
		int error = errno == EWOULDBLOCK && link_now_us() >= deadline_us ? ETIMEDOUT : errno;

		if (error != EWOULDBLOCK && error != EINTR) {
			(void)close(descriptor);
			return -error;
		}
		nap();
	}
	return descriptor;
}

static struct sockaddr_un address_of(const struct bus *bus)
{
	struct sockaddr_un address = {.sun_family = AF_UNIX};

	memcpy(address.sun_path, bus->path, sizeof(address.sun_path));
	return address;
}

static bool is_our_socket(const struct bus *bus)
{
	struct stat status;

	return stat(bus->path, &status) == 0 && status.st_dev == bus->device && status.st_ino == bus->inode;
}

/* The directory is locked and nobody listens: 0 or -errno. */
static int start_serving(struct bus *bus, int socket)
{
	struct sockaddr_un address = address_of(bus);
	struct stat status;

	if (lstat(bus->path, &status) == 0) {
		if (!S_ISSOCK(status.st_mode))
			return -EEXIST;
		if (unlink(bus->path) != 0)
			return -errno;
	}
	if (bind(socket, (const struct sockaddr *)&address, sizeof(address)) != 0 ||
	    listen(socket, (int)PEERS_MAX) != 0 || stat(bus->path, &status) != 0 ||
	    watch(bus, EPOLL_CTL_ADD, socket, EVENT_LISTENER, EPOLLIN) != 0)
		return -errno;
	bus->device = status.st_dev;
	bus->inode = status.st_ino;
	bus->listener = socket;
	/* What was meant for the last server has nobody to go to. */
	bus->link.counters.send_lost += bus->peers[0].queue.count;
	bus->peers[0].queue.count = 0;
	return 0;
}

/* Connects to who listens, or listens: 0 or -errno. */
static int connect_or_serve(struct bus *bus, int socket, int64_t deadline_us)
{
	struct sockaddr_un address = address_of(bus);

	while (connect(socket, (const struct sockaddr *)&address, sizeof(address)) != 0) {
		if (errno == ECONNREFUSED || errno == ENOENT)
			return start_serving(bus, socket);
		if (errno != EAGAIN && errno != EINTR)
			return -errno;
		if (link_now_us() >= deadline_us) /* its backlog stays full */
			return -ETIMEDOUT;
		nap();
	}
	if (!peer_add(bus, socket))
		return -ENOMEM;
	peer_flush(bus, &bus->peers[0]);
	return 0;
}

/* 0 or -errno. */
static int bus_join(struct bus *bus, int64_t patience_us)
{
	int64_t deadline_us = link_now_us() + patience_us;
	int lock = lock_directory(bus->path, deadline_us);
	int descriptor, error;

	if (lock < 0)
		return lock;
	descriptor = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
	error = descriptor < 0 ? -errno : connect_or_serve(bus, descriptor, deadline_us);
	if (error != 0 && descriptor >= 0)
		(void)close(descriptor);
	(void)close(lock);
	return error;
}

static bool bus_joined(const struct bus *bus)
{
	return bus->listener >= 0 || bus->peers[0].socket >= 0;
}

/* For a client whose server went: 0 when on the bus again, or when it may be so soon. */
static int bus_rejoin(struct bus *bus)
{
	int error;

	if (bus_joined(bus))
		return 0;
	error = bus_join(bus, REJOIN_PATIENCE_US);
	if (error == 0)
		bus->link.counters.restarts++;
	return error == 0 || error == -ETIMEDOUT ? 0 : DT_E_CLOSED;
}

static int bus_turn(struct bus *bus, int64_t deadline_us)
{
	int error = bus_serve(bus, deadline_us);

	return error != 0 ? error : bus_rejoin(bus);
}

/* ---- link ------------------------------------------------------------------------------------------- */

/* Gives every peer what still waits for it; how many frames still wait. */
static unsigned flush_once(struct bus *bus)
{
	unsigned waiting = 0;

	for (unsigned i = 0; i < PEERS_MAX; i++) {
		if (bus->peers[i].socket >= 0)
			peer_flush(bus, &bus->peers[i]);
		waiting += bus->peers[i].queue.count;
	}
	return waiting;
}

/* Waits for the peers as long as they take something; whether they took all. */
static bool flush_all(struct bus *bus)
{
	int64_t deadline_us = link_now_us() + CLOSE_PATIENCE_US;
	unsigned waiting = flush_once(bus), before;

	while (waiting > 0 && peer_count(bus) > 0 && link_now_us() < deadline_us) {
		nap();
		before = waiting;
		waiting = flush_once(bus);
		if (waiting < before)
			deadline_us = link_now_us() + CLOSE_PATIENCE_US;
	}
	return waiting == 0;
}

static void remove_socket_file(struct bus *bus)
{
	int lock = lock_directory(bus->path, link_now_us() + JOIN_PATIENCE_US);

	if (is_our_socket(bus))
		(void)unlink(bus->path);
	(void)close(bus->listener);
	if (lock >= 0)
		(void)close(lock);
}

static int bus_close(struct link *link)
{
	struct bus *bus = (struct bus *)link;
	bool flushed;

	if (bus->listener >= 0)
		(void)bus_serve(bus, 0);
	flushed = flush_all(bus);
	if (bus->listener >= 0)
		remove_socket_file(bus);
	for (unsigned i = 0; i < PEERS_MAX; i++) {
		if (bus->peers[i].socket >= 0)
			(void)close(bus->peers[i].socket);
		free(bus->peers[i].queue.frames);
	}
	if (bus->poller >= 0)
		(void)close(bus->poller);
	if (bus->event >= 0)
		(void)close(bus->event);
	free(bus->inbound.frames);
	free(bus);
	return flushed ? 0 : DT_E_SYSTEM;
}

static struct bus *bus_new(const char *path, enum link_mode mode)
{
	struct bus *bus = calloc(1, sizeof(*bus));

	if (bus == NULL)
		return NULL;
	memcpy(bus->path, path, strlen(path) + 1);
	bus->link.mode = mode;
	bus->listener = -1;
	for (unsigned i = 0; i < PEERS_MAX; i++)
		bus->peers[i].socket = -1;
	bus->poller = epoll_create1(EPOLL_CLOEXEC);
	bus->event = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
	if (bus->poller >= 0 && bus->event >= 0 && queue_allocate(&bus->inbound) &&
	    watch(bus, EPOLL_CTL_ADD, bus->event, EVENT_INBOUND, EPOLLIN) == 0)
		return bus;
	(void)bus_close(&bus->link);
	return NULL;
}

static struct link *bus_open(const char *path, enum link_mode mode, struct link_message *message)
{
	struct bus *bus;
	int error;

	if (strlen(path) >= sizeof(bus->path)) {
		link_complain(message, "a path of %zu bytes, expected at most %zu", strlen(path),
		              sizeof(bus->path) - 1);
		return NULL;
	}
	bus = bus_new(path, mode);
	if (bus == NULL) {
		link_complain(message, "out of memory or descriptors");
		return NULL;
	}
	error = bus_join(bus, JOIN_PATIENCE_US);
	if (error != 0) {
		link_complain(message, "%s", join_text(-error));
		(void)bus_close(&bus->link);
		return NULL;
	}
	return &bus->link;
}

static int bus_send(struct link *link, const struct frame *frame)
{
	struct bus *bus = (struct bus *)link;
	int error = bus_turn(bus, link_now_us());

	if (error != 0)
		return error;
	if (bus->listener >= 0) {
		bus_spread(bus, frame, NULL);
		return 0;
	}
	if (bus->peers[0].socket >= 0 && peer_push(bus, &bus->peers[0], frame))
		return 0;
	link->counters.send_lost++;
	return DT_E_FULL;
}

static bool bus_take(struct bus *bus, struct frame *frame)
{
	eventfd_t ignored;

	if (bus->inbound.count == 0)
		return false;
	*frame = bus->inbound.frames[bus->inbound.first];
	queue_drop_first(&bus->inbound);
	if (bus->inbound.count == 0)
		(void)eventfd_read(bus->event, &ignored);
	return true;
}

static int bus_receive(struct link *link, struct frame *frame, int64_t deadline_us)
{
	struct bus *bus = (struct bus *)link;
	bool last = false;
	int error;

	for (;;) {
		if (bus_take(bus, frame))
			return 1;
		if (last)
			return 0;
		error = bus_turn(bus, bus_joined(bus) ? deadline_us : link_now_us());
		if (error != 0)
			return error;
		last = deadline_us != LINK_FOREVER && link_now_us() >= deadline_us;
	}
}

static int bus_descriptor(const struct link *link)
{
	return ((const struct bus *)link)->poller;
}

const struct link_ops link_unix = {"unix", bus_open, bus_send, bus_receive, bus_descriptor, bus_close};
