/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "hil/bench.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "common/link/candump.h"
#include "common/link/link.h"
#include "common/ring.h"
#include "common/wire.h"
#include "common/wire_table.h"
#include "hil/codes.h"
#include "hil/script.h"
#include "hil/target.h"

enum {
	GRID_PER_MS = 70,  /* both sample grids, k/7 and k/10 ms, are whole numbers of this */
	QUEUE_FRAMES = 64, /* on their way to the firmware; a power of two */
	ANSWER_FRAMES = 2, /* to the firmware in one answer: more do not pass a bus of 1 Mbit/s between two */
	LINK_FRAMES = 64,  /* taken from the link in one ms */
	LIFT_AFTER_MS = 2000, /* how long the technician takes once the tower is safe ... */
	LIFT_SOON_MS = 1000,  /* ... and in a scenario */
	COUNTERS_MS = 100 * WIRE_COUNTERS + 200, /* in which every counter is told */
	BABBLE_FRAMES = 8,                       /* of the foreign node, a ms */
	BABBLE_ID = 0x010,
	BUS_OFF_ERRORS = 32, /* that bring a controller there: 8 points each, 256 in all */
};

struct bench {
	const struct bench_options *options;
	struct bench_watch *watch; /* NULL: nobody looks */
	struct tower *tower;
	struct target *target;
	struct link *link; /* NULL: the script is the host */
	struct script script;
	FILE *log, *truth;
	struct codes codes;

	struct busfault to_host, to_tower;
	struct ring queue;
	struct frame queue_storage[QUEUE_FRAMES];
	uint16_t bus_errors; /* error reports of the host's link since the answer before */

	int64_t base_grid; /* virtual time of the firmware's latest reset, 1/70 ms */
	int64_t now_grid;  /* of the present request */
	double tower_rate; /* the tower's seconds in one of the firmware's */
	bool running;      /* a request came */
	uint16_t outputs;

	uint8_t state, fault; /* the firmware's, from its status before the injector */
	int64_t safe_ms;      /* since when it is safe with the frame down, negative: it is not */
	double impact_s;      /* of the latest impact seen */
	bool burst_waiting;   /* for its time after that impact */

	unsigned events_done;            /* a bit each */
	uint8_t event_state;             /* the state events count from ... */
	int64_t entered_ms[WIRE_STATES]; /* ... and when each was entered last, negative: never */
	int64_t chain_ms;                /* the entry that the latest event at a state counted from */
	int64_t until_ms[EVENT_ACTIONS]; /* end of a span */
	int64_t done_ms;                 /* since when there is nothing left to do, negative: there is */
	bool restart;                    /* the firmware, after this answer */
	unsigned restart_cause;

	unsigned impacts;
	uint64_t edges_outside; /* output edges that were not in their request's span */
	uint64_t queue_lost;    /* no room on the way to the firmware */
	uint64_t not_carried;   /* from the host's link, not for an 11-bit bus */
	uint64_t link_full;     /* the link's queue stayed full */

	bool stop;
	int status; /* BENCH_* */
};

static void say(const char *format, va_list arguments)
{
	fputs("droptower-bench: ", stderr);
	vfprintf(stderr, format, arguments);
	fputc('\n', stderr);
}

void bench_say(const char *format, ...)
{
	va_list arguments;

	va_start(arguments, format);
	say(format, arguments);
	va_end(arguments);
}

/* The first reason to stop is the one that is told and decides the exit status. */
__attribute__((format(printf, 3, 4))) static void fail(struct bench *bench, int status, const char *format,
                                                       ...)
{
	va_list arguments;

	if (bench->status == BENCH_DONE) {
		va_start(arguments, format);
		say(format, arguments);
		va_end(arguments);
		bench->status = status;
	}
	bench->stop = true;
}

/* ---- virtual time ---- */

static int64_t grid_us(int64_t grid)
{
	return grid * 1000 / GRID_PER_MS;
}

static double grid_s(int64_t grid)
{
	return (double)grid / (1000.0 * GRID_PER_MS);
}

/* The tower's time: its clock is the true one. */
static double tower_s(const struct bench *bench, int64_t grid)
{
	return grid_s(grid) * bench->tower_rate;
}

