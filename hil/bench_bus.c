/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "common/link/candump.h"
#include "common/wire_table.h"
#include "hil/bench_private.h"

enum {
	ANSWER_FRAMES = 2, /* to the firmware in one answer: more do not pass a bus of 1 Mbit/s between two */
	LINK_FRAMES = 64,  /* taken from the link in one ms */
};

static void bench_bus_log_frame(struct bench *bench, const struct frame *frame)
{
	char line[CANDUMP_LINE_MAX];
	struct frame stamped = *frame;

	if (bench->log == NULL)
		return;
	stamped.time_us = BENCH_EPOCH_US + bench_grid_us(bench->now_grid);
	fwrite(line, 1, candump_format(line, &stamped, "can0"), bench->log);
}

static void give_to_host(struct bench *bench, const struct frame *frame)
{
	int result;

	bench_bus_log_frame(bench, frame);
	if (bench->watch != NULL)
		monitor_at_host(&bench->watch->monitor, frame);
	if (bench->link == NULL) {
		script_feed(&bench->script, frame, (uint32_t)bench_now_ms(bench));
		return;
	}
	result = link_send(bench->link, frame);
	if (result == DT_E_FULL)
		bench->link_full++;
	else if (result < 0)
		bench_fail(bench, BENCH_LINK, "%s: %s", link_url(bench->link), error_text(result));
}

static void watch_status(struct bench *bench, const struct frame *frame)
{
	struct wire_status status;

	if (frame->id != WIRE_ID_STATUS || wire_unpack_status(frame, &status) != 0)
		return;
	if (status.fault != bench->fault)
		bench_tell(bench->options, "fault %s in state %s at %.3f s", wire_fault_name(status.fault),
		           wire_state_name(status.state), bench_now_s(bench));
	bench->state = status.state;
	bench->fault = status.fault;
}

/* The state that events count from: seen in every live block, without one in the status. */
static void watch_state(struct bench *bench, const struct frame *frame)
{
	struct monitor *monitor = &bench->watch->monitor;

	monitor->now_s = bench_now_s(bench);
	monitor_from_firmware(monitor, frame, bench_tower_s(bench, bench->base_grid),
	                      bench_tower_s(bench, bench->now_grid));
	if (monitor->state >= WIRE_STATES || monitor->state == bench->event_state)
		return;
	bench->event_state = monitor->state;
	bench->entered_ms[monitor->state] = bench_now_ms(bench);
}

void bench_from_firmware(struct bench *bench, const struct frame *frame)
{
	struct frame out[BUSFAULT_OUT_MAX];
	unsigned count;

	watch_status(bench, frame);
	if (bench->watch != NULL)
		watch_state(bench, frame);
	count = busfault_pass(&bench->to_host, frame, out);
	for (unsigned i = 0; i < count; i++)
		give_to_host(bench, &out[i]);
}

void bench_from_host(struct bench *bench, const struct frame *frame)
{
	struct frame out[BUSFAULT_OUT_MAX];
	unsigned count;

	if (frame->flags & FRAME_ERROR) {
		bench->bus_errors++;
		return;
	}
	if (frame->flags & FRAME_EXTENDED) {
		bench->not_carried++;
		return;
	}
	bench_bus_log_frame(bench, frame);
	bench_keep(bench, frame);
	count = busfault_pass(&bench->to_tower, frame, out);
	for (unsigned i = 0; i < count; i++)
		if (ring_put(&bench->queue, &out[i]) != 0)
			bench->queue_lost++;
}

static void bench_bus_poll_link(struct bench *bench)
{
	struct frame frame;

	for (unsigned i = 0; i < LINK_FRAMES; i++) {
		int result = link_receive(bench->link, &frame, 0);

		if (result < 0)
			bench_fail(bench, BENCH_LINK, "%s: %s", link_url(bench->link), error_text(result));
		if (result != 1)
			return;
		if (!bench_in_span(bench, EVENT_HOST_SILENT))
			bench_from_host(bench, &frame);
	}
}

static void poll_script(struct bench *bench)
{
	struct frame out[SCRIPT_SEND_MAX];
	unsigned count;

	if (bench_in_span(bench, EVENT_HOST_SILENT))
		return;
	count = script_poll(&bench->script, (uint32_t)bench_now_ms(bench), out);
	for (unsigned i = 0; i < count; i++)
		bench_from_host(bench, &out[i]);
	if (bench->watch != NULL)
		return;
	if (bench->script.phase == SCRIPT_FAILED ||
	    (bench->script.phase == SCRIPT_DONE && bench->script.incomplete))
		bench_fail(bench, BENCH_NOT_SAFE, "%s", bench->script.why);
	bench->stop |= bench->script.phase == SCRIPT_DONE;
}

void bench_host(struct bench *bench)
{
	if (bench->link != NULL)
		bench_bus_poll_link(bench);
	else
		poll_script(bench);
}

void bench_to_firmware(struct bench *bench, struct sensorbus_answer *answer, struct frame *received)
{
	while (answer->frames < ANSWER_FRAMES && ring_get(&bench->queue, &received[answer->frames]) == 0) {
		if (bench->watch != NULL)
			monitor_to_firmware(&bench->watch->monitor, &received[answer->frames],
			                    1e6 * bench_now_s(bench));
		answer->frames++;
	}
}
