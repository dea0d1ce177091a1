/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * can:INTERFACE, SocketCAN raw with FD, kernel receive times, error reports and drop counts. An interface
 * that goes down or away is looked for again while receiving.
 */
#include "common/link/socketcan.h"

#include <errno.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#include "common/link/transport.h"

#define RECEIVE_BUFFER_BYTES (4 * 1024 * 1024)
#define LOOK_AGAIN_US 50000 /* for an interface that is down */
#define RETRY_NS 200000     /* for a full transmit queue: poll does not tell when it has room */

struct socketcan {
	struct link link;
	char name[IFNAMSIZ];
	int socket;
	int index; /* of the interface the socket is bound to */
	bool down, carries_fd;
	uint32_t dropped; /* SO_RXQ_OVFL, as last told */
};

/* ---- frames ----------------------------------------------------------------------------------------- */

int socketcan_pack(struct canfd_frame *kernel, const struct frame *frame)
{
	unsigned flags = frame->flags;
	struct canfd_frame packed = {.can_id = frame->id, .len = frame->length};

	if (!link_frame_valid(frame) || (flags & FRAME_ERROR) != 0)
		return DT_E_ARGUMENT;
	if ((flags & FRAME_EXTENDED) != 0)
		packed.can_id |= CAN_EFF_FLAG;
	if ((flags & FRAME_REMOTE) != 0)
		packed.can_id |= CAN_RTR_FLAG;
	else
		memcpy(packed.data, frame->data, frame->length);
	if ((flags & FRAME_BRS) != 0)
		packed.flags |= CANFD_BRS;
	if ((flags & FRAME_ESI) != 0)
		packed.flags |= CANFD_ESI;
	*kernel = packed;
	return (flags & FRAME_FD) != 0 ? (int)CANFD_MTU : (int)CAN_MTU;
}

static uint8_t socketcan_flags_of(const struct canfd_frame *kernel, bool is_fd)
{
	unsigned flags = 0;

	if ((kernel->can_id & CAN_ERR_FLAG) != 0)
		return FRAME_ERROR;
	if ((kernel->can_id & CAN_EFF_FLAG) != 0)
		flags |= FRAME_EXTENDED;
	if ((kernel->can_id & CAN_RTR_FLAG) != 0)
		flags |= FRAME_REMOTE;
	if (is_fd)
		flags |= FRAME_FD;
	if (is_fd && (kernel->flags & CANFD_BRS) != 0)
		flags |= FRAME_BRS;
	if (is_fd && (kernel->flags & CANFD_ESI) != 0)
		flags |= FRAME_ESI;
	return (uint8_t)flags;
}

int socketcan_unpack(struct frame *frame, const struct canfd_frame *kernel, size_t size)
{
	struct frame parsed = {.length = kernel->len};

	if (size != CAN_MTU && size != CANFD_MTU)
		return DT_E_FORMAT;
	parsed.flags = socketcan_flags_of(kernel, size == CANFD_MTU);
	parsed.id = kernel->can_id & CAN_EFF_MASK;
	if (!link_frame_valid(&parsed))
		return DT_E_FORMAT;
	if ((parsed.flags & FRAME_REMOTE) == 0)
		memcpy(parsed.data, kernel->data, parsed.length);
	*frame = parsed;
	return 0;
}

/* ---- interface -------------------------------------------------------------------------------------- */

static bool is_can(int socket, const char *name)
{
	struct ifreq request = {0};

	(void)snprintf(request.ifr_name, sizeof(request.ifr_name), "%s", name);
	return ioctl(socket, SIOCGIFHWADDR, &request) == 0 && request.ifr_hwaddr.sa_family == ARPHRD_CAN;
}

static bool is_up(const struct socketcan *can)
{
	struct ifreq request = {0};

	memcpy(request.ifr_name, can->name, sizeof(can->name));
	return ioctl(can->socket, SIOCGIFFLAGS, &request) == 0 && (request.ifr_flags & IFF_UP) != 0;
}

/* Binds to the interface of our name as it is now. When one goes away the kernel drops the filter too. */
static bool attach(struct socketcan *can)
{
	struct sockaddr_can address = {.can_family = AF_CAN};
	struct ifreq request = {0};
	struct can_filter all = {0};
	socklen_t filter_size = can->link.mode == LINK_WRITE ? 0 : sizeof(all);

	memcpy(request.ifr_name, can->name, sizeof(can->name));
	address.can_ifindex = (int)if_nametoindex(can->name);
	if (address.can_ifindex == 0 || ioctl(can->socket, SIOCGIFMTU, &request) != 0)
		return false;
	can->carries_fd = request.ifr_mtu >= (int)CANFD_MTU;
	if (address.can_ifindex == can->index)
		return true;
	if (bind(can->socket, (const struct sockaddr *)&address, sizeof(address)) != 0 ||
	    setsockopt(can->socket, SOL_CAN_RAW, CAN_RAW_FILTER, &all, filter_size) != 0)
		return false;
	can->index = address.can_ifindex;
	return true;
}

