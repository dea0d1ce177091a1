/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "hil/bench_private.h"

enum {
	LIFT_AFTER_MS = 2000, /* how long the technician takes once the tower is safe ... */
	LIFT_SOON_MS = 100,   /* ... and in a scenario */
	GRID_X = BENCH_GRID_PER_MS / WIRE_X_PER_TICK,
	GRID_YZ = BENCH_GRID_PER_MS / WIRE_YZ_PER_TICK,
};

/* ---- sample instants ---- */

static int64_t instant_next(int64_t grid)
{
	const int64_t x = (grid / GRID_X + 1) * GRID_X, yz = (grid / GRID_YZ + 1) * GRID_YZ;

	return x < yz ? x : yz;
}

int64_t bench_instant_after(int64_t grid, unsigned instants, int64_t limit)
{
	for (; instants > 0 && grid < limit; instants--)
		grid = instant_next(grid);
	return grid < limit ? grid : limit;
}

bool bench_plant_next(const struct bench *bench, struct sensorbus_request *request)
{
	int64_t grid = instant_next(bench->now_grid % BENCH_GRID_PER_MS);

	request->group =
	        (uint8_t)((grid % GRID_X == 0 ? SENSORBUS_X : 0) | (grid % GRID_YZ == 0 ? SENSORBUS_YZ : 0));
	request->index = (uint8_t)(grid / (grid % GRID_X == 0 ? GRID_X : GRID_YZ));
	request->edges = request->frames = request->reset = 0;
	return grid != BENCH_GRID_PER_MS;
}

/* ---- the plant ---- */

/* False when the request makes no sense. */
static bool bench_plant_take_time(struct bench *bench, const struct sensorbus_request *request)
{
	unsigned per_tick = request->group & SENSORBUS_X ? WIRE_X_PER_TICK : WIRE_YZ_PER_TICK;
	int64_t grid;

	if (request->reset && bench->running) { /* the firmware's clock starts again at the next whole ms */
		bench->base_grid = (bench_now_ms(bench) + 1) * BENCH_GRID_PER_MS;
		if (bench->watch != NULL)
			monitor_reset(&bench->watch->monitor);
	}
	grid = bench->base_grid + (int64_t)request->tick_ms * BENCH_GRID_PER_MS +
	       (int64_t)request->index * (BENCH_GRID_PER_MS / (int64_t)per_tick);
	if (request->group == 0 || request->group > (SENSORBUS_X | SENSORBUS_YZ) ||
	    request->index >= per_tick ||
	    (request->group == (SENSORBUS_X | SENSORBUS_YZ) && request->index) || grid < bench->now_grid) {
		bench_fail(bench, BENCH_LINK,
		           "the firmware's request makes no sense: tick %u, group %u, index %u after %.6f s",
		           request->tick_ms, request->group, request->index, bench_now_s(bench));
		return false;
	}
	bench->now_grid = grid;
	return true;
}

struct edge {
	unsigned bit;
	int64_t time_us;
};

/* The request's edges in the order of their times; one that lies outside the span since the request
 * before is moved to its nearest end and counted. */
static unsigned sort_edges(struct bench *bench, const struct sensorbus_request *request, int64_t before_us,
                           struct edge edges[SENSORBUS_OUTPUTS])
{
	int64_t now_us = bench_grid_us(bench->now_grid), base_us = bench_grid_us(bench->base_grid);
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
	double time_s = fmin(1e-6 * time_us * bench->tower_rate, bench_tower_s(bench, bench->now_grid));

	if (bench->watch != NULL)
		monitor_edge(&bench->watch->monitor, bit, on, time_us, time_s);
	tower_output(bench->tower, bit, on, time_s);
}

