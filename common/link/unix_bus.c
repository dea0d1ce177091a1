/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A packet is one frame: id (4 bytes, little endian), flags, length, PACKET_VERSION, 0, the count of frames
 * dropped so far because the receiver did not take them (4 bytes), 64 bytes of data.
 */
#include <errno.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "common/link/unix_private.h"

#define QUEUE_FRAMES 32768u /* fifteen seconds of a full stream */
#define PACKET_BYTES 76u
#define PACKET_VERSION 1u
#define EVENTS_AT_ONCE 16
#define READS_AT_ONCE 32

/* ---- queue ------------------------------------------------------------------------------------------ */

static bool queue_push(struct queue *queue, const struct frame *frame)
{
	if (queue->count == QUEUE_FRAMES)
		return false;
	queue->frames[(queue->first + queue->count++) % QUEUE_FRAMES] = *frame;
	return true;
}

void unix_queue_drop_first(struct queue *queue)
{
	queue->first = (queue->first + 1u) % QUEUE_FRAMES;
	queue->count--;
}

bool unix_queue_allocate(struct queue *queue)
{
	*queue = (struct queue){.frames = malloc(QUEUE_FRAMES * sizeof(struct frame))};
	return queue->frames != NULL;
}

/* ---- packet ----------------------------------------------------------------------------------------- */

static void unix_bus_put_u32(uint8_t *p, uint32_t value)
{
	for (unsigned i = 0; i < 4; i++)
		p[i] = (uint8_t)(value >> (8u * i));
}

static uint32_t unix_bus_get_u32(const uint8_t *p)
{
	return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

static void packet_encode(uint8_t packet[PACKET_BYTES], const struct frame *frame, uint32_t dropped)
{
	memset(packet, 0, PACKET_BYTES);
	unix_bus_put_u32(packet, frame->id);
	packet[4] = frame->flags;
	packet[5] = frame->length;
	packet[6] = PACKET_VERSION;
	unix_bus_put_u32(packet + 8, dropped);
	memcpy(packet + 12, frame->data, frame->length);
}

static bool packet_decode(const uint8_t *packet, size_t length, struct frame *frame, uint32_t *dropped)
{
	struct frame decoded = {.time_us = link_clock_us()};

	if (length != PACKET_BYTES || packet[6] != PACKET_VERSION || packet[7] != 0)
		return false;
	decoded.id = unix_bus_get_u32(packet);
	decoded.flags = packet[4];
	decoded.length = packet[5];
	if (!link_frame_valid(&decoded))
		return false;
	memcpy(decoded.data, packet + 12, decoded.length);
	*frame = decoded;
	*dropped = unix_bus_get_u32(packet + 8);
	return true;
}

/* ---- peer ------------------------------------------------------------------------------------------- */

int unix_watch(struct bus *bus, int operation, int descriptor, unsigned who, uint32_t events)
{
	struct epoll_event event = {.events = events, .data.u32 = who};

	return epoll_ctl(bus->poller, operation, descriptor, &event);
}

unsigned unix_peer_count(const struct bus *bus)
{
	unsigned n = 0;

	for (unsigned i = 0; i < UNIX_PEERS_MAX; i++)
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
	(void)unix_watch(bus, EPOLL_CTL_MOD, bus->listener, UNIX_LISTENER, EPOLLIN);
}

bool unix_peer_add(struct bus *bus, int socket)
{
	unsigned i = 0;
	struct peer *peer;

	while (i < UNIX_PEERS_MAX && bus->peers[i].socket >= 0)
		i++;
	if (i == UNIX_PEERS_MAX)
		return false;
	peer = &bus->peers[i];
	if (peer->queue.frames == NULL && !unix_queue_allocate(&peer->queue))
		return false;
	if (unix_watch(bus, EPOLL_CTL_ADD, socket, i, EPOLLIN) != 0)
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

void unix_peer_flush(struct bus *bus, struct peer *peer)
{
	struct queue *queue = &peer->queue;

	while (queue->count > 0 && peer_write(peer, &queue->frames[queue->first]))
		unix_queue_drop_first(queue);
	if (queue->count < QUEUE_FRAMES / 2)
		peer->stalled = false;
	if (peer->awaits_room != (queue->count > 0)) {
		peer->awaits_room = queue->count > 0;
		(void)unix_watch(bus, EPOLL_CTL_MOD, peer->socket, (unsigned)(peer - bus->peers),
		                 peer->awaits_room ? EPOLLIN | EPOLLOUT : EPOLLIN);
	}
}

void unix_nap(void)
{
	struct timespec millisecond = {.tv_nsec = 1000000};

	(void)nanosleep(&millisecond, NULL);
}

bool unix_peer_push(struct bus *bus, struct peer *peer, const struct frame *frame)
{
	int64_t deadline_us;

	if (peer->queue.count == 0 && peer_write(peer, frame))
		return true;
	if (!queue_push(&peer->queue, frame)) {
		deadline_us = link_now_us() + LINK_PATIENCE_US;
		unix_peer_flush(bus, peer);
		while (peer->queue.count == QUEUE_FRAMES && !peer->stalled && link_now_us() < deadline_us) {
			unix_nap();
			unix_peer_flush(bus, peer);
		}
		if (!queue_push(&peer->queue, frame)) {
			peer->stalled = bus->listener >= 0;
			return false;
		}
		bus->link.counters.send_retried++;
	}
	unix_peer_flush(bus, peer);
	return true;
}

void unix_bus_spread(struct bus *bus, const struct frame *frame, const struct peer *except)
{
	for (unsigned i = 0; i < UNIX_PEERS_MAX; i++) {
		struct peer *peer = &bus->peers[i];

		if (peer->socket >= 0 && peer != except && !unix_peer_push(bus, peer, frame))
			peer->dropped++;
	}
}

static void bus_deliver(struct bus *bus, const struct frame *frame)
{
	if (bus->link.mode == LINK_WRITE)
		return;
	if (!queue_push(&bus->inbound, frame))
		bus->link.counters.receive_lost++;
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
			unix_bus_spread(bus, &frame, peer);
	}
}

/* ---- bus -------------------------------------------------------------------------------------------- */

/* With all places taken newcomers wait in the backlog; peer_remove looks there again. */
static void bus_accept(struct bus *bus)
{
	int socket;

	if (unix_peer_count(bus) == UNIX_PEERS_MAX) {
		(void)unix_watch(bus, EPOLL_CTL_MOD, bus->listener, UNIX_LISTENER, 0);
		return;
	}
	socket = accept4(bus->listener, NULL, NULL, SOCK_CLOEXEC | SOCK_NONBLOCK);
	if (socket >= 0 && !unix_peer_add(bus, socket))
		(void)close(socket);
}

int unix_bus_serve(struct bus *bus, int64_t deadline_us)
{
	struct epoll_event events[EVENTS_AT_ONCE];
	int n = epoll_wait(bus->poller, events, EVENTS_AT_ONCE, link_poll_ms(deadline_us));

	if (n < 0)
		return errno == EINTR ? 0 : DT_E_SYSTEM;
	for (int i = 0; i < n; i++) {
		unsigned who = events[i].data.u32;
		struct peer *peer;

		if (who == UNIX_LISTENER)
			bus_accept(bus);
		if (who >= UNIX_PEERS_MAX)
			continue;
		peer = &bus->peers[who];
		if (peer->socket >= 0 && (events[i].events & EPOLLOUT) != 0)
			unix_peer_flush(bus, peer);
		if (peer->socket >= 0 && (events[i].events & ~(uint32_t)EPOLLOUT) != 0)
			peer_read(bus, peer);
	}
	return 0;
}
