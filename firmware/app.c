/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "firmware/app.h"

#include "common/memory.h"
#include "firmware/command.h"

enum {
	BEAT_MS = 100, /* heartbeat, status, capture end */
	STATUS_PHASE_MS = 50,
	SYNC_MS = 1000,
	SYNC_COUNTER_MAX = 240, /* CiA 301 */
	DAY_MS = 86400000,
	FRAMES_PER_POLL = 8,
	TICKS_PER_POLL = 4,
	NMT_BOOT_UP = 0,
	NMT_OPERATIONAL = 5,
	ERROR_GENERIC = 1 << 0, /* CiA 301 error register */
	ERROR_COMMUNICATION = 1 << 4,
	ERROR_OURS = 1 << 7,
};

static struct app app;

static const struct command_scope commands = {
        .parameters = &app.parameters,
        .set = &app.set,
        .counters = app.counters,
        .hosts = &app.hosts,
        .sequence = &app.sequence,
        .capture = &app.capture,
        .measure = &app.measure,
        .stream = &app.stream,
        .acquire = &app.acquire,
        .input = &app.input,
        .health = &app.health,
        .tick_ms = &app.tick_ms,
        .wire_hash = &app.wire_hash,
};

/* A bus without FD is told from one with it by the port's refusal. */
static void start_bus(void)
{
	app.bus_ready = stream_set_up(&app.stream, &app.parameters) == 0;
	if (app.bus_ready)
		return;
	app.parameters.value[WIRE_PARAMETER_bus_mode] = 1;
	app.bus_ready = stream_set_up(&app.stream, &app.parameters) == 0;
}

void app_init(enum port_reset cause)
{
	memset(&app, 0, sizeof(app));
	parameters_init(&app.parameters);
	sequence_init(&app.sequence, &app.parameters, app.counters, cause); /* first: the magnet */
	acquire_init(&app.acquire, &app.parameters, app.counters);
	hosts_init(&app.hosts, &app.parameters, app.counters);
	input_init(&app.input);
	measure_init(&app.measure, &app.parameters);
	health_init(&app.health, &app.parameters, app.counters);
	capture_init(&app.capture, &app.parameters);
	stream_init(&app.stream, app.counters);
	app.wire_hash = wire_hash();
	app.tick_ms = UINT32_MAX; /* the first tick is 0 */
	app.seen_ms = UINT32_MAX;
	start_bus();
}

/* Control, or main between port_lock and port_unlock. */
static struct sequence_view view_now(uint16_t pins)
{
	return health_look(&app.health, &app.input, pins, &app.acquire,
	                   hosts_here(&app.hosts, app.sequence.session));
}

/* ---- control interrupt ---- */

void app_on_tick(void)
{
	uint32_t begun = acquire_close(&app.acquire);
	uint16_t pins;
	struct sequence_view view;

	if (begun == 0)
		return;
	pins = port_io();
	app.tick_ms += begun;
	app.tick_us = port_time_us();
	input_read(&app.input, pins & (uint16_t)~WIRE_IO_OUTPUTS);
	hosts_tick(&app.hosts, app.tick_ms);
	view = view_now(pins);
	sequence_tick(&app.sequence, &view, app.tick_ms);
	acquire_open(&app.acquire,
	             &(struct acquire_head){
	                     .tick_ms = app.tick_ms,
	                     .drop_id = app.sequence.drop_id,
	                     .io = input_io(&app.input, port_io()), /* the tick may have switched some */
	                     .marks = sequence_tick_marks(&app.sequence),
	                     .state = app.sequence.state,
	             });
}

void app_on_gate(unsigned gate, uint32_t time_us)
{
	sequence_gate(&app.sequence, gate, time_us);
}

void app_on_keeper(uint32_t time_us)
{
	sequence_keeper(&app.sequence, time_us);
}

/* ---- sample interrupts ---- */

void app_on_turn(void)
{
	acquire_turn(&app.acquire);
}

void app_on_x(int16_t s1x, int16_t s2x, bool ready)
{
	acquire_x(&app.acquire, (const int16_t[]){s1x, s2x}, ready);
}

void app_on_yz(int16_t s1y, int16_t s1z, int16_t s2y, int16_t s2z, bool ready)
{
	acquire_yz(&app.acquire, (const int16_t[]){s1y, s2y}, (const int16_t[]){s1z, s2z}, ready);
}

/* ---- main ---- */

/* What main looks at in every poll. */
struct glance {
	uint8_t state, fault;
};

static struct glance take_glance(void)
{
	struct glance now;

	port_lock();
	now = (struct glance){(uint8_t)app.sequence.state, (uint8_t)app.sequence.fault};
	port_unlock();
	return now;
}

static struct sequence snapshot(void)
{
	struct sequence now;

	port_lock();
	now = app.sequence;
	port_unlock();
	return now;
}

static void send_heartbeat(void)
{
	struct wire_heartbeat heartbeat = {.nmt_state = NMT_OPERATIONAL, .wire_hash = app.wire_hash};
	struct frame frame;

	if (!app.started)
		heartbeat.nmt_state = NMT_BOOT_UP;
	app.started = true;
	wire_pack_heartbeat(&frame, WIRE_ID_HEARTBEAT_TOWER, &heartbeat);
	stream_send(&app.stream, &frame);
}