static int64_t now_ms(const struct bench *bench)
{
	return bench->now_grid / GRID_PER_MS;
}

/* Takes over the request's instant; false when the request makes no sense. */
static bool take_time(struct bench *bench, const struct sensorbus_request *request)
{
	unsigned per_tick = request->group & SENSORBUS_X ? WIRE_X_PER_TICK : WIRE_YZ_PER_TICK;
	int64_t grid;

	if (request->reset && bench->running) { /* the firmware's clock starts again at the next whole ms */
		bench->base_grid = (now_ms(bench) + 1) * GRID_PER_MS;
		if (bench->watch != NULL)
			observe_reset(&bench->watch->observe);
	}
	grid = bench->base_grid + (int64_t)request->tick_ms * GRID_PER_MS +
	       (int64_t)request->index * (GRID_PER_MS / (int64_t)per_tick);
	if (request->group == 0 || request->group > (SENSORBUS_X | SENSORBUS_YZ) ||
	    request->index >= per_tick ||
	    (request->group == (SENSORBUS_X | SENSORBUS_YZ) && request->index) || grid < bench->now_grid) {
		fail(bench, BENCH_LINK,
		     "the firmware's request makes no sense: tick %u, group %u, index %u after %.6f s",
		     request->tick_ms, request->group, request->index, grid_s(bench->now_grid));
		return false;
	}
	bench->now_grid = grid;
	return true;
}

/* ---- the plant ---- */

struct edge {
	unsigned bit;
	int64_t time_us;
};

/* The request's edges in the order of their times; one that lies outside the span since the request
 * before is moved to its nearest end and counted. */
static unsigned sort_edges(struct bench *bench, const struct sensorbus_request *request, int64_t before_us,
                           struct edge edges[SENSORBUS_OUTPUTS])
{
	int64_t now_us = grid_us(bench->now_grid), base_us = grid_us(bench->base_grid);
	unsigned count = 0;

	for (unsigned bit = 0; bit < SENSORBUS_OUTPUTS; bit++) {
		int32_t ago_us = (int32_t)((uint32_t)(now_us - base_us) - request->edge_us[bit]);
		int64_t time_us = now_us - ago_us;
		unsigned place = count;

		if (!(request->edges & 1u << bit))
			continue;
		bench->edges_outside += time_us < before_us || time_us > now_us + 1;
		time_us = time_us < before_us ? before_us : time_us;
		for (; place > 0 && edges[place - 1].time_us > time_us; place--)
			edges[place] = edges[place - 1];
		edges[place] = (struct edge){bit, time_us};
		count++;
	}
	return count;
}

static void make_edge(struct bench *bench, unsigned bit, bool on, double time_us)
{
	double time_s = fmin(1e-6 * time_us * bench->tower_rate, tower_s(bench, bench->now_grid));

	if (bench->watch != NULL)
		observe_edge(&bench->watch->observe, bit, on, time_us, time_s);
	tower_output(bench->tower, bit, on, time_s);
}

static void apply_outputs(struct bench *bench, const struct sensorbus_request *request, int64_t before_grid)
{
	struct edge edges[SENSORBUS_OUTPUTS];
	unsigned count = sort_edges(bench, request, grid_us(before_grid), edges);

	for (unsigned i = 0; i < count; i++)
		make_edge(bench, edges[i].bit, request->outputs >> edges[i].bit & 1,
		          (double)edges[i].time_us);
	/* Levels that changed without an edge: after a reset. */
	for (unsigned bit = 0; bit < SENSORBUS_OUTPUTS; bit++)
		if (!(request->edges & 1u << bit) && (request->outputs ^ bench->outputs) >> bit & 1)
			make_edge(bench, bit, request->outputs >> bit & 1, 1e6 * grid_s(bench->now_grid));
	bench->outputs = request->outputs;
}

/* Whole us of the tower's clock, rounded down, as the firmware's clock stamps the same instant. */
static uint32_t capture_us(const struct bench *bench, uint32_t time_us)
{
	double firmware_us = floor(((double)time_us + 0.5) / bench->tower_rate);

	return (uint32_t)(int64_t)firmware_us - (uint32_t)grid_us(bench->base_grid);
}

