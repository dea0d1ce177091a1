/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <time.h>
#include <unistd.h>

#include "hil/bench_private.h"

enum {
	COUNTERS_MS = 100 * WIRE_COUNTERS + 200, /* in which every counter is told */
};

static void hil_bench_say(const char *format, va_list arguments)
{
	fputs("droptower-bench: ", stderr);
	vfprintf(stderr, format, arguments);
	fputc('\n', stderr);
}

void bench_say(const char *format, ...)
{
	va_list arguments;

	va_start(arguments, format);
	hil_bench_say(format, arguments);
	va_end(arguments);
}

void bench_tell(const struct bench_options *options, const char *format, ...)
{
	va_list arguments;

	if (options->quiet)
		return;
	va_start(arguments, format);
	hil_bench_say(format, arguments);
	va_end(arguments);
}

void bench_fail(struct bench *bench, int status, const char *format, ...)
{
	va_list arguments;

	if (bench->status == BENCH_DONE) {
		va_start(arguments, format);
		hil_bench_say(format, arguments);
		va_end(arguments);
		bench->status = status;
	}
	bench->stop = true;
}

/* ---- one request ---- */

static bool all_done(const struct bench *bench)
{
	return bench->script.phase == SCRIPT_DONE && bench_events_done(bench);
}

/* What is left when the last drop has been accepted goes on while the counters are told. */
static void bench_watch_end(struct bench *bench)
{
	bool last = bench->script.phase == SCRIPT_RETURN &&
	            bench->script.drops_done + 1 == bench->options->script.drops;

	if (!all_done(bench) && !(last && bench_events_done(bench)))
		bench->done_ms = -1;
	else if (bench->done_ms < 0)
		bench->done_ms = bench_now_ms(bench);
	if ((bench->done_ms >= 0 &&
	     bench_now_ms(bench) - bench->done_ms >= (bench->watch->soon ? 0 : COUNTERS_MS)) ||
	    bench_now_s(bench) >= bench->watch->end_s)
		bench->stop = true;
}

static void each_ms(struct bench *bench)
{
	bench_plant_attend(bench);
	bench_control(bench);
	bench_events(bench);
	bench_host(bench);
	if (bench->watch != NULL)
		bench_watch_end(bench);
}

/* At the instants at which they would have come, each with a request of its own. */
static void take_frames(struct bench *bench, const struct sensorbus_request *request, struct frame *sent,
                        int64_t asked_grid)
{
	int64_t now_grid = bench->now_grid;

	for (unsigned i = 0; i < request->frames; i++) {
		bench->now_grid = bench_instant_after(asked_grid, 1 + (unsigned)sent[i].time_us, now_grid);
		sent[i].time_us = 0;
		bench_from_firmware(bench, &sent[i]);
	}
	bench->now_grid = now_grid;
}

static void handle(struct bench *bench, const struct sensorbus_request *request, struct frame *sent,
                   struct sensorbus_answer *answer, struct frame *received)
{
	int64_t before_ms = bench_now_ms(bench), asked_grid = bench->asked_grid;

	if (!bench_plant_move(bench, request, answer))
		return;
	bench->asked_grid = bench->now_grid;
	take_frames(bench, request, sent, asked_grid);
	if (!bench->running || bench_now_ms(bench) != before_ms)
		each_ms(bench);
	bench->running = true;
	bench->kept = request->kept;
	bench_to_firmware(bench, answer, received);
	bench_events_answer(bench, answer);
}

/* The rest of the tick as long as nothing comes that the firmware could act on; how many answers in all. */
static unsigned answer_ahead(struct bench *bench, struct sensorbus_request *request,
                             struct sensorbus_answer *answers)
{
	unsigned count = 1;

	if (!request->ahead || answers[0].frames > 0 || ring_fill(&bench->queue) > 0)
		return count;
	while (!bench->stop && answers[count - 1].captures == 0 && bench_plant_next(bench, request)) {
		answers[count] = (struct sensorbus_answer){0};
		if (!bench_plant_move(bench, request, &answers[count]))
			break;
		bench_events_answer(bench, &answers[count]);
		answers[count - 1].then = SENSORBUS_MORE;
		count++;
	}
	return count;
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
	const struct target_options options = {.inside = bench->options->inside,
	                                       .command = bench->options->firmware,
	                                       .realtime = bench->options->link != NULL,
	                                       .cause = cause,
	                                       .kept = cause == 0 ? 0 : bench->kept};
	char message[TARGET_MESSAGE_MAX];

