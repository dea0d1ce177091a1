/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * slcan:DEVICE[@BAUD], an adapter on a serial line. Opening sets the line raw and sends C S8 Y5 O: close,
 * 1 Mbit/s, 5 Mbit/s data phase (an adapter without FD answers with a bell, which is ignored), open.
 */
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#include "common/link/slcan_text.h"
#include "common/link/transport.h"
#include "common/base/number.h"

#define INPUT_BYTES 4096u

struct slcan {
	struct link link;
	int descriptor;
	struct slcan_decoder decoder;
	size_t input_at, input_end;
	size_t output_at, output_end; /* the rest of a line the device has not taken */
	char input[INPUT_BYTES];
	char output[SLCAN_LINE_MAX];
};

static const struct {
	uint64_t baud;
	speed_t speed;
} speeds[] = {
        {9600, B9600},       {19200, B19200},     {38400, B38400},     {57600, B57600},
        {115200, B115200},   {230400, B230400},   {460800, B460800},   {500000, B500000},
        {576000, B576000},   {921600, B921600},   {1000000, B1000000}, {1500000, B1500000},
        {2000000, B2000000}, {2500000, B2500000}, {3000000, B3000000}, {3500000, B3500000},
        {4000000, B4000000},
};

/* Splits DEVICE[@BAUD]; device holds a copy of rest. False if BAUD is no known speed. */
static bool parse_rest(char *device, speed_t *speed)
{
	char *at = strrchr(device, '@');
	uint64_t baud;

	*speed = B3000000;
	if (at == NULL)
		return true;
	for (size_t i = 0; i < sizeof(speeds) / sizeof(speeds[0]); i++)
		if (number_whole(at + 1, speeds[i].baud, speeds[i].baud, &baud)) {
			*speed = speeds[i].speed;
			*at = '\0';
			return true;
		}
	return false;
}

static bool set_line(int descriptor, speed_t speed)
{
	struct termios line;

	if (tcgetattr(descriptor, &line) != 0)
		return false;
	cfmakeraw(&line);
	line.c_cflag |= CLOCAL | CREAD;
	line.c_cflag &= ~(tcflag_t)(CRTSCTS | CSTOPB);
	line.c_cc[VMIN] = 1;
	line.c_cc[VTIME] = 0;
	return cfsetspeed(&line, speed) == 0 && tcflush(descriptor, TCIOFLUSH) == 0 &&
	       tcsetattr(descriptor, TCSANOW, &line) == 0;
}

/* 1 when nothing is left to write, 0 when the deadline passed, or DT_E_LINK. */
static int flush(struct slcan *slcan, int64_t deadline_us)
{
	while (slcan->output_at < slcan->output_end) {
		ssize_t n = write(slcan->descriptor, slcan->output + slcan->output_at,
		                  slcan->output_end - slcan->output_at);

		if (n > 0) {
			slcan->output_at += (size_t)n;
			continue;
		}
		if (n < 0 && errno != EAGAIN && errno != EINTR)
			return DT_E_LINK;
		n = link_poll(slcan->descriptor, POLLOUT, deadline_us);
		if (n <= 0)
			return (int)n;
		if ((n & (POLLERR | POLLHUP | POLLNVAL)) != 0)
			return DT_E_LINK;
	}
	return 1;
}

static int slcan_put(struct slcan *slcan, const char *text, size_t length, int64_t deadline_us)
{
	memcpy(slcan->output, text, length);
	slcan->output_at = 0;
	slcan->output_end = length;
	return flush(slcan, deadline_us);
}

static int slcan_close(struct link *link)
{
	struct slcan *slcan = (struct slcan *)link;
	int64_t deadline_us = link_now_us() + LINK_PATIENCE_US;
	bool kept = true;

	if (slcan->descriptor >= 0) {
		kept = flush(slcan, deadline_us) == 1 && slcan_put(slcan, "C\r", 2, deadline_us) == 1;
		(void)close(slcan->descriptor);
	}
	free(slcan);
	return kept ? 0 : DT_E_SYSTEM;
}

static struct slcan *slcan_new(void)
{
	struct slcan *slcan = calloc(1, sizeof(*slcan));