static void sample(struct bench *bench, const struct sensorbus_request *request,
                   struct sensorbus_answer *answer)
{
	double time_s = tower_s(bench, bench->now_grid);

	tower_advance(bench->tower, time_s);
	tower_sample(bench->tower, request->group, answer->codes);
	codes_put(&bench->codes, request, answer->codes);
	answer->ready = request->group;
	answer->inputs = tower_inputs(bench->tower);
	for (unsigned gate = 0; gate < 2; gate++) {
		uint32_t time_us;

		if (!tower_capture(bench->tower, gate, &time_us))
			continue;
		answer->captures |= (uint8_t)(1u << gate);
		answer->capture_us[gate] = capture_us(bench, time_us);
	}
	if (bench->watch == NULL)
		return;
	observe_sample(&bench->watch->observe, request->group, answer->codes, answer->inputs,
	               tower_truth(bench->tower), time_s);
	timeline_sample(bench->watch->timeline, grid_s(bench->now_grid),
	                (uint16_t)(answer->inputs | request->outputs), bench->watch->observe.state,
	                request->group, answer->codes);
}

static void watch_impact(struct bench *bench)
{
	const struct tower_truth *truth = tower_truth(bench->tower);

	if (isfinite(truth->impact_s) && truth->impact_s != bench->impact_s) {
		bench->impact_s = truth->impact_s;
		bench->impacts++;
		bench->burst_waiting = bench->options->burst > 0;
		bench_say("drop %u: separated at %.1f mm, impact at %.6f s with %.3f m/s, %.2f deg",
		          bench->impacts, 1e3 * truth->separation_travel_m, truth->impact_s,
		          truth->impact_speed_m_s, truth->angle_deg);
	}
	if (bench->burst_waiting &&
	    tower_s(bench, bench->now_grid) >= bench->impact_s + bench->options->burst_after_s) {
		busfault_burst(&bench->to_host, bench->options->burst);
		bench->burst_waiting = false;
	}
}

/* The technician: lifts frame and product once the tower is safe. */
static void attend(struct bench *bench)
{
	bool waiting = bench->state == WIRE_STATE_SAFE && tower_inputs(bench->tower) & WIRE_IO_FRAME_DOWN;

	if (!waiting)
		bench->safe_ms = -1;
	else if (bench->safe_ms < 0)
		bench->safe_ms = now_ms(bench);
	else if (now_ms(bench) - bench->safe_ms >= (bench->watch ? LIFT_SOON_MS : LIFT_AFTER_MS))
		tower_lift(bench->tower);
}

/* ---- the bus ---- */

static void log_frame(struct bench *bench, const struct frame *frame)
{
	char line[CANDUMP_LINE_MAX];
	struct frame stamped = *frame;

	if (bench->log == NULL)
		return;
	stamped.time_us = BENCH_EPOCH_US + grid_us(bench->now_grid);
	fwrite(line, 1, candump_format(line, &stamped, "can0"), bench->log);
}

static void give_to_host(struct bench *bench, const struct frame *frame)
{
	int result;

	log_frame(bench, frame);
	if (bench->watch != NULL)
		observe_at_host(&bench->watch->observe, frame);
	if (bench->link == NULL) {
		script_feed(&bench->script, frame, (uint32_t)now_ms(bench));
		return;
	}
	result = link_send(bench->link, frame);
	if (result == DT_E_FULL)
		bench->link_full++;
	else if (result < 0)
		fail(bench, BENCH_LINK, "%s: %s", link_url(bench->link), error_text(result));
}

static void watch_status(struct bench *bench, const struct frame *frame)
{
	struct wire_status status;

	if (frame->id != WIRE_ID_STATUS || wire_unpack_status(frame, &status) != 0)
		return;
	if (status.fault != bench->fault)
		bench_say("fault %s in state %s at %.3f s", wire_fault_name(status.fault),
		          wire_state_name(status.state), grid_s(bench->now_grid));
	bench->state = status.state;
	bench->fault = status.fault;
}

