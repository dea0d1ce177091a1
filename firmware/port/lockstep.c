/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "firmware/port/lockstep.h"

#include "common/memory.h"
#include "common/ring.h"
#include "common/sensorbus.h"
#include "firmware/app.h"
#include "firmware/host_ids.h"

enum {
	TICK_US = 1000,
	RECEIVED = 32, /* what an answer brings at most */
	ROOM = 8,      /* frames in a request that still leaves room for those of the instants ahead */
	KEEPER = 2,    /* the capture behind those of the gates */
	WAITING = 3,   /* frames that the controller takes and cannot send at once */
	BIAS = WIRE_IO_IEPE_S1 | WIRE_IO_IEPE_S2,
	COILS = WIRE_IO_LATCH_OPEN | WIRE_IO_DAMPERS_RELIEVE, /* off while the emergency stop is open */
};

/* The sample instants of a millisecond. Those of X from 1 on are a fraction of a us after floor_us. */
static const struct instant {
	uint8_t group, index;
	uint16_t floor_us;
} instants[LOCKSTEP_INSTANTS] = {
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

static struct machine {
	uint32_t tick_ms, now_us;
	uint16_t outputs, inputs;
	uint16_t scanned, bias; /* bits of the inputs: as converted, as looked at */
	uint8_t scanned_high, bias_high;
	uint8_t edges;                       /* outputs that changed since the last request ... */
	uint32_t edge_us[SENSORBUS_OUTPUTS]; /* ... and when */
	uint8_t off_planned;                 /* outputs that port_off_at will switch ... */
	uint32_t off_us[SENSORBUS_OUTPUTS];  /* ... and when */
	bool first_request, reset_wanted, bus_classic, hung, ahead;
	unsigned behind; /* answers ahead that were taken since the request */
	enum port_bus bus;
	bool tx_blocked;
	uint32_t bus_errors, frames_lost;
	struct sensorbus_answer answer;
	uint8_t captures; /* that control has not seen yet ... */
	uint32_t capture_us[SENSORBUS_CAPTURES];
	uint8_t kept, kept_before;     /* port_keep, now and before the reset */
	struct frame waiting[WAITING]; /* in the controller */
	unsigned waiting_first, waiting_count;
	unsigned sent_count;
	size_t request_bytes; /* in request[], its frames included */
	/* As the frames are sent, so they wait: each is written once. */
	uint8_t request[SENSORBUS_REQUEST_BYTES + SENSORBUS_FRAMES_MAX * SENSORBUS_FRAME_BYTES_MAX];
	struct ring received;
	size_t come, taken; /* bytes of input[] */
	uint8_t input[SENSORBUS_MESSAGE_MAX];
} machine;

/* app_poll takes fewer frames than an answer may bring: the others wait here for the next. */
static struct frame received[RECEIVED];
static enum port_bus link_bus; /* by a link of the port's own, which a reset leaves as it is */

/* ---- what the core calls ---- */

uint32_t port_time_us(void)
{
	return machine.now_us;
}

uint16_t port_io(void)
{
	return machine.inputs | machine.bias | machine.outputs;
}

void port_keep(uint8_t byte)
{
	machine.kept = byte;
}

uint8_t port_kept(void)
{
	return machine.kept_before;
}

uint8_t lockstep_kept(void)
{
	return machine.kept;
}

uint32_t lockstep_random(void)
{
	return machine.answer.random++; /* another one each time */
}

bool port_brown_out_set(void)
{
	return true; /* a simulated supply has no level to set */
}

uint16_t port_bias_high(void)
{
	return (uint16_t)((machine.bias_high & 1 ? WIRE_IO_IEPE_S1 : 0) |
	                  (machine.bias_high & 2 ? WIRE_IO_IEPE_S2 : 0));
}

static void set_outputs(uint16_t outputs, uint32_t time_us)
{
	uint16_t now = machine.inputs & WIRE_IO_ESTOP_CLEAR ? outputs : outputs & (uint16_t)~COILS;
	uint16_t changed = now ^ machine.outputs;

	machine.outputs = now;
	if (changed == 0)
		return;
	for (unsigned i = 0; i < SENSORBUS_OUTPUTS; i++)
		if (changed & 1u << i) {
			machine.edges |= (uint8_t)(1u << i);
			machine.edge_us[i] = time_us;
		}
}

void port_outputs(uint16_t on, uint16_t off)
{
	uint32_t before = lockstep_hold();

	set_outputs((uint16_t)((machine.outputs & ~off) | on), machine.now_us);
	lockstep_release(before);
}

static int plan_off(uint16_t output, uint32_t time_us)
{
	if ((int32_t)(time_us - machine.now_us) < 0) {
		set_outputs(machine.outputs & (uint16_t)~output, machine.now_us);
		return 1;
	}
	for (unsigned i = 0; i < SENSORBUS_OUTPUTS; i++)
		if (output & 1u << i) {
			machine.off_planned |= (uint8_t)(1u << i);
			machine.off_us[i] = time_us;
		}
	return 0;
}

int port_off_at(uint16_t output, uint32_t time_us)
{
	uint32_t before = lockstep_hold();
	int late = plan_off(output, time_us);

	lockstep_release(before);
	return late;
}

void port_off_cancel(uint16_t output)
{
	uint32_t before = lockstep_hold();

	machine.off_planned &= (uint8_t)~output;
	lockstep_release(before);
}

int port_can_setup(bool classic, uint32_t data_kbit_s)
{
	bool known = data_kbit_s == 2000 || data_kbit_s == 5000 || data_kbit_s == 8000;

	/* Neither the sensor bus nor a link of the port has bits to set. */
	if (!known || (!classic && machine.bus_classic))
		return DT_E_ARGUMENT;
	machine.waiting_count = 0;
	return 0;
}

bool lockstep_can_open(void)
{
	return machine.bus != PORT_BUS_OFF && !machine.tx_blocked;
}

static void send_waiting(void)
{
	while (machine.waiting_count > 0 && lockstep_can_open() &&
	       machine.sent_count < SENSORBUS_FRAMES_MAX) {
		machine.request_bytes +=
		        sensorbus_put_frame(machine.request + machine.request_bytes,
		                            &machine.waiting[machine.waiting_first], machine.behind);
		machine.sent_count++;
		machine.waiting_first = (machine.waiting_first + 1) % WAITING;
		machine.waiting_count--;
	}
}

static int take_frame(const struct frame *frame)
{
	if (machine.bus == PORT_BUS_OFF || machine.waiting_count == WAITING)
		return DT_E_FULL;
	machine.waiting[(machine.waiting_first + machine.waiting_count++) % WAITING] = *frame;
	send_waiting();
	return 0;
}

int lockstep_can_send(const struct frame *frame)
{
	uint32_t before = lockstep_hold();
	int result = take_frame(frame);

	lockstep_release(before);
	return result;
}

int lockstep_can_receive(struct frame *frame)
{
	return ring_get(&machine.received, frame) == 0;
}

void lockstep_can_link(uint32_t errors, enum port_bus state)
{
	machine.bus_errors += errors;
	link_bus = state;
}

uint32_t port_can_errors(enum port_bus *state)
{
	*state = machine.bus;
	return machine.bus_errors + machine.frames_lost;
}

void port_reset(void)
{
	machine.reset_wanted = true;
}

bool lockstep_reset_wanted(void)
{
	return machine.reset_wanted;
}

bool lockstep_hung(void)
{
	return machine.hung;
}

/* ---- an instant ---- */

static unsigned at;

unsigned lockstep_instant_us(unsigned instant)
{
	return instants[instant].floor_us;
}

/* Makes the planned edges whose time has come by up_to_us. */
static void make_edges(uint32_t up_to_us)
{
	for (unsigned i = 0; i < SENSORBUS_OUTPUTS && machine.off_planned != 0; i++)
		if ((machine.off_planned & 1u << i) && (int32_t)(up_to_us - machine.off_us[i]) >= 0) {
			set_outputs((uint16_t)(machine.outputs & ~(1u << i)), machine.off_us[i]);
			machine.off_planned &= (uint8_t) ~(1u << i);
		}
}

static void set_time(const struct instant *instant)
{
	uint32_t floor_us = machine.tick_ms * TICK_US + instant->floor_us;
	bool whole = instant->index == 0 || instant->group == SENSORBUS_YZ;

	make_edges(floor_us);
	machine.now_us = floor_us + (whole ? 0 : 1);
}

/* Nothing that main or control could do before the next tick changes an output, nor could the emergency stop:
 * main has taken all frames, and no edge is planned before. What it sends meanwhile must find room. */
static bool ahead_is_welcome(const struct instant *instant)
{
	uint32_t next_tick_us = (machine.tick_ms + 1) * TICK_US;

	if (!machine.ahead || instant->index == 0 || ring_fill(&machine.received) > 0 ||
	    machine.sent_count > ROOM || (machine.outputs & COILS) != 0)
		return false;
	for (unsigned i = 0; i < SENSORBUS_OUTPUTS; i++)
		if ((machine.off_planned & 1u << i) && (int32_t)(machine.off_us[i] - next_tick_us) <= 0)
			return false;
	return true;
}

static int send_request(const struct instant *instant)
{
	struct sensorbus_request request = {
	        .tick_ms = machine.tick_ms,
	        .group = instant->group,
	        .index = instant->index,
	        .outputs = machine.outputs,
	        .edges = machine.edges,
	        .frames = (uint8_t)machine.sent_count,
	        .reset = machine.first_request,
	        .ahead = ahead_is_welcome(instant),
	        .kept = machine.kept,
	};
	int result;

	memcpy(request.edge_us, machine.edge_us, sizeof(request.edge_us));
	(void)sensorbus_put_request(machine.request, &request);
	result = lockstep_write(machine.request, machine.request_bytes);
	machine.request_bytes = SENSORBUS_REQUEST_BYTES;
	machine.sent_count = 0;
	machine.edges = 0;
	machine.first_request = false;
	machine.behind = 0;
	machine.come = machine.taken = 0;
	return result;
}

/* The next bytes of what was answered, read as far as they are not here. */
static int take(void *bytes, size_t count)
{
	int result = 0;

	while (result == 0 && machine.come - machine.taken < count)
		result = lockstep_read(machine.input + machine.come, sizeof(machine.input) - machine.come,
		                       &machine.come);
	if (result != 0)
		return result;
	memcpy(bytes, machine.input + machine.taken, count);
	machine.taken += count;
	return 0;
}

/* As the board's filters let it. */
static bool is_for_the_tower(const struct frame *frame)
{
	bool known = false;

	for (unsigned i = 0; i < HOST_IDS; i++)
		known |= frame->id == host_ids[i];
	return known && (frame->flags & (FRAME_EXTENDED | FRAME_REMOTE)) == 0;
}

static int read_frame(void)
{
	struct frame frame;
	uint8_t head[4];
	unsigned behind;
	int result = take(head, sizeof(head));

	if (result != 0)
		return result;
	result = sensorbus_frame_head(head, &frame, &behind);
	if (result > 0)
		result = take(frame.data, (size_t)result);
	if (result == 0 && is_for_the_tower(&frame) && ring_put(&machine.received, &frame) != 0)
		machine.frames_lost++;
	return result;
}

static int read_frames(unsigned count)
{
	int result = count <= SENSORBUS_FRAMES_MAX ? 0 : DT_E_FORMAT;

	for (unsigned i = 0; i < count && result == 0; i++)
		result = read_frame();
	return result;
}

static enum port_bus bus_of(uint8_t state)
{
	switch (state) {
	case SENSORBUS_BUS_ACTIVE:
		return PORT_BUS_ACTIVE;
	case SENSORBUS_BUS_PASSIVE:
		return PORT_BUS_PASSIVE;
	default:
		return PORT_BUS_OFF;
	}
}

static enum port_bus worse(enum port_bus a, enum port_bus b)
{
	return a > b ? a : b;
}

static int read_answer(void)
{
	uint8_t bytes[SENSORBUS_ANSWER_BYTES];
	struct sensorbus_answer *answer = &machine.answer;
	int result = take(bytes, sizeof(bytes));

	if (result != 0)
		return result;
	sensorbus_get_answer(bytes, answer);
	machine.inputs = answer->inputs & (uint16_t) ~(WIRE_IO_OUTPUTS | BIAS);
	machine.hung |= answer->hang != 0;
	for (unsigned i = 0; i < SENSORBUS_CAPTURES; i++)
		if (answer->captures & 1u << i) {
			machine.captures |= (uint8_t)(1u << i);
			machine.capture_us[i] = answer->capture_us[i];
		}
	machine.bus_errors += answer->bus_errors;
	machine.bus = worse(bus_of(answer->bus_state), link_bus);
	machine.tx_blocked = answer->tx_blocked != 0;
	set_outputs(machine.outputs, machine.now_us);
	send_waiting();
	result = read_frames(answer->frames);
	return result == 0 && answer->then == SENSORBUS_STOP ? LOCKSTEP_GONE : result;
}

/* The board converts the bias with the first Y and Z of a millisecond, and looks at it when the next begins.
 */
static void take_bias(unsigned instant)
{
	if (at == 0) {
		machine.scanned = machine.answer.inputs & BIAS;
		machine.scanned_high = machine.answer.bias_high;
	}
	if (instant == 0) {
		machine.bias = machine.scanned;
		machine.bias_high = machine.scanned_high;
	}
}

int lockstep_exchange(unsigned instant)
{
	int result = 0;

	take_bias(instant);
	at = instant;
	set_time(&instants[instant]);
	if (machine.answer.then == SENSORBUS_MORE)
		machine.behind++;
	else
		result = send_request(&instants[instant]);
	if (instant == LOCKSTEP_INSTANTS - 1)
		machine.tick_ms++;
	return result == 0 ? read_answer() : result;
}

bool lockstep_deliver(void)
{
	const struct sensorbus_answer *answer = &machine.answer;
	const int16_t *codes = answer->codes;

	if (at == 0)
		app_on_turn();
	if (instants[at].group & SENSORBUS_X)
		app_on_x(codes[0], codes[3], answer->ready & SENSORBUS_X);
	if (instants[at].group & SENSORBUS_YZ)
		app_on_yz(codes[1], codes[2], codes[4], codes[5], answer->ready & SENSORBUS_YZ);
	return at == 0 || machine.captures != 0;
}

/* True once after it was captured. */
static bool take_capture(unsigned i, uint32_t *time_us)
{
	uint32_t before = lockstep_hold();
	bool captured = machine.captures & 1u << i;

	machine.captures &= (uint8_t) ~(1u << i);
	*time_us = machine.capture_us[i];
	lockstep_release(before);
	return captured;
}

void lockstep_control(void)
{
	uint32_t time_us;

	for (unsigned gate = 0; gate < KEEPER; gate++)
		if (take_capture(gate, &time_us))
			app_on_gate(gate, time_us);
	if (take_capture(KEEPER, &time_us))
		app_on_keeper(time_us);
	app_on_tick();
}

void lockstep_boot(enum port_reset cause, uint8_t kept, bool bus_classic, bool ahead)
{
	memset(&machine, 0, sizeof(machine));
	machine.outputs = WIRE_IO_MAGNET_HOLD; /* as the drivers hold it in reset */
	machine.received = (struct ring)RING_OVER(received);
	machine.request_bytes = SENSORBUS_REQUEST_BYTES;
	machine.first_request = true;
	machine.bus_classic = bus_classic;
	machine.ahead = ahead;
	machine.kept = machine.kept_before = kept;
	app_init(cause);
}