static void apply_outputs(struct bench *bench, const struct sensorbus_request *request, int64_t before_grid)
{
	struct edge edges[SENSORBUS_OUTPUTS];
	unsigned count;

	if (request->edges == 0 && request->outputs == bench->outputs)
		return;
	count = sort_edges(bench, request, bench_grid_us(before_grid), edges);
	for (unsigned i = 0; i < count; i++)
		make_edge(bench, edges[i].bit, request->outputs >> edges[i].bit & 1,
		          (double)edges[i].time_us);
	/* Levels that changed without an edge: after a reset. */
	for (unsigned bit = 0; bit < SENSORBUS_OUTPUTS; bit++)
		if (!(request->edges & 1u << bit) && (request->outputs ^ bench->outputs) >> bit & 1)
			make_edge(bench, bit, request->outputs >> bit & 1, 1e6 * bench_now_s(bench));
	bench->outputs = request->outputs;
}

/* Whole us of the tower's clock, rounded down, as the firmware's clock stamps the same instant. */
static uint32_t capture_us(const struct bench *bench, uint32_t time_us)
{
	double firmware_us = floor(((double)time_us + 0.5) / bench->tower_rate);

	return (uint32_t)(int64_t)firmware_us - (uint32_t)bench_grid_us(bench->base_grid);
}

static void bench_plant_sample(struct bench *bench, const struct sensorbus_request *request,
                               struct sensorbus_answer *answer)
{
	double time_s = bench_tower_s(bench, bench->now_grid);

	tower_advance(bench->tower, time_s);
	tower_sample(bench->tower, request->group, answer->codes);
	adc_log_put(&bench->codes, request, answer->codes);
	answer->ready = request->group;
	answer->inputs = tower_inputs(bench->tower);
	answer->bias_high = tower_bias_high(bench->tower);
	for (unsigned i = 0; i < SENSORBUS_CAPTURES; i++) {
		uint32_t time_us;

		if (!tower_capture(bench->tower, i, &time_us))
			continue;
		answer->captures |= (uint8_t)(1u << i);
		answer->capture_us[i] = capture_us(bench, time_us);
	}
	if (bench->watch == NULL)
		return;
	monitor_sample(&bench->watch->monitor, request->group, answer, tower_truth(bench->tower), time_s);
	timeline_sample(bench->watch->timeline, bench_now_s(bench),
	                (uint16_t)(answer->inputs | request->outputs), bench->watch->monitor.state,
	                request->group, answer->codes);
}

static void watch_impact(struct bench *bench)
{
	const struct tower_truth *truth = tower_truth(bench->tower);

	if (isfinite(truth->impact_s) && truth->impact_s != bench->impact_s) {
		bench->impact_s = truth->impact_s;
		bench->impacts++;
		bench->burst_waiting = bench->options->burst > 0;
		bench_tell(bench->options,
		           "drop %u: separated at %.1f mm, impact at %.6f s with %.3f m/s, %.2f deg",
		           bench->impacts, 1e3 * truth->separation_travel_m, truth->impact_s,
		           truth->impact_speed_m_s, truth->angle_deg);
	}
	if (bench->burst_waiting &&
	    bench_tower_s(bench, bench->now_grid) >= bench->impact_s + bench->options->burst_after_s) {
		busfault_burst(&bench->to_host, bench->options->burst);
		bench->burst_waiting = false;
	}
}

static int64_t lift_after_ms(const struct bench *bench)
{
	if (bench->options->lift_after_ms > 0)
		return bench->options->lift_after_ms;
	return bench->watch != NULL ? LIFT_SOON_MS : LIFT_AFTER_MS;
}

/* The technician: lifts frame and product once the tower is safe. */
void bench_plant_attend(struct bench *bench)
{
	bool waiting = bench->state == WIRE_STATE_SAFE && isfinite(tower_truth(bench->tower)->frame_down_s);

	if (!waiting)
		bench->safe_ms = -1;
	else if (bench->safe_ms < 0)
		bench->safe_ms = bench_now_ms(bench);
	else if (bench_now_ms(bench) - bench->safe_ms >= lift_after_ms(bench))
		tower_lift(bench->tower);
}

bool bench_plant_move(struct bench *bench, const struct sensorbus_request *request,
                      struct sensorbus_answer *answer)
{
	int64_t before_grid = bench->now_grid;

	if (!bench_plant_take_time(bench, request))
		return false;
	apply_outputs(bench, request, before_grid);
	bench_plant_sample(bench, request, answer);
	watch_impact(bench);
	return true;
}