/* The state that events count from: seen in every live block, without one in the status. */
static void watch_state(struct bench *bench, const struct frame *frame)
{
	struct observe *observe = &bench->watch->observe;

	observe->now_s = grid_s(bench->now_grid);
	observe_from_firmware(observe, frame, tower_s(bench, bench->base_grid));
	if (observe->state >= WIRE_STATES || observe->state == bench->event_state)
		return;
	bench->event_state = observe->state;
	bench->entered_ms[observe->state] = now_ms(bench);
}

static void from_firmware(struct bench *bench, const struct frame *frame)
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

static void from_host(struct bench *bench, const struct frame *frame)
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
	log_frame(bench, frame);
	count = busfault_pass(&bench->to_tower, frame, out);
	for (unsigned i = 0; i < count; i++)
		if (ring_put(&bench->queue, &out[i]) != 0)
			bench->queue_lost++;
}

static void poll_link(struct bench *bench)
{
	struct frame frame;

	for (unsigned i = 0; i < LINK_FRAMES; i++) {
		int result = link_receive(bench->link, &frame, 0);

		if (result < 0)
			fail(bench, BENCH_LINK, "%s: %s", link_url(bench->link), error_text(result));
		if (result != 1)
			return;
		from_host(bench, &frame);
	}
}

static bool in_span(const struct bench *bench, enum event_action action)
{
	return now_ms(bench) < bench->until_ms[action];
}

static void poll_script(struct bench *bench)
{
	struct frame out[SCRIPT_SEND_MAX];
	unsigned count;

	if (in_span(bench, EVENT_HOST_SILENT))
		return;
	count = script_poll(&bench->script, (uint32_t)now_ms(bench), out);
	for (unsigned i = 0; i < count; i++)
		from_host(bench, &out[i]);
	if (bench->watch != NULL)
		return;
	if (bench->script.phase == SCRIPT_FAILED ||
	    (bench->script.phase == SCRIPT_DONE && bench->script.incomplete))
		fail(bench, BENCH_NOT_SAFE, "%s", bench->script.why);
	bench->stop |= bench->script.phase == SCRIPT_DONE;
}

/* ---- what happens to the tower and its bus ---- */

static void happen(struct bench *bench, const struct event *event)
{
	switch (event->action) {
	case EVENT_FAULT:
	case EVENT_REPAIR:
		tower_fault(bench->tower, (enum tower_fault)event->number, event->action == EVENT_FAULT);
		bench_say("%s%s at %.3f s", tower_fault_name((enum tower_fault)event->number),
		          event->action == EVENT_FAULT ? "" : " repaired", grid_s(bench->now_grid));
		break;
	case EVENT_SEND:
		from_host(bench, &event->frame);
		break;
	case EVENT_BUS_BURST:
		busfault_burst(&bench->to_host, event->number);
		break;
	case EVENT_RESET:
		bench->restart = true;
		bench->restart_cause = event->number;
		break;
	default:
		if (event->action == EVENT_BUS_OFF)
			bench->bus_errors = (uint16_t)(bench->bus_errors + BUS_OFF_ERRORS);
		bench->until_ms[event->action] = now_ms(bench) + (int64_t)(1000 * event->duration_s + 0.5);
	}
}

/* Events at a state come in their order: each counts from an entry that does not lie before the one that the
 * event before it counted from. */
static bool is_due(const struct bench *bench, const struct event *event, bool chain_free)
{
	int64_t entered_ms;

	if (event->state == EVENT_AT_TIME)
		return grid_s(bench->now_grid) >= event->time_s;
	entered_ms = bench->entered_ms[event->state];
	return chain_free && entered_ms >= 0 && entered_ms >= bench->chain_ms &&
	       (double)(now_ms(bench) - entered_ms) >= 1000 * event->time_s;
}

static void make_events(struct bench *bench)
{
	bool chain_free = true;

	for (unsigned i = 0; i < bench->options->event_count; i++) {
		const struct event *event = &bench->options->events[i];

		if (bench->events_done & 1u << i)
			continue;
		if (is_due(bench, event, chain_free)) {
			bench->events_done |= 1u << i;
			if (event->state != EVENT_AT_TIME)
				bench->chain_ms = bench->entered_ms[event->state];
			happen(bench, event);
		} else if (event->state != EVENT_AT_TIME) {
			chain_free = false;
		}
	}
}

