/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <errno.h>
#include <fcntl.h>
#include <linux/can/error.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "common/link/link.h"
#include "common/sensorbus.h"
#include "firmware/app.h"
#include "firmware/port/posix/posix.h"

enum {
	GONE = 1, /* the other end has ended the run */
	INSTANTS = 16,
	TICK_US = 1000,
};

/* The sample instants of a millisecond. Those of X from 1 on are a fraction of a us after floor_us. */
static const struct instant {
	uint8_t group, index;
	uint16_t floor_us;
} instants[INSTANTS] = {
        {SENSORBUS_X | SENSORBUS_YZ, 0, 0},
        {SENSORBUS_YZ, 1, 100},
        {SENSORBUS_X, 1, 142},
        {SENSORBUS_YZ, 2, 200},
        {SENSORBUS_X, 2, 285},
        {SENSORBUS_YZ, 3, 300},
        {SENSORBUS_YZ, 4, 400},
        {SENSORBUS_X, 3, 428},
        {SENSORBUS_YZ, 5, 500},
        {SENSORBUS_X, 4, 571},
        {SENSORBUS_YZ, 6, 600},
        {SENSORBUS_YZ, 7, 700},
        {SENSORBUS_X, 5, 714},
        {SENSORBUS_YZ, 8, 800},
        {SENSORBUS_X, 6, 857},
        {SENSORBUS_YZ, 9, 900},
};

/* Everything that a reset of the controller loses. */
struct machine {
	uint32_t tick_ms, now_us;
	bool reset_wanted;
	uint16_t outputs, inputs;
	uint8_t edges;                       /* outputs that changed since the last request ... */
	uint32_t edge_us[SENSORBUS_OUTPUTS]; /* ... and when */
	uint8_t off_planned;                 /* outputs that port_off_at will switch ... */
	uint32_t off_us[SENSORBUS_OUTPUTS];  /* ... and when */
	struct frame sent[SENSORBUS_FRAMES_MAX], received[SENSORBUS_FRAMES_MAX];
	unsigned sent_count, received_count, received_next;
};

static struct {
	struct machine machine;
	bool first_request; /* after a reset */
	int request_fd, answer_fd;
	struct link *link; /* NULL: frames ride in the exchange */
	bool no_fd;
	int link_error;
	uint32_t bus_errors;
	bool bus_off, tx_blocked;
	bool link_bus_off; /* by the link's last error report */
} port;

/* ---- what the core calls ---- */

uint32_t port_time_us(void)
{
	return port.machine.now_us;
}

uint16_t port_io(void)
{
	return port.machine.inputs | port.machine.outputs;
}

static void set_outputs(uint16_t outputs, uint32_t time_us)
{
	uint16_t changed = outputs ^ port.machine.outputs;

	for (unsigned i = 0; i < SENSORBUS_OUTPUTS; i++)
		if (changed & 1u << i) {
			port.machine.edges |= (uint8_t)(1u << i);
			port.machine.edge_us[i] = time_us;
		}
	port.machine.outputs = outputs;
}

void port_outputs(uint16_t on, uint16_t off)
{
	set_outputs((uint16_t)((port.machine.outputs & ~off) | on), port.machine.now_us);
}

int port_off_at(uint16_t output, uint32_t time_us)
{
	if ((int32_t)(time_us - port.machine.now_us) < 0) {
		port_outputs(0, output);
		return 1;
	}
	for (unsigned i = 0; i < SENSORBUS_OUTPUTS; i++)
		if (output & 1u << i) {
			port.machine.off_planned |= (uint8_t)(1u << i);
			port.machine.off_us[i] = time_us;
		}
	return 0;
}

void port_off_cancel(uint16_t output)
{
	port.machine.off_planned &= (uint8_t)~output;
}

static int send_on_link(const struct frame *frame)
{
	int result = link_send(port.link, frame);

	if (result != 0 && result != DT_E_FULL)
		port.link_error = result;
	return result == 0 ? 0 : DT_E_FULL;
}

int port_can_setup(bool classic, uint32_t data_kbit_s)
{
	bool known = data_kbit_s == 2000 || data_kbit_s == 5000 || data_kbit_s == 8000;

	/* The rates are those of the link's interface, if it has any: nothing to set. */
	return known && (classic || !port.no_fd) ? 0 : DT_E_ARGUMENT;
}