/* ENETDOWN: it is down; ENODEV, ENXIO: it is gone, and has a new index when it comes back. */
static bool is_down_error(int error)
{
	return error == ENETDOWN || error == ENODEV || error == ENXIO;
}

static void note_down(struct socketcan *can, int error)
{
	can->down = true;
	if (error != ENETDOWN)
		can->index = 0;
}

static void look_again(struct socketcan *can)
{
	int stale_error;
	socklen_t size = sizeof(stale_error);

	if (!can->down || !is_up(can) || !attach(can))
		return;
	(void)getsockopt(can->socket, SOL_SOCKET, SO_ERROR, &stale_error, &size);
	can->down = false;
	can->link.counters.restarts++;
}

/* ---- open ------------------------------------------------------------------------------------------- */

static void complain_of_interface(const struct socketcan *can, struct link_message *message)
{
	struct if_nameindex *all = if_nameindex();
	char names[160] = "";
	size_t length = 0;

	for (const struct if_nameindex *i = all; i != NULL && i->if_index != 0; i++)
		if (is_can(can->socket, i->if_name) && length + IFNAMSIZ + 1 < sizeof(names))
			length += (size_t)snprintf(names + length, sizeof(names) - length, " %s", i->if_name);
	if_freenameindex(all);
	link_complain(message, "%s, expected one of:%s",
	              if_nametoindex(can->name) == 0 ? "no such interface" : "not a CAN interface",
	              length > 0 ? names : " (there is no CAN interface)");
}

static bool set_option(int socket, int level, int name, int value)
{
	return setsockopt(socket, level, name, &value, sizeof(value)) == 0;
}

static bool socketcan_set_options(int socket, enum link_mode mode)
{
	/* Without the right to exceed rmem_max the kernel gives what it allows; losses are counted. */
	if (!set_option(socket, SOL_SOCKET, SO_RCVBUFFORCE, RECEIVE_BUFFER_BYTES))
		(void)set_option(socket, SOL_SOCKET, SO_RCVBUF, RECEIVE_BUFFER_BYTES);
	return set_option(socket, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, 1) &&
	       set_option(socket, SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, 0) &&
	       set_option(socket, SOL_CAN_RAW, CAN_RAW_ERR_FILTER,
	                  mode == LINK_WRITE ? 0 : (int)CAN_ERR_MASK) &&
	       set_option(socket, SOL_SOCKET, SO_TIMESTAMP, 1) &&
	       set_option(socket, SOL_SOCKET, SO_RXQ_OVFL, 1);
}

static int socketcan_can_close(struct link *link)
{
	struct socketcan *can = (struct socketcan *)link;

	if (can->socket >= 0)
		(void)close(can->socket);
	free(can);
	return 0;
}

static bool open_socket(struct socketcan *can, struct link_message *message)
{
	can->socket = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_RAW);
	if (can->socket < 0 && (errno == EAFNOSUPPORT || errno == EPROTONOSUPPORT))
		link_complain(message, "this kernel has no SocketCAN, expected the modules can and can-raw "
		                       "to be loaded, or a unix:PATH link");
	else if (can->socket < 0)
		link_complain(message, "%s", strerror(errno));
	else if (!is_can(can->socket, can->name))
		complain_of_interface(can, message);
	else if (!socketcan_set_options(can->socket, can->link.mode) || !attach(can))
		link_complain(message, "%s, expected an interface that takes CAN FD sockets",
		              strerror(errno));
	else
		return true;
	return false;
}

static struct link *socketcan_can_open(const char *name, enum link_mode mode, struct link_message *message)
{
	struct socketcan *can;

	if (strlen(name) >= IFNAMSIZ) {
		link_complain(message, "an interface name has at most %d characters", IFNAMSIZ - 1);
		return NULL;
	}
	can = calloc(1, sizeof(*can));
	if (can == NULL) {
		link_complain(message, "out of memory");
		return NULL;
	}
	(void)snprintf(can->name, sizeof(can->name), "%s", name);
	can->link.mode = mode;
	if (open_socket(can, message))
		return &can->link;
	(void)socketcan_can_close(&can->link);
	return NULL;
}