/* What the spans do to both directions. */
static void make_spans(struct bench *bench)
{
	bool silent = in_span(bench, EVENT_BUS_SILENT);
	bool deaf = in_span(bench, EVENT_BUS_BLOCKED) || in_span(bench, EVENT_BUS_OFF);
	struct frame foreign = {.id = BABBLE_ID, .length = 8};

	busfault_silence(&bench->to_host, silent);
	busfault_silence(&bench->to_tower, silent || deaf);
	if (!in_span(bench, EVENT_BUS_BABBLE))
		return;
	for (unsigned i = 0; i < BABBLE_FRAMES; i++)
		if (ring_put(&bench->queue, &foreign) != 0)
			bench->queue_lost++;
}

static bool is_blocked(const struct bench *bench)
{
	return in_span(bench, EVENT_BUS_BLOCKED) ||
	       (in_span(bench, EVENT_BUS_BABBLE) && now_ms(bench) % 2 == 0);
}

static bool all_done(const struct bench *bench)
{
	return bench->script.phase == SCRIPT_DONE &&
	       bench->events_done == (1ull << bench->options->event_count) - 1;
}

static void watch_end(struct bench *bench)
{
	if (!all_done(bench))
		bench->done_ms = -1;
	else if (bench->done_ms < 0)
		bench->done_ms = now_ms(bench);
	if ((bench->done_ms >= 0 && now_ms(bench) - bench->done_ms >= COUNTERS_MS) ||
	    grid_s(bench->now_grid) >= bench->watch->end_s)
		bench->stop = true;
}

/* ---- one request ---- */

static void each_ms(struct bench *bench)
{
	attend(bench);
	make_events(bench);
	make_spans(bench);
	if (bench->link != NULL)
		poll_link(bench);
	else
		poll_script(bench);
	if (bench->watch != NULL)
		watch_end(bench);
}

static void handle(struct bench *bench, const struct sensorbus_request *request, const struct frame *sent,
                   struct sensorbus_answer *answer, struct frame *received)
{
	int64_t before_grid = bench->now_grid, before_ms = now_ms(bench);

	if (!take_time(bench, request))
		return;
	apply_outputs(bench, request, before_grid);
	sample(bench, request, answer);
	watch_impact(bench);
	for (unsigned i = 0; i < request->frames; i++)
		from_firmware(bench, &sent[i]);
	if (!bench->running || now_ms(bench) != before_ms)
		each_ms(bench);
	bench->running = true;
	while (answer->frames < ANSWER_FRAMES && ring_get(&bench->queue, &received[answer->frames]) == 0) {
		if (bench->watch != NULL)
			observe_to_firmware(&bench->watch->observe, &received[answer->frames],
			                    1e6 * grid_s(bench->now_grid));
		answer->frames++;
	}
	answer->bus_off = in_span(bench, EVENT_BUS_OFF);
	answer->tx_blocked = is_blocked(bench);
	answer->bus_errors = bench->bus_errors;
	bench->bus_errors = 0;
}

static void tell_ready(struct bench *bench)
{
	if (bench->options->ready_fd < 0 || bench->running)
		return;
	if (write(bench->options->ready_fd, "r", 1) != 1)
		bench_say("--ready-fd %d: %s", bench->options->ready_fd, strerror(errno));
	close(bench->options->ready_fd);
}

static void start_target(struct bench *bench, unsigned cause)
{
	const struct bench_options *options = bench->options;
	char message[TARGET_MESSAGE_MAX];

	bench->target = target_start(options->firmware, options->realtime, cause, message);
	if (bench->target == NULL)
		fail(bench, BENCH_LINK, "%s", message);
}

static void end_target(struct bench *bench)
{
	char message[TARGET_MESSAGE_MAX];

	if (target_end(bench->target, message) != 0)
		fail(bench, BENCH_LINK, "%s", message);
	bench->target = NULL;
}