int port_can_send(const struct frame *frame)
{
	if (port.bus_off || port.tx_blocked)
		return DT_E_FULL;
	if (port.link != NULL)
		return send_on_link(frame);
	if (port.machine.sent_count == SENSORBUS_FRAMES_MAX)
		return DT_E_FULL;
	port.machine.sent[port.machine.sent_count++] = *frame;
	return 0;
}

static int receive_from_link(struct frame *frame)
{
	int result = link_receive(port.link, frame, 0);

	if (result < 0)
		port.link_error = result;
	if (result == 1 && (frame->flags & FRAME_ERROR) != 0) {
		port.bus_errors++;
		port.link_bus_off = (frame->id & CAN_ERR_BUSOFF) != 0;
		return 0;
	}
	if (result == 1) /* what is heard on the bus is not off it */
		port.link_bus_off = false;
	return result == 1;
}

int port_can_receive(struct frame *frame)
{
	if (port.link != NULL)
		return receive_from_link(frame);
	if (port.machine.received_next == port.machine.received_count)
		return 0;
	*frame = port.machine.received[port.machine.received_next++];
	return 1;
}

uint32_t port_can_errors(bool *bus_off)
{
	*bus_off = port.bus_off;
	return port.bus_errors;
}

void port_watchdog_kick(void)
{
	/* A process that hangs stops the virtual time with it: whoever waits for it is the watchdog. */
}

void port_reset(void)
{
	port.machine.reset_wanted = true;
}

void port_lock(void)
{
	/* One thread: nothing interrupts app_poll. */
}

void port_unlock(void)
{
}

/* ---- the exchange ---- */

static int complain(const char *what, const char *detail)
{
	fprintf(stderr, "droptower-firmware: %s: %s\n", what, detail);
	return POSIX_EXIT_LINK;
}

static int write_all(const uint8_t *bytes, size_t count)
{
	while (count > 0) {
		ssize_t done = write(port.request_fd, bytes, count);

		if (done < 0 && errno == EINTR)
			continue;
		if (done < 0)
			return errno == EPIPE ? GONE : DT_E_SYSTEM;
		bytes += done;
		count -= (size_t)done;
	}
	return 0;
}

static int read_all(uint8_t *bytes, size_t count)
{
	while (count > 0) {
		ssize_t done = read(port.answer_fd, bytes, count);

		if (done < 0 && errno == EINTR)
			continue;
		if (done <= 0)
			return done == 0 ? GONE : DT_E_SYSTEM;
		bytes += done;
		count -= (size_t)done;
	}
	return 0;
}

/* Makes the planned edges whose time has come by up_to_us. */
static void make_edges(uint32_t up_to_us)
{
	struct machine *machine = &port.machine;

	for (unsigned i = 0; i < SENSORBUS_OUTPUTS; i++)
		if ((machine->off_planned & 1u << i) && (int32_t)(up_to_us - machine->off_us[i]) >= 0) {
			set_outputs((uint16_t)(machine->outputs & ~(1u << i)), machine->off_us[i]);
			machine->off_planned &= (uint8_t) ~(1u << i);
		}
}

static int send_request(const struct instant *instant)
{
	struct machine *machine = &port.machine;
	struct sensorbus_request request = {
	        .tick_ms = machine->tick_ms,
	        .group = instant->group,
	        .index = instant->index,
	        .outputs = machine->outputs,
	        .edges = machine->edges,
	        .frames = (uint8_t)machine->sent_count,
	        .reset = port.first_request,
	};
	uint8_t bytes[SENSORBUS_MESSAGE_MAX];
	size_t count;

	memcpy(request.edge_us, machine->edge_us, sizeof(request.edge_us));
	count = sensorbus_put_request(bytes, &request);
	for (unsigned i = 0; i < machine->sent_count; i++)
		count += sensorbus_put_frame(bytes + count, &machine->sent[i]);
	machine->edges = 0;
	machine->sent_count = 0;
	port.first_request = false;
	return write_all(bytes, count);
}

static int read_frames(unsigned count)
{
	struct machine *machine = &port.machine;
	uint8_t head[4];

	if (count > SENSORBUS_FRAMES_MAX)
		return DT_E_FORMAT;
	machine->received_next = 0;
	machine->received_count = 0;
	for (unsigned i = 0; i < count; i++) {
		struct frame *frame = &machine->received[i];
		int result = read_all(head, sizeof(head));

		if (result != 0)
			return result;
		result = sensorbus_frame_head(head, frame);
		if (result < 0)
			return result;
		result = read_all(frame->data, frame->length);
		if (result != 0)
			return result;
		machine->received_count++;
	}
	return 0;
}

