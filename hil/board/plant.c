/* SPDX-License-Identifier: GPL-2.0-or-later */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "hil/board/board.h"

enum {
	X_PER_MS = 7,
	YZ_PER_MS = 10,
	X_CLOCKS = BOARD_CLOCKS_PER_MS / X_PER_MS,
	YZ_CLOCKS = BOARD_CLOCKS_PER_MS / YZ_PER_MS,
	LEAD_CLOCKS = 172 * 7, /* from the start of the timers to the first tick, by the port's own README */
	LATCH_OPEN = 1 << 0,
	DAMPERS_RELIEVE = 1 << 2,
	RECORD_HEAD = 2, /* bytes: the reset's cause, what was kept over it */
	ROOM = 8,        /* frames in a request that leaves room for those of the instants ahead */
};

static struct {
	int request_fd, answer_fd, record_fd;
	int64_t next;  /* clocks of the next exchange since tick 0 */
	uint8_t edges; /* since the exchange before */
	uint32_t edge_us[SENSORBUS_OUTPUTS];
	bool first;
	uint32_t random;
	unsigned frames, behind; /* answers ahead that were taken since the request */
	bool more;               /* the next answer comes without a request */
	size_t come, taken;      /* bytes of input[] */
	uint8_t input[SENSORBUS_MESSAGE_MAX];
	const uint8_t *recorded; /* requests and answers, these in place of the bench's */
	size_t recorded_bytes, recorded_taken;
	uint16_t inputs_off;
	size_t bytes;
	uint8_t request[SENSORBUS_REQUEST_BYTES + SENSORBUS_FRAMES_MAX * SENSORBUS_FRAME_BYTES_MAX];
} plant;

static int plant_open_one(const char *prefix, const char *suffix, int flags)
{
	char path[4096];
	int fd;

	snprintf(path, sizeof(path), "%s.%s", prefix, suffix);
	fd = open(path, flags | O_CLOEXEC);
	if (fd < 0) {
		fprintf(stderr, "droptower-firmware-board: %s: %s\n", path, strerror(errno));
		exit(BOARD_EXIT_LINK);
	}
	return fd;
}

/* All of a file that --record wrote. */
static void plant_load(const char *path)
{
	FILE *file = fopen(path, "rb");
	uint8_t *bytes = NULL;
	size_t count = 0, room = 0, more = 1;

	while (file != NULL && more > 0) {
		if (count == room)
			bytes = realloc(bytes, room = 2 * room + 1048576);
		if (bytes == NULL)
			break;
		more = fread(bytes + count, 1, room - count, file);
		count += more;
	}
	if (file == NULL || bytes == NULL || ferror(file) || count == 0) {
		fprintf(stderr, "droptower-firmware-board: %s: no record of answers\n", path);
		exit(BOARD_EXIT_LINK);
	}
	fclose(file);
	plant.recorded = bytes;
	plant.recorded_bytes = count;
	board.options.cause = bytes[0];
	board.options.kept = count > 1 ? bytes[1] : 0;
}