/* ---- send and receive ------------------------------------------------------------------------------- */

/* After a failed write: 0 to try again, DT_E_FULL or DT_E_LINK. */
static int why_not_sent(struct socketcan *can, int error, int64_t deadline_us)
{
	struct timespec pause = {.tv_nsec = RETRY_NS};

	if (is_down_error(error)) {
		note_down(can, error);
		look_again(can);
		if (can->down)
			return DT_E_FULL;
	} else if (error != ENOBUFS && error != EAGAIN && error != EINTR) {
		return DT_E_LINK;
	}
	if (link_now_us() >= deadline_us)
		return DT_E_FULL;
	(void)nanosleep(&pause, NULL);
	return 0;
}

static int socketcan_can_send(struct link *link, const struct frame *frame)
{
	struct socketcan *can = (struct socketcan *)link;
	int64_t deadline_us = link_now_us() + LINK_PATIENCE_US;
	struct canfd_frame kernel;
	int size = socketcan_pack(&kernel, frame), error;
	bool retried = false;

	look_again(can);
	if (size < 0 || (size == (int)CANFD_MTU && !can->carries_fd))
		return DT_E_ARGUMENT;
	while (write(can->socket, &kernel, (size_t)size) < 0) {
		error = why_not_sent(can, errno, deadline_us);
		if (error != 0) {
			link->counters.send_lost++;
			return error;
		}
		retried = true;
	}
	link->counters.send_retried += retried;
	return 0;
}

static void read_control(struct socketcan *can, struct msghdr *message, struct frame *frame)
{
	struct timeval time = {0};
	uint32_t dropped;

	for (struct cmsghdr *c = CMSG_FIRSTHDR(message); c != NULL; c = CMSG_NXTHDR(message, c)) {
		if (c->cmsg_level != SOL_SOCKET)
			continue;
		if (c->cmsg_type == SO_TIMESTAMP) {
			memcpy(&time, CMSG_DATA(c), sizeof(time));
		} else if (c->cmsg_type == SO_RXQ_OVFL) {
			memcpy(&dropped, CMSG_DATA(c), sizeof(dropped));
			can->link.counters.receive_lost += dropped - can->dropped;
			can->dropped = dropped;
		}
	}
	frame->time_us = (int64_t)time.tv_sec * 1000000 + time.tv_usec;
	if (frame->time_us == 0)
		frame->time_us = link_clock_us();
}

/* 1 a frame, 0 nothing there or nothing of use, or an error. */
static int socketcan_read_frame(struct socketcan *can, struct frame *frame)
{
	_Alignas(struct cmsghdr) char
	        control[CMSG_SPACE(sizeof(struct timeval)) + CMSG_SPACE(sizeof(uint32_t))];
	struct canfd_frame kernel;
	struct iovec part = {.iov_base = &kernel, .iov_len = sizeof(kernel)};
	struct msghdr message = {
	        .msg_iov = &part, .msg_iovlen = 1, .msg_control = control, .msg_controllen = sizeof(control)};
	ssize_t n = recvmsg(can->socket, &message, 0);

	if (n < 0 && is_down_error(errno))
		note_down(can, errno);
	if (n < 0)
		return errno == EAGAIN || errno == EINTR || is_down_error(errno) ? 0 : DT_E_LINK;
	if (socketcan_unpack(frame, &kernel, (size_t)n) != 0) {
		can->link.counters.malformed++;
		return 0;
	}
	read_control(can, &message, frame);
	return 1;
}

/* A down interface makes no descriptor readable when it comes back: look at it now and then. */
static int64_t until_us(const struct socketcan *can, int64_t deadline_us)
{
	int64_t soon_us;

	if (!can->down)
		return deadline_us;
	soon_us = link_now_us() + LOOK_AGAIN_US;
	return soon_us < deadline_us ? soon_us : deadline_us;
}

static int socketcan_can_receive(struct link *link, struct frame *frame, int64_t deadline_us)
{
	struct socketcan *can = (struct socketcan *)link;

	for (;;) {
		int result;

		look_again(can);
		result = socketcan_read_frame(can, frame);
		if (result != 0)
			return result;
		if (link_now_us() >= deadline_us)
			return 0;
		result = link_poll(can->socket, POLLIN, until_us(can, deadline_us));
		if (result < 0)
			return result;
	}
}

const struct link_ops link_can = {
        "can", socketcan_can_open, socketcan_can_send, socketcan_can_receive, socketcan_can_close, NULL};