static void send_status(void)
{
	struct sequence now = snapshot();
	struct wire_status status = {.state = now.state, .fault = now.fault};
	struct sequence_view view;
	struct wire_counter counter = {.index = app.next_counter};
	struct frame frame;

	port_lock();
	view = view_now(port_io());
	port_unlock();
	status.io = view.io;
	status.checks = sequence_checks(&now, view.checks);
	wire_pack_status(&frame, WIRE_ID_STATUS, &status);
	stream_send(&app.stream, &frame);
	counter.value = app.counters[app.next_counter]; /* now: frames_sent counts all before this one */
	wire_pack_counter(&frame, WIRE_ID_COUNTER, &counter);
	stream_send(&app.stream, &frame);
	app.next_counter = (uint8_t)((app.next_counter + 1u) % WIRE_COUNTERS);
}

static void send_time(uint32_t tick_ms)
{
	struct wire_time time = {.ms = tick_ms % DAY_MS, .days = (uint16_t)(tick_ms / DAY_MS)};
	struct frame frame;

	app.sync_counter = (uint8_t)(app.sync_counter % SYNC_COUNTER_MAX + 1u);
	wire_pack_sync(&frame, WIRE_ID_SYNC, &(struct wire_sync){.counter = app.sync_counter});
	stream_send(&app.stream, &frame);
	wire_pack_time(&frame, WIRE_ID_TIME, &time);
	stream_send(&app.stream, &frame);
}

static void send_emergency(uint8_t fault)
{
	static const uint16_t codes[WIRE_FAULTS] = {
#define WIRE_FAULT(NAME, emcy, doc) emcy,
#include "common/wire.def"
	};
	struct wire_emcy emcy = {.code = codes[fault], .fault = fault, .tick_ms = app.tick_ms};
	struct frame frame;

	if (fault != WIRE_FAULT_NONE)
		emcy.error_register = ERROR_GENERIC;
	if (emcy.code >> 8 == 0x81)
		emcy.error_register |= ERROR_COMMUNICATION;
	if (emcy.code >> 8 == 0xFF)
		emcy.error_register |= ERROR_OURS;
	wire_pack_emcy(&frame, WIRE_ID_EMCY, &emcy);
	stream_send(&app.stream, &frame);
}

static void send_capture_end(void)
{
	struct sequence now = snapshot();
	struct wire_capture_end end = {
	        .drop_id = now.drop_id,
	        .marks = (uint16_t)(now.marks | app.capture.marks | app.measured_marks),
	        .first_tick_ms = app.capture.first_ms,
	        .last_tick_ms = app.capture.last_ms,
	        .trigger_us = app.capture.trigger_us,
	        .crc32 = app.capture.crc32,
	        .frame_speed_mm_s = now.frame_speed_mm_s,
	        .camera_frame = (int16_t)(app.capture.first_ms - now.released_ms), /* seconds, at most */
	        .parameters_crc32 = now.parameters_crc32,
	};
	struct frame frame;

	wire_pack_capture_end(&frame, WIRE_ID_CAPTURE_END, &end);
	wire_seal_capture_end(&frame);
	stream_send(&app.stream, &frame);
}

static void send_capture(void)
{
	static const uint16_t indices[WIRE_PARAMETERS] = {
#define WIRE_PARAMETER(name, index, unit, min, max, initial, doc) index,
#include "common/wire.def"
	};
	struct wire_parameter parameter = {.drop_id = app.measured.drop_id};
	struct frame frame;

	send_capture_end();
	wire_pack_measured(&frame, WIRE_ID_MEASURED, &app.measured);
	wire_seal_measured(&frame);
	stream_send(&app.stream, &frame);
	for (unsigned i = 0; i < WIRE_PARAMETERS; i++) {
		parameter.index = indices[i];
		parameter.value = app.set.value[i];
		wire_pack_parameter(&frame, WIRE_ID_PARAMETER, &parameter);
		stream_send(&app.stream, &frame);
	}
	app.capture_end_ms = app.tick_ms;
}

/* The window is complete: what the drop says of its tower. */
static void app_measure(const struct sequence *now)
{
	app.measured.drop_id = now->drop_id;
	port_lock();
	app.measured.clock_ppm = acquire_clock_ppm(&app.acquire);
	port_unlock();
	app.measured.trigger_latency_us = app.trigger_latency_us;
	app.measured_marks = measure_drop(&app.measure, &now->plan, &now->times, &app.measured);
}

static void finish_capture(void)
{
	uint32_t limit = app.parameters.value[WIRE_PARAMETER_zero_shift_counts];
	struct sequence now;

	port_lock();
	sequence_full(&app.sequence);
	port_unlock();
	now = snapshot();
	if (!sequence_captured(now.state)) { /* triggered just when the release turned out to be none */
		capture_release(&app.capture);
		return;
	}
	if (capture_zero_shift(&app.capture, app.health.zero, limit))
		app.capture.marks |= WIRE_MARK_ZERO_SHIFT;
	app_measure(&now);
	send_capture();
	stream_upload(&app.stream, &app.capture);
}