static int exchange(const struct instant *instant, struct sensorbus_answer *answer)
{
	uint8_t bytes[SENSORBUS_ANSWER_BYTES];
	int result = send_request(instant);

	if (result == 0)
		result = read_all(bytes, sizeof(bytes));
	if (result != 0)
		return result;
	sensorbus_get_answer(bytes, answer);
	port.machine.inputs = answer->inputs & (uint16_t)~WIRE_IO_OUTPUTS & (uint16_t)~WIRE_IO_OVERRUN;
	port.bus_errors += answer->bus_errors;
	port.bus_off = answer->bus_off != 0 || port.link_bus_off;
	port.tx_blocked = answer->tx_blocked != 0;
	result = read_frames(answer->frames);
	return result == 0 && answer->stop ? GONE : result;
}

/* ---- time ---- */

static void deliver(const struct instant *instant, const struct sensorbus_answer *answer)
{
	const int16_t *codes = answer->codes;

	for (unsigned gate = 0; gate < 2; gate++)
		if (answer->captures & 1u << gate)
			app_on_gate(gate, answer->capture_us[gate]);
	if (instant->index == 0)
		app_on_tick();
	if (instant->group & SENSORBUS_X)
		app_on_x(codes[0], codes[3], answer->ready & SENSORBUS_X);
	if (instant->group & SENSORBUS_YZ)
		app_on_yz(codes[1], codes[2], codes[4], codes[5], answer->ready & SENSORBUS_YZ);
	app_poll();
}

/* 0, GONE or DT_E_*. */
static int run_instant(const struct instant *instant)
{
	struct machine *machine = &port.machine;
	uint32_t floor_us = machine->tick_ms * TICK_US + instant->floor_us;
	bool whole = instant->index == 0 || instant->group == SENSORBUS_YZ;
	struct sensorbus_answer answer;
	int result;

	make_edges(floor_us);
	machine->now_us = floor_us + (whole ? 0 : 1);
	result = exchange(instant, &answer);
	if (result == 0)
		deliver(instant, &answer);
	return result != 0 ? result : port.link_error;
}

static void boot(enum port_reset cause)
{
	port.machine = (struct machine){.outputs = WIRE_IO_MAGNET_HOLD}; /* as the drivers hold it in reset */
	port.first_request = true;
	port.bus_errors = 0;
	app_init(cause);
}

static void wait_for(struct timespec *next)
{
	next->tv_nsec += TICK_US * 1000L;
	if (next->tv_nsec >= 1000000000L) {
		next->tv_nsec -= 1000000000L;
		next->tv_sec++;
	}
	while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, next, NULL) == EINTR) {
	}
}

static int run(const struct posix_options *options)
{
	struct timespec next;
	int result = 0;

	clock_gettime(CLOCK_MONOTONIC, &next);
	port.no_fd = options->classic;
	boot(options->cause);
	while (result == 0) {
		for (unsigned i = 0; i < INSTANTS && result == 0 && !port.machine.reset_wanted; i++)
			result = run_instant(&instants[i]);
		port.machine.tick_ms++;
		if (port.machine.reset_wanted)
			boot(PORT_RESET_COMMAND);
		if (options->realtime)
			wait_for(&next);
	}
	return result;
}

static int open_pipe(const char *prefix, const char *suffix, int flags, int *fd)
{
	char path[4096];

	if (snprintf(path, sizeof(path), "%s.%s", prefix, suffix) >= (int)sizeof(path))
		return complain(prefix, "path too long");
	*fd = open(path, flags | O_CLOEXEC);
	return *fd >= 0 ? 0 : complain(path, strerror(errno));
}

static int open_all(const struct posix_options *options)
{
	char message[256];
	int result;

	if (options->can != NULL) {
		port.link = link_open(options->can, LINK_READ_WRITE, message, sizeof(message));
		if (port.link == NULL)
			return complain("no CAN link", message);
	}
	result = open_pipe(options->bus, "request", O_WRONLY, &port.request_fd);
	if (result == 0)
		result = open_pipe(options->bus, "answer", O_RDONLY, &port.answer_fd);
	return result;
}

int posix_run(const struct posix_options *options)
{
	int result = open_all(options);

	if (result != 0)
		return result;
	result = run(options);
	if (port.link_error != 0)
		return complain(link_url(port.link), error_text(port.link_error));
	if (result != GONE)
		return complain(options->bus, error_text(result));
	if (link_close(port.link) != 0)
		return complain(options->can, "could not be closed");
	return 0;
}