/* A reset from outside: another process with the same tower. What it held of outputs the drivers take over
 * when the new one shows its own. */
static void restart_target(struct bench *bench)
{
	bench->restart = false;
	end_target(bench);
	if (!bench->stop)
		start_target(bench, bench->restart_cause);
}

static void serve(struct bench *bench)
{
	struct frame sent[SENSORBUS_FRAMES_MAX], received[SENSORBUS_FRAMES_MAX];
	char message[TARGET_MESSAGE_MAX];

	for (;;) {
		struct sensorbus_answer answer = {0};
		struct sensorbus_request request;
		int result = target_receive(bench->target, &request, sent, message);

		if (result == 0) { /* told to stop; the firmware is told with its next answer */
			bench->stop = true;
			continue;
		}
		if (result == 1) {
			tell_ready(bench);
			handle(bench, &request, sent, &answer, received);
			answer.stop = bench->stop || bench->restart;
			result = target_answer(bench->target, &answer, received, message);
		}
		if (result < 0)
			fail(bench, BENCH_LINK, "%s, after %.3f s of virtual time", message,
			     grid_s(bench->now_grid));
		if (bench->stop)
			return;
		if (bench->restart)
			restart_target(bench);
	}
}

/* ---- all of a run ---- */

static FILE *open_file(struct bench *bench, const char *path)
{
	FILE *file = path ? fopen(path, "we") : NULL;

	if (path != NULL && file == NULL)
		fail(bench, BENCH_LINK, "%s: %s", path, strerror(errno));
	return file;
}

static void close_file(struct bench *bench, FILE *file, const char *path)
{
	bool failed = file != NULL && ferror(file);

	if (file != NULL && (fclose(file) != 0 || failed))
		fail(bench, BENCH_LINK, "%s: could not be written", path);
}

static void open_link(struct bench *bench)
{
	char message[TARGET_MESSAGE_MAX];

	if (bench->options->link == NULL)
		return;
	bench->link = link_open(bench->options->link, LINK_READ_WRITE, message, sizeof(message));
	if (bench->link == NULL)
		fail(bench, BENCH_LINK, "%s", message);
}

static void start(struct bench *bench)
{
	const struct bench_options *options = bench->options;

	start_target(bench, 0);
	if (!bench->stop)
		bench_say("%s at %g deg, seed %llu, %s, %s", options->scene.name,
		          options->scene.drop_angle_deg, (unsigned long long)options->seed,
		          options->realtime ? "paced by the clock" : "as fast as it goes",
		          options->link ? options->link : "scripted operator");
}

/* Each step only if those before it went well. */
static void set_up(struct bench *bench)
{
	const struct bench_options *options = bench->options;
	struct busfault_options back = options->bus;

	back.cut_resend = false;
	busfault_init(&bench->to_host, &options->bus, options->seed);
	busfault_init(&bench->to_tower, &back, ~options->seed);
	bench->queue = (struct ring)RING_OVER(bench->queue_storage);
	bench->safe_ms = -1;
	bench->impact_s = NAN;
	bench->tower_rate = 1 / (1 + 1e-6 * options->clock_ppm);
	bench->watch = options->watch;
	bench->done_ms = -1;
	bench->event_state = UINT8_MAX;
	for (unsigned state = 0; state < WIRE_STATES; state++)
		bench->entered_ms[state] = -1;
	if (bench->watch != NULL)
		observe_init(&bench->watch->observe, &options->scene);
	script_init(&bench->script, &options->script);
	if (options->ready_fd >= 0) /* the firmware must not keep it open */
		(void)fcntl(options->ready_fd, F_SETFD, FD_CLOEXEC);
	bench->tower = tower_create(&options->scene,
	                            &(struct tower_options){.seed = options->seed, .ideal = options->ideal});
	if (bench->tower == NULL)
		fail(bench, BENCH_LINK, "out of memory");
	if (!bench->stop)
		bench->log = open_file(bench, options->log);
	if (!bench->stop)
		bench->truth = open_file(bench, options->truth);
	codes_init(&bench->codes, bench->truth);
	if (!bench->stop)
		open_link(bench);
	if (!bench->stop)
		start(bench);
}