/* From the sample beyond the level until now; a window that was forced has none. */
static void note_trigger(void)
{
	uint32_t tick_ms = app.capture.first_ms + app.capture.trigger_us / 1000u;
	uint32_t began_us; /* that tick */

	port_lock();
	sequence_triggered(&app.sequence);
	began_us = app.tick_us - (app.tick_ms - tick_ms) * 1000u;
	port_unlock();
	app.trigger_latency_us = MEASURE_NONE;
	if (!app.capture.forced)
		app.trigger_latency_us =
		        measure_us((int32_t)(port_time_us() - began_us - app.capture.trigger_us % 1000u));
}

/* Between whatever takes long, since a RELEASE may be among them. */
static void receive(void)
{
	struct frame frame;

	for (unsigned i = 0; i < FRAMES_PER_POLL && port_can_receive(&frame) == 1; i++)
		if (command_handle(&commands, &frame))
			send_capture();
}

static void send_block(const struct acquire_tick *tick, unsigned sensor)
{
	struct frame block;

	receive();
	if (app.stream.classic)
		return;
	acquire_pack(tick, sensor, sensor == 0 ? WIRE_ID_BLOCK_S1 : WIRE_ID_BLOCK_S2, &block);
	receive();
	stream_block(&app.stream, &block);
}

/* The ticks that the interrupt has finished: into the ring, and out. */
static void take_ticks(void)
{
	enum capture_phase before = app.capture.phase;
	struct acquire_tick tick;

	for (unsigned i = 0; i < TICKS_PER_POLL && acquire_take(&app.acquire, &tick) == 0; i++) {
		for (unsigned sensor = 0; sensor < WIRE_SENSORS; sensor++) {
			receive();
			health_samples(&app.health, &tick, sensor);
		}
		receive();
		capture_put(&app.capture, &tick);
		for (unsigned sensor = 0; sensor < WIRE_SENSORS; sensor++)
			send_block(&tick, sensor);
	}
	if (before == CAPTURE_ROLLING && app.capture.phase != CAPTURE_ROLLING)
		note_trigger();
	if (capture_work(&app.capture))
		finish_capture();
}

/* A bus-off disarms; in motion the drop goes on without the bus. */
static void disarm(void)
{
	port_lock();
	if (app.sequence.state == WIRE_STATE_ARMED)
		sequence_fault(&app.sequence, WIRE_FAULT_BUS_OFF);
	port_unlock();
}

/* Off the bus is told once it is back, error-passive at once: that can still be sent. */
static void watch_bus(const struct glance *now)
{
	enum port_bus bus, before = app.bus;

	app.counters[WIRE_COUNTER_bus_errors] = port_can_errors(&bus);
	app.bus = bus;
	if (bus == before)
		return;
	if (bus == PORT_BUS_OFF) {
		app.counters[WIRE_COUNTER_bus_offs]++;
		disarm();
	}
	if (before == PORT_BUS_OFF && now->fault != WIRE_FAULT_BUS_OFF)
		send_emergency(WIRE_FAULT_BUS_OFF);
	if (bus == PORT_BUS_PASSIVE && before == PORT_BUS_ACTIVE) {
		app.counters[WIRE_COUNTER_bus_passives]++;
		send_emergency(WIRE_FAULT_BUS_PASSIVE);
	}
}

/* Before the first tick there is no time to tell. */
static void watch_fault(const struct glance *now)
{
	if (now->fault == app.fault_reported || app.tick_ms == UINT32_MAX)
		return;
	send_emergency(now->fault);
	app.fault_reported = now->fault;
}

/* A multiple of the period has passed since the last tick seen; also when main is late. */
static bool due(uint32_t tick_ms, uint32_t phase_ms, uint32_t period_ms)
{
	return (tick_ms + phase_ms) / period_ms != (app.seen_ms + phase_ms) / period_ms;
}

/* What is due in the tick that has just begun. */
static void beat(const struct glance *now, uint32_t tick_ms)
{
	port_watchdog_kick();
	app.counters[WIRE_COUNTER_ticks_late] += tick_ms - app.seen_ms - 1;
	if (due(tick_ms, 0, SYNC_MS))
		send_time(tick_ms);
	if (due(tick_ms, 0, BEAT_MS))
		send_heartbeat();
	if (due(tick_ms, STATUS_PHASE_MS, BEAT_MS))
		send_status();
	app.seen_ms = tick_ms;
	if (!app.bus_ready && !sequence_moving(now->state))
		start_bus();
	if (sequence_captured(now->state) && tick_ms - app.capture_end_ms >= BEAT_MS)
		send_capture();
	receive();
	stream_resend(&app.stream, &app.capture);
}

void app_poll(void)
{
	struct glance now;
	uint32_t tick_ms;

	stream_flush(&app.stream);
	receive();
	take_ticks();
	receive();
	now = take_glance();
	watch_bus(&now);
	watch_fault(&now);
	tick_ms = app.tick_ms;
	if (tick_ms != app.seen_ms)
		beat(&now, tick_ms);
}