	if (slcan != NULL)
		slcan->descriptor = -1;
	return slcan;
}

static const char *slcan_start(struct slcan *slcan, const char *device, speed_t speed)
{
	static const char commands[] = "C\rS8\rY5\rO\r";
	int descriptor = open(device, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);

	if (descriptor < 0)
		return strerror(errno);
	if (!set_line(descriptor, speed)) {
		(void)close(descriptor);
		return "not a serial line";
	}
	slcan->descriptor = descriptor;
	if (slcan_put(slcan, commands, sizeof(commands) - 1, link_now_us() + LINK_PATIENCE_US) != 1)
		return "the adapter takes no commands";
	return NULL;
}

static struct link *slcan_open(const char *rest, enum link_mode mode, struct link_message *message)
{
	struct slcan *slcan = slcan_new();
	char *device = strdup(rest);
	const char *reason = "out of memory";
	speed_t speed;

	(void)mode;
	if (slcan != NULL && device != NULL) {
		if (!parse_rest(device, &speed))
			reason = "not a known line speed";
		else
			reason = slcan_start(slcan, device, speed);
	}
	free(device);
	if (reason == NULL)
		return &slcan->link;
	link_complain(message, "%s, expected a serial CAN adapter as in slcan:/dev/ttyACM0@115200", reason);
	if (slcan != NULL)
		(void)slcan_close(&slcan->link);
	return NULL;
}

/* The device's own buffer is the queue; here waits at most the rest of one line. */
static int slcan_send(struct link *link, const struct frame *frame)
{
	struct slcan *slcan = (struct slcan *)link;
	bool waiting = slcan->output_at < slcan->output_end;
	char line[SLCAN_LINE_MAX];
	size_t length = slcan_encode(line, frame);
	int result;

	if (length == 0)
		return DT_E_ARGUMENT;
	result = flush(slcan, link_now_us() + LINK_PATIENCE_US);
	if (result <= 0) {
		link->counters.send_lost++;
		return result == 0 ? DT_E_FULL : DT_E_LINK;
	}
	link->counters.send_retried += waiting;
	return slcan_put(slcan, line, length, link_now_us()) < 0 ? DT_E_LINK : 0;
}

/* Looks for a frame in what was read. */
static bool slcan_take_frame(struct slcan *slcan, struct frame *frame)
{
	while (slcan->input_at < slcan->input_end) {
		int result = slcan_decode(&slcan->decoder, slcan->input[slcan->input_at++], frame);

		if (result == 1) {
			frame->time_us = link_clock_us();
			return true;
		}
		if (result < 0)
			slcan->link.counters.malformed++;
	}
	return false;
}

/* 1, 0 at the deadline, or an error. */
static int read_input(struct slcan *slcan, int64_t deadline_us)
{
	short events = slcan->output_at < slcan->output_end ? POLLIN | POLLOUT : POLLIN;
	int ready = link_poll(slcan->descriptor, events, deadline_us);
	ssize_t n;

	if (ready <= 0)
		return ready;
	if ((ready & POLLOUT) != 0 && flush(slcan, link_now_us()) < 0)
		return DT_E_LINK;
	if ((ready & ~POLLOUT) == 0)
		return 1;
	n = read(slcan->descriptor, slcan->input, sizeof(slcan->input));
	if (n < 0 && (errno == EAGAIN || errno == EINTR))
		return 1;
	if (n <= 0) /* unplugged */
		return DT_E_LINK;
	slcan->input_at = 0;
	slcan->input_end = (size_t)n;
	return 1;
}

static int slcan_receive(struct link *link, struct frame *frame, int64_t deadline_us)
{
	struct slcan *slcan = (struct slcan *)link;
	int result = 1;

	/* A line that never stops talking nonsense must not keep us past the deadline. */
	do {
		if (slcan_take_frame(slcan, frame))
			return 1;
		if (result <= 0)
			return result;
		result = read_input(slcan, deadline_us);
		if (result == 1 && link_now_us() >= deadline_us)
			result = 0;
	} while (true);
}

const struct link_ops link_slcan = {"slcan", slcan_open, slcan_send, slcan_receive, slcan_close, NULL};