static void plant_open_record(const struct board_options *options)
{
	uint8_t head[RECORD_HEAD] = {(uint8_t)options->cause, (uint8_t)options->kept};

	plant.record_fd = open(options->record, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
	if (plant.record_fd < 0 || write(plant.record_fd, head, sizeof(head)) != sizeof(head)) {
		fprintf(stderr, "droptower-firmware-board: %s: %s\n", options->record, strerror(errno));
		exit(BOARD_EXIT_LINK);
	}
}

void plant_open(const struct board_options *options)
{
	plant.record_fd = -1;
	if (options->preempt != NULL || options->compare != NULL) {
		plant_load(options->preempt != NULL ? options->preempt : options->compare);
		return;
	}
	plant.request_fd = plant_open_one(options->bus, "request", O_WRONLY);
	plant.answer_fd = plant_open_one(options->bus, "answer", O_RDONLY);
	if (options->record != NULL)
		plant_open_record(options);
}

void plant_reset(void)
{
	plant.next = 0;
	plant.edges = 0;
	plant.first = true;
	plant.more = false;
	plant.behind = 0;
	plant.come = plant.taken = 0;
	plant.recorded_taken = RECORD_HEAD;
	plant.inputs_off = 0;
	plant.frames = 0;
	plant.bytes = SENSORBUS_REQUEST_BYTES;
}

void plant_edge(unsigned output, uint32_t time_us)
{
	plant.edges |= (uint8_t)(1u << output);
	plant.edge_us[output] = time_us;
}

bool plant_send(const struct frame *frame)
{
	if (board.options.preempt != NULL) {
		preempt_sent(frame);
		return true;
	}
	if (plant.frames == SENSORBUS_FRAMES_MAX)
		return false;
	plant.bytes += sensorbus_put_frame(plant.request + plant.bytes, frame, plant.behind);
	plant.frames++;
	return true;
}

void plant_state(void)
{
	preempt_keep(&plant, sizeof(plant));
}

void plant_inputs_off(uint16_t inputs)
{
	plant.inputs_off = inputs;
}

uint32_t plant_random(void)
{
	return plant.random++; /* another one each time */
}

int64_t plant_next(void)
{
	int64_t start = timer_start_time();

	return start < 0 ? BOARD_NEVER : start + LEAD_CLOCKS + plant.next;
}

/* ---- one exchange ---- */

static void plant_record(const uint8_t *bytes, size_t count)
{
	if (plant.record_fd >= 0 && write(plant.record_fd, bytes, count) != (ssize_t)count)
		board_fail("what the bench and the firmware say cannot be recorded");
}

static void plant_write(const uint8_t *bytes, size_t count)
{
	while (count > 0 && !board.over) {
		ssize_t done = write(plant.request_fd, bytes, count);

		if (done < 0 && errno != EINTR)
			board.over = true;
		if (done > 0) {
			bytes += done;
			count -= (size_t)done;
		}
	}
}

/* The next bytes of what was answered, read as far as they are not here. */
static void plant_read(uint8_t *bytes, size_t count)
{
	if (plant.recorded != NULL) {
		board.over |= plant.recorded_bytes - plant.recorded_taken < count;
		if (!board.over)
			memcpy(bytes, plant.recorded + plant.recorded_taken, count);
		plant.recorded_taken += board.over ? 0 : count;
		return;
	}
	while (plant.come - plant.taken < count && !board.over) {
		ssize_t done =
		        read(plant.answer_fd, plant.input + plant.come, sizeof(plant.input) - plant.come);

		if (done == 0 || (done < 0 && errno != EINTR))
			board.over = true;
		plant.come += done > 0 ? (size_t)done : 0;
	}
	if (board.over)
		return;
	memcpy(bytes, plant.input + plant.taken, count);
	plant_record(bytes, count);
	plant.taken += count;
}

static uint8_t plant_kept(void)
{
	uint32_t kept;

	memcpy(&kept, board.sram + (board.mark - BOARD_SRAM) + 8, sizeof(kept));
	return (uint8_t)kept;
}

/* Nothing that the firmware could do before the next tick changes an output, whatever the samples are; the
 * emergency stop ends pulses by itself. */
static bool ahead_is_welcome(int64_t of_ms)
{
	int64_t next_tick = board.now + BOARD_CLOCKS_PER_MS - of_ms;

	return of_ms != 0 && core_waits() && (system_outputs() & (LATCH_OPEN | DAMPERS_RELIEVE)) == 0 &&
	       timer_next_edge() > next_tick && plant.frames < ROOM;
}

/* The request is the one that was recorded, where that is asked for. */
static void plant_compare(void)
{
	uint16_t count;
	uint8_t request[sizeof(plant.request)];

	plant_read((uint8_t *)&count, sizeof(count));
	if (!board.over)
		plant_read(request, count);
	if (!board.over && board.options.compare != NULL &&
	    (count != plant.bytes || memcmp(request, plant.request, count) != 0)) {
		printf("otherwise than recorded in tick %lld\n",
		       (long long)(plant.next / BOARD_CLOCKS_PER_MS));
		exit(BOARD_EXIT_OTHERWISE);
	}
}

static void plant_ask(uint8_t group, int64_t of_ms)
{
	struct sensorbus_request request = {
	        .tick_ms = (uint32_t)(plant.next / BOARD_CLOCKS_PER_MS),
	        .group = group,
	        .index = (uint8_t)(of_ms / (group & SENSORBUS_X ? X_CLOCKS : YZ_CLOCKS)),
	        .outputs = system_outputs(),
	        .edges = plant.edges,
	        .frames = (uint8_t)plant.frames,
	        .reset = plant.first,
	        .ahead = ahead_is_welcome(of_ms),
	        .kept = plant_kept(),
	};

	memcpy(request.edge_us, plant.edge_us, sizeof(request.edge_us));
	(void)sensorbus_put_request(plant.request, &request);
	if (plant.recorded != NULL) {
		plant_compare();
	} else {
		uint16_t count = (uint16_t)plant.bytes;

		plant_record((const uint8_t *)&count, sizeof(count));
		plant_record(plant.request, plant.bytes);
		plant_write(plant.request, plant.bytes);
	}
	plant.edges = 0;
	plant.first = false;
	plant.frames = plant.behind = 0;
	plant.bytes = SENSORBUS_REQUEST_BYTES;
	plant.come = plant.taken = 0;
}

static void plant_take_frames(unsigned count)
{
	for (unsigned i = 0; i < count && !board.over; i++) {
		struct frame frame = {0};
		uint8_t head[4];
		unsigned behind;
		int length;

		plant_read(head, sizeof(head));
		length = sensorbus_frame_head(head, &frame, &behind);
		if (length < 0)
			board.over = true;
		else
			plant_read(frame.data, (size_t)length);
		if (!board.over)
			can_receive(&frame);
	}
}

static void plant_take(uint8_t group)
{
	uint8_t bytes[SENSORBUS_ANSWER_BYTES];
	struct sensorbus_answer answer;

	plant_read(bytes, sizeof(bytes));
	if (board.over)
		return;
	sensorbus_get_answer(bytes, &answer);
	plant.random = answer.random;
	board.hung |= answer.hang != 0;
	system_inputs(answer.inputs & (uint16_t)~plant.inputs_off);
	for (unsigned i = 0; i < SENSORBUS_CAPTURES; i++)
		if (answer.captures & 1u << i)
			timer_capture(i, answer.capture_us[i]);
	sampling_answer(group, &answer);
	can_answer(&answer);
	plant_take_frames(answer.frames);
	board.over |= answer.then == SENSORBUS_STOP;
	plant.more = answer.then == SENSORBUS_MORE;
}

void plant_event(void)
{
	int64_t of_ms = plant.next % BOARD_CLOCKS_PER_MS, x = (plant.next / X_CLOCKS + 1) * X_CLOCKS,
	        yz = (plant.next / YZ_CLOCKS + 1) * YZ_CLOCKS;
	uint8_t group = (uint8_t)((of_ms % X_CLOCKS == 0 ? SENSORBUS_X : 0) |
	                          (of_ms % YZ_CLOCKS == 0 ? SENSORBUS_YZ : 0));

	if (plant.more)
		plant.behind++;
	else
		plant_ask(group, of_ms);
	if (!board.over)
		plant_take(group);
	plant.next = x < yz ? x : yz;
}
