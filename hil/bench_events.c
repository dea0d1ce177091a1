/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "hil/bench_private.h"
#include "hil/random.h"

enum {
	BABBLE_FRAMES = 8, /* of the foreign node, a ms */
	BABBLE_ID = 0x010,
	BUS_PASSIVE_ERRORS = 16, /* that make a controller error-passive: 8 points each, 128 in all */
	BUS_OFF_ERRORS = 32,     /* that bring a controller there: 8 points each, 256 in all */
};

bool bench_in_span(const struct bench *bench, enum event_action action)
{
	return bench_now_ms(bench) < bench->until_ms[action];
}

static void begin_span(struct bench *bench, const struct event *event)
{
	if (event->action == EVENT_BUS_OFF)
		bench->bus_errors = (uint16_t)(bench->bus_errors + BUS_OFF_ERRORS);
	if (event->action == EVENT_BUS_PASSIVE)
		bench->bus_errors = (uint16_t)(bench->bus_errors + BUS_PASSIVE_ERRORS);
	if (event->action == EVENT_HOST_REPLAY)
		bench_replay_start(bench);
	bench->until_ms[event->action] = bench_now_ms(bench) + (int64_t)(1000 * event->duration_s + 0.5);
}

/* What goes wrong, other than what is mended or sent. */
static bool goes_wrong(enum event_action action)
{
	return action != EVENT_REPAIR && action != EVENT_SEND && action != EVENT_VERB;
}

void bench_event(struct bench *bench, const struct event *event)
{
	if (bench->watch != NULL && goes_wrong(event->action))
		monitor_event(&bench->watch->monitor, bench_now_s(bench));
	switch (event->action) {
	case EVENT_FAULT:
	case EVENT_REPAIR:
		tower_fault(bench->tower, (enum tower_fault)event->number, event->action == EVENT_FAULT);
		bench_tell(bench->options, "%s%s at %.3f s",
		           tower_fault_name((enum tower_fault)event->number),
		           event->action == EVENT_FAULT ? "" : " repaired", bench_now_s(bench));
		break;
	case EVENT_DROPOUT:
		tower_set_dropout(bench->tower, event->duration_s);
		break;
	case EVENT_FRICTION:
		tower_set_friction(bench->tower, event->value);
		break;
	case EVENT_SPIKE:
		tower_spike(bench->tower, event->number, event->value);
		break;
	case EVENT_LET_GO:
		tower_let_go(bench->tower);
		if (bench->watch != NULL)
			hazard_let_go(&bench->watch->monitor.hazard);
		break;
	case EVENT_GLITCH:
		tower_glitch(bench->tower, event->number, event->pulses);
		break;
	case EVENT_SEND:
		bench_from_host(bench, &event->frame);
		break;
	case EVENT_VERB:
		bench_verb(bench, event);
		break;
	case EVENT_BUS_BURST:
		busfault_burst(&bench->to_host, event->number);
		break;
	case EVENT_RESET:
		bench->restart = true;
		bench->restart_cause = event->number;
		break;
	case EVENT_HANG:
		bench->hang = true;
		break;
	default:
		begin_span(bench, event);
	}
}

/* Events at a state come in their order: each counts from an entry that does not lie before the one that the
 * event before it counted from. */
static bool bench_events_is_due(const struct bench *bench, const struct event *event, bool chain_free)
{
	int64_t entered_ms;

	if (event->state == EVENT_AT_TIME)
		return bench_now_s(bench) >= event->time_s;
	entered_ms = bench->entered_ms[event->state];
	return chain_free && entered_ms >= 0 && entered_ms >= bench->chain_ms &&
	       (double)(bench_now_ms(bench) - entered_ms) >= 1000 * event->time_s;
}

static void make_events(struct bench *bench)
{
	bool chain_free = true;

	for (unsigned i = 0; i < bench->options->event_count; i++) {
		const struct event *event = &bench->options->events[i];

		if (bench->event_done[i])
			continue;
		if (bench_events_is_due(bench, event, chain_free)) {
			bench->event_done[i] = true;
			bench->events_done++;
			if (event->state != EVENT_AT_TIME)
				bench->chain_ms = bench->entered_ms[event->state];
			bench_event(bench, event);
		} else if (event->state != EVENT_AT_TIME) {
			chain_free = false;
		}
	}
}

/* What the spans do to both directions. */
static void make_spans(struct bench *bench)
{
	bool silent = bench_in_span(bench, EVENT_BUS_SILENT);
	bool deaf = bench_in_span(bench, EVENT_BUS_BLOCKED) || bench_in_span(bench, EVENT_BUS_OFF);
	struct frame foreign = {.id = BABBLE_ID, .length = 8};

	busfault_silence(&bench->to_host, silent);
	busfault_silence(&bench->to_tower, silent || deaf);
	if (!bench_in_span(bench, EVENT_BUS_BABBLE))
		return;
	for (unsigned i = 0; i < BABBLE_FRAMES; i++)
		if (ring_put(&bench->queue, &foreign) != 0)
			bench->queue_lost++;
}

static bool is_blocked(const struct bench *bench)
{
	return bench_in_span(bench, EVENT_BUS_BLOCKED) ||
	       (bench_in_span(bench, EVENT_BUS_BABBLE) && bench_now_ms(bench) % 2 == 0);
}

bool bench_events_done(const struct bench *bench)
{
	bool over = bench->events_done == bench->options->event_count;

	for (unsigned action = 0; action < EVENT_ACTIONS; action++)
		over = over && !bench_in_span(bench, (enum event_action)action);
	return over;
}

void bench_events(struct bench *bench)
{
	make_events(bench);
	make_spans(bench);
	bench_foreign(bench);
}

static uint8_t bus_state(const struct bench *bench)
{
	if (bench_in_span(bench, EVENT_BUS_OFF))
		return SENSORBUS_BUS_OFF;
	return bench_in_span(bench, EVENT_BUS_PASSIVE) ? SENSORBUS_BUS_PASSIVE : SENSORBUS_BUS_ACTIVE;
}

void bench_events_answer(struct bench *bench, struct sensorbus_answer *answer)
{
	answer->bus_state = bus_state(bench);
	answer->random = (uint32_t)random_next(&bench->random);
	answer->tx_blocked = is_blocked(bench);
	answer->bus_errors = bench->bus_errors;
	answer->hang = bench->hang;
	bench->bus_errors = 0;
	bench->hang = false;
}