static void tear_down(struct bench *bench)
{
	end_target(bench);
	codes_flush(&bench->codes);
	close_file(bench, bench->log, bench->options->log);
	close_file(bench, bench->truth, bench->options->truth);
	if (link_close(bench->link) != 0)
		fail(bench, BENCH_LINK, "%s: could not be closed in order", bench->options->link);
	tower_destroy(bench->tower);
}

static void say_bus(const char *way, const struct busfault *fault)
{
	const struct busfault_counters *c = &fault->counters;

	if (c->taken == c->given && c->duplicated == 0 && c->reordered == 0)
		return; /* a bus that did nothing to its frames is not worth a line */
	bench_say("%s: %llu frames sent, %llu arrived; lost %llu at random, %llu in bursts, %llu resent, "
	          "%llu in silence; "
	          "doubled %llu, reordered %llu, held %u",
	          way, (unsigned long long)c->taken, (unsigned long long)c->given,
	          (unsigned long long)c->lost, (unsigned long long)c->burst_lost, (unsigned long long)c->cut,
	          (unsigned long long)c->silenced, (unsigned long long)c->duplicated,
	          (unsigned long long)c->reordered, busfault_held(fault));
}

static void say_summary(const struct bench *bench, double wall_s)
{
	double virtual_s = grid_s(bench->now_grid);

	say_bus("tower to host", &bench->to_host);
	say_bus("host to tower", &bench->to_tower);
	if (bench->edges_outside || bench->queue_lost || bench->not_carried || bench->link_full)
		bench_say(
		        "not as it should be: %llu output edges outside their span, %llu frames to the tower "
		        "without room, %llu not for it, %llu the link did not take",
		        (unsigned long long)bench->edges_outside, (unsigned long long)bench->queue_lost,
		        (unsigned long long)bench->not_carried, (unsigned long long)bench->link_full);
	bench_say("%u drop%s, seed %llu, %.3f s of virtual time in %.3f s, %.2f times real time",
	          bench->impacts, bench->impacts == 1 ? "" : "s", (unsigned long long)bench->options->seed,
	          virtual_s, wall_s, wall_s > 0 ? virtual_s / wall_s : 0.0);
}

static double bus_error(const struct busfault *fault)
{
	const struct busfault_counters *c = &fault->counters;

	return (double)(c->taken + c->duplicated) -
	       (double)(c->given + c->lost + c->burst_lost + c->cut + c->silenced + busfault_held(fault));
}

static void take_results(const struct bench *bench, double wall_s)
{
	struct bench_watch *watch = bench->watch;
	double *results = watch->results;

	for (unsigned i = 0; i < SCENARIO_RESULTS; i++)
		results[i] = NAN;
	observe_results(&watch->observe, results);
	results[SCENARIO_done] = all_done(bench);
	results[SCENARIO_complete] = bench->script.drops_done - bench->script.incomplete;
	results[SCENARIO_discarded] = bench->script.incomplete;
	results[SCENARIO_ledger_bus] = fabs(bus_error(&bench->to_host)) + fabs(bus_error(&bench->to_tower));
	results[SCENARIO_edges_outside] = (double)bench->edges_outside;
	results[SCENARIO_queue_lost] = (double)bench->queue_lost;
	watch->virtual_s = grid_s(bench->now_grid);
	watch->wall_s = wall_s;
}

static double clock_s(void)
{
	struct timespec now;

	clock_gettime(CLOCK_MONOTONIC, &now);
	return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

int bench_run(const struct bench_options *options)
{
	struct bench *bench = calloc(1, sizeof(*bench));
	double begin_s = clock_s();
	int status;

	if (bench == NULL) {
		bench_say("out of memory");
		return BENCH_LINK;
	}
	bench->options = options;
	set_up(bench);
	if (!bench->stop) {
		serve(bench);
		if (bench->running)
			say_summary(bench, clock_s() - begin_s);
		if (bench->watch != NULL)
			take_results(bench, clock_s() - begin_s);
	}
	tear_down(bench);
	status = bench->status;
	free(bench);
	return status;
}