	bench->target = target_start(&options, message);
	if (bench->target == NULL)
		bench_fail(bench, BENCH_LINK, "%s", message);
}

static void end_target(struct bench *bench)
{
	char message[TARGET_MESSAGE_MAX];

	if (target_end(bench->target, message) != 0)
		bench_fail(bench, BENCH_LINK, "%s", message);
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

static void bench_serve(struct bench *bench)
{
	struct frame sent[SENSORBUS_FRAMES_MAX], received[SENSORBUS_FRAMES_MAX];
	char message[TARGET_MESSAGE_MAX];

	for (;;) {
		struct sensorbus_answer answers[SENSORBUS_ANSWERS_MAX];
		struct sensorbus_request request;
		unsigned count = 1;
		int result = target_receive(bench->target, &request, sent, message);

		if (result == 0) { /* told to stop; the firmware is told with its next answer */
			bench->stop = true;
			continue;
		}
		if (result == 1) {
			tell_ready(bench);
			answers[0] = (struct sensorbus_answer){0};
			handle(bench, &request, sent, answers, received);
			if (!bench->stop && !bench->restart)
				count = answer_ahead(bench, &request, answers);
			if (bench->stop || bench->restart)
				answers[count - 1].then = SENSORBUS_STOP;
			result = target_answer(bench->target, answers, count, received, message);
		}
		if (result < 0)
			bench_fail(bench, BENCH_LINK, "%s, after %.3f s of virtual time", message,
			           bench_now_s(bench));
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
		bench_fail(bench, BENCH_LINK, "%s: %s", path, strerror(errno));
	return file;
}

static void close_file(struct bench *bench, FILE *file, const char *path)
{
	bool failed = file != NULL && ferror(file);

	if (file != NULL && (fclose(file) != 0 || failed))
		bench_fail(bench, BENCH_LINK, "%s: could not be written", path);
}

static void bench_open_link(struct bench *bench)
{
	char message[TARGET_MESSAGE_MAX];

	if (bench->options->link == NULL)
		return;
	bench->link = link_open(bench->options->link, LINK_READ_WRITE, message, sizeof(message));
	if (bench->link == NULL)
		bench_fail(bench, BENCH_LINK, "%s", message);
}

static void bench_start(struct bench *bench)
{
	const struct bench_options *options = bench->options;

	start_target(bench, 0);
	if (!bench->stop)
		bench_tell(options, "%s at %g deg, seed %llu, %s, %s", options->scene.name,
		           options->scene.drop_angle_deg, (unsigned long long)options->seed,
		           options->link ? "paced by the clock" : "as fast as it goes",
		           options->link ? options->link : "scripted operator");
}

/* The script's run repeats for its seed; a host's must not: what it recorded once would be right again. */
static void set_up_random(struct bench *bench)
{
	bench->random = ~bench->options->seed;
	if (bench->options->link != NULL &&
	    getrandom(&bench->random, sizeof(bench->random), 0) != (ssize_t)sizeof(bench->random))
		bench_fail(bench, BENCH_LINK, "no random number: %s", strerror(errno));
}

/* Each step only if those before it went well. */
static void bench_set_up(struct bench *bench)
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
	bench->dice = options->seed ^ 0x666F726765;
	set_up_random(bench);
	bench->done_ms = -1;
	bench->control = -1;
	bench->event_state = UINT8_MAX;
	for (unsigned state = 0; state < WIRE_STATES; state++)
		bench->entered_ms[state] = -1;
	if (bench->watch != NULL)
		monitor_init(&bench->watch->monitor, &options->scene, bench->tower_rate);
	script_init(&bench->script, &options->script);
	if (options->ready_fd >= 0) /* the firmware must not keep it open */
		(void)fcntl(options->ready_fd, F_SETFD, FD_CLOEXEC);
	bench->tower = tower_create(&options->scene,
	                            &(struct tower_options){.seed = options->seed, .ideal = options->ideal});
	if (bench->tower == NULL)
		bench_fail(bench, BENCH_LINK, "out of memory");
	if (!bench->stop)
		bench->log = open_file(bench, options->log);
	if (!bench->stop)
		bench->truth = open_file(bench, options->truth);
	adc_log_init(&bench->codes, bench->truth);
	if (!bench->stop)
		bench_open_link(bench);
	if (!bench->stop)
		bench_control_open(bench);
	if (!bench->stop)
		bench_start(bench);
}

static void tear_down(struct bench *bench)
{
	end_target(bench);
	bench_control_close(bench);
	adc_log_flush(&bench->codes);
	close_file(bench, bench->log, bench->options->log);
	close_file(bench, bench->truth, bench->options->truth);
	if (link_close(bench->link) != 0)
		bench_fail(bench, BENCH_LINK, "%s: could not be closed in order", bench->options->link);
	tower_destroy(bench->tower);
}

static void say_bus(const struct bench *bench, const char *way, const struct busfault *fault)
{
	const struct busfault_counters *c = &fault->counters;

	if (c->taken == c->given && c->duplicated == 0 && c->reordered == 0)
		return; /* a bus that did nothing to its frames is not worth a line */
	bench_tell(bench->options,
	           "%s: %llu frames sent, %llu arrived; lost %llu at random, %llu in bursts, %llu resent, "
	           "%llu in silence; "
	           "doubled %llu, reordered %llu, held %u",
	           way, (unsigned long long)c->taken, (unsigned long long)c->given,
	           (unsigned long long)c->lost, (unsigned long long)c->burst_lost, (unsigned long long)c->cut,
	           (unsigned long long)c->silenced, (unsigned long long)c->duplicated,
	           (unsigned long long)c->reordered, busfault_held(fault));
}

static void say_summary(const struct bench *bench, double wall_s)
{
	double virtual_s = bench_now_s(bench);

	say_bus(bench, "tower to host", &bench->to_host);
	say_bus(bench, "host to tower", &bench->to_tower);
	if (bench->edges_outside || bench->queue_lost || bench->not_carried || bench->link_full)
		bench_say(
		        "not as it should be: %llu output edges outside their span, %llu frames to the tower "
		        "without room, %llu not for it, %llu the link did not take",
		        (unsigned long long)bench->edges_outside, (unsigned long long)bench->queue_lost,
		        (unsigned long long)bench->not_carried, (unsigned long long)bench->link_full);
	bench_tell(bench->options,
	           "%u drop%s, seed %llu, %.3f s of virtual time in %.3f s, %.2f times real time",
	           bench->impacts, bench->impacts == 1 ? "" : "s", (unsigned long long)bench->options->seed,
	           virtual_s, wall_s, wall_s > 0 ? virtual_s / wall_s : 0.0);
}

static double bus_error(const struct busfault *fault)
{
	const struct busfault_counters *c = &fault->counters;

	return (double)(c->taken + c->duplicated) -
	       (double)(c->given + c->lost + c->burst_lost + c->cut + c->silenced + busfault_held(fault));
}

static void bench_take_results(const struct bench *bench, double wall_s)
{
	struct bench_watch *watch = bench->watch;
	double *results = watch->results;

	for (unsigned i = 0; i < SCENARIO_RESULTS; i++)
		results[i] = NAN;
	monitor_results(&watch->monitor, results);
	results[SCENARIO_done] = all_done(bench);
	results[SCENARIO_complete] = bench->script.drops_done - bench->script.incomplete;
	results[SCENARIO_discarded] = bench->script.incomplete;
	results[SCENARIO_ledger_bus] = fabs(bus_error(&bench->to_host)) + fabs(bus_error(&bench->to_tower));
	results[SCENARIO_edges_outside] = (double)bench->edges_outside;
	results[SCENARIO_queue_lost] = (double)bench->queue_lost;
	watch->virtual_s = bench_now_s(bench);
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
	bench_set_up(bench);
	if (!bench->stop) {
		bench_serve(bench);
		if (bench->running)
			say_summary(bench, clock_s() - begin_s);
		if (bench->watch != NULL)
			bench_take_results(bench, clock_s() - begin_s);
	}
	tear_down(bench);
	status = bench->status;
	free(bench);
	return status;
}
