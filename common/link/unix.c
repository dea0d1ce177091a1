/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * unix:PATH, a bus of processes. Whoever finds nobody listening at PATH serves: each packet it receives goes
 * to every other peer and to itself. When the server goes, the others join again, and the first of them to
 * do so serves. Joining is done under a lock of the directory, so two processes never serve one path and a
 * socket found refusing is stale and may be replaced.
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
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#include "common/link/unix_private.h"

#define JOIN_PATIENCE_US 1000000
#define REJOIN_PATIENCE_US 10000
#define CLOSE_PATIENCE_US 1000000 /* without any progress */

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
		unix_nap();
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
	    listen(socket, (int)UNIX_PEERS_MAX) != 0 || stat(bus->path, &status) != 0 ||
	    unix_watch(bus, EPOLL_CTL_ADD, socket, UNIX_LISTENER, EPOLLIN) != 0)
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
		unix_nap();
	}
	if (!unix_peer_add(bus, socket))
		return -ENOMEM;
	unix_peer_flush(bus, &bus->peers[0]);
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
	int error = unix_bus_serve(bus, deadline_us);

	return error != 0 ? error : bus_rejoin(bus);
}

/* ---- link ------------------------------------------------------------------------------------------- */

/* Gives every peer what still waits for it; how many frames still wait. */
static unsigned flush_once(struct bus *bus)
{
	unsigned waiting = 0;

	for (unsigned i = 0; i < UNIX_PEERS_MAX; i++) {
		if (bus->peers[i].socket >= 0)
			unix_peer_flush(bus, &bus->peers[i]);
		waiting += bus->peers[i].queue.count;
	}
	return waiting;
}

/* Waits for the peers as long as they take something; whether they took all. */
static bool flush_all(struct bus *bus)
{
	int64_t deadline_us = link_now_us() + CLOSE_PATIENCE_US;
	unsigned waiting = flush_once(bus), before;

	while (waiting > 0 && unix_peer_count(bus) > 0 && link_now_us() < deadline_us) {
		unix_nap();
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
		(void)unix_bus_serve(bus, 0);
	flushed = flush_all(bus);
	if (bus->listener >= 0)
		remove_socket_file(bus);
	for (unsigned i = 0; i < UNIX_PEERS_MAX; i++) {
		if (bus->peers[i].socket >= 0)
			(void)close(bus->peers[i].socket);
		free(bus->peers[i].queue.frames);
	}
	if (bus->poller >= 0)
		(void)close(bus->poller);
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
	for (unsigned i = 0; i < UNIX_PEERS_MAX; i++)
		bus->peers[i].socket = -1;
	bus->poller = epoll_create1(EPOLL_CLOEXEC);
	if (bus->poller >= 0 && unix_queue_allocate(&bus->inbound))
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
		unix_bus_spread(bus, frame, NULL);
		return 0;
	}
	if (bus->peers[0].socket >= 0 && unix_peer_push(bus, &bus->peers[0], frame))
		return 0;
	link->counters.send_lost++;
	return DT_E_FULL;
}

static bool bus_take(struct bus *bus, struct frame *frame)
{
	if (bus->inbound.count == 0)
		return false;
	*frame = bus->inbound.frames[bus->inbound.first];
	unix_queue_drop_first(&bus->inbound);
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

const struct link_ops link_unix = {"unix", bus_open, bus_send, bus_receive, bus_close, NULL};
