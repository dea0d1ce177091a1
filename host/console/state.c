/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/base/room.h"
#include "host/console/state.h"

#include <droptower_version.h>
#include <math.h>
#include <string.h>

#include "common/link/link.h"
#include "common/wire_table.h"

/* A drop's log, its results and what the index keeps of it: rounded up from what drops take. */
static const double drop_bytes = 2e6;

struct bit_name {
	unsigned bit;
	const char *name, *text;
};

static const struct bit_name inputs[] = {
#define WIRE_INPUT(NAME, bit, doc) {bit, #NAME, doc},
#include "common/wire.def"
};
static const struct bit_name outputs[] = {
#define WIRE_OUTPUT(NAME, bit, doc) {bit, #NAME, doc},
#include "common/wire.def"
};

void state_look(struct state *state, struct tower *tower, struct work *work, struct live *live)
{
	memset(state, 0, sizeof(*state));
	tower_look(tower, &state->tower);
	work_look(work, &state->work);
	live_look(live, link_now_us(), &state->live);
}

static bool tower_changed(const struct tower_view *a, const struct tower_view *b)
{
	return a->open != b->open || a->phase != b->phase || a->session.seen != b->session.seen ||
	       a->session.state != b->session.state || a->session.fault != b->session.fault ||
	       a->session.checks != b->session.checks || a->session.io != b->session.io ||
	       (a->armed_until_ms > 0) != (b->armed_until_ms > 0) || a->simulated != b->simulated ||
	       a->simulated_count != b->simulated_count || a->simulated_faults != b->simulated_faults ||
	       strcmp(a->trouble, b->trouble) != 0 || strcmp(a->series, b->series) != 0 ||
	       strcmp(a->drop, b->drop) != 0;
}

bool state_changed(const struct state *a, const struct state *b)
{
	return a->work.revision != b->work.revision || strcmp(a->work.result, b->work.result) != 0 ||
	       strcmp(a->work.trouble, b->work.trouble) != 0 || a->live.classic != b->live.classic ||
	       tower_changed(&a->tower, &b->tower);
}

/* JSON has no NaN. */
static void state_add_number(cJSON *object, const char *name, double value)
{
	if (isfinite(value))
		cJSON_AddNumberToObject(object, name, value);
	else
		cJSON_AddNullToObject(object, name);
}

static void add_tower(cJSON *root, const struct state *state)
{
	const struct tower_view *view = &state->tower;
	const struct session_view *session = &view->session;
	int64_t armed_ms = view->armed_until_ms - session_now_ms();
	int64_t warning_ms = session->release_from_ms - session_now_ms();
	cJSON *tower = cJSON_AddObjectToObject(root, "tower");

	cJSON_AddStringToObject(tower, "url", view->url);
	cJSON_AddBoolToObject(tower, "open", view->open);
	cJSON_AddBoolToObject(tower, "seen", session->seen);
	cJSON_AddStringToObject(tower, "state", session->seen ? wire_state_name(session->state) : "");
	cJSON_AddStringToObject(tower, "text", session->seen ? wire_state_text(session->state) : "");
	cJSON_AddStringToObject(tower, "fault", wire_fault_name(session->fault));
	cJSON_AddStringToObject(tower, "fault_text", wire_fault_text(session->fault));
	cJSON_AddStringToObject(tower, "trouble", view->trouble);
	cJSON_AddBoolToObject(tower, "blocked", view->blocked);
	cJSON_AddStringToObject(tower, "phase", tower_phase_name(view->phase));
	cJSON_AddStringToObject(tower, "drop", view->drop);
	state_add_number(tower, "armed_s", armed_ms > 0 ? (double)armed_ms / 1000.0 : 0.0);
	state_add_number(tower, "warning_s",
	                 armed_ms > 0 && warning_ms > 0 ? (double)warning_ms / 1000.0 : 0.0);
	state_add_number(tower, "heartbeat_age_s", state->live.heartbeat_age_s);
	state_add_number(tower, "drop_id", session->drop_id);
}

static void add_checks(cJSON *root, const struct session_view *session)
{
	cJSON *checks = cJSON_AddArrayToObject(root, "checks");

	for (unsigned i = 0; i < WIRE_CHECKS; i++) {
		cJSON *check = cJSON_CreateObject();

		cJSON_AddStringToObject(check, "name", wire_check_name(i));
		cJSON_AddBoolToObject(check, "green", session->seen && (session->checks >> i & 1u) == 0);
		cJSON_AddStringToObject(check, "text", wire_check_text(i));
		cJSON_AddItemToArray(checks, check);
	}
}

static void add_bits(cJSON *root, const char *name, const struct bit_name *bits, size_t count, unsigned io)
{
	cJSON *array = cJSON_AddArrayToObject(root, name);

	for (size_t i = 0; i < count; i++) {
		cJSON *bit = cJSON_CreateObject();

		cJSON_AddStringToObject(bit, "name", bits[i].name);
		cJSON_AddBoolToObject(bit, "on", (io >> bits[i].bit & 1u) != 0);
		cJSON_AddStringToObject(bit, "text", bits[i].text);
		cJSON_AddItemToArray(array, bit);
	}
}

static void add_losses(cJSON *root, const struct state *state)
{
	const struct link_counters *link = &state->tower.link;
	const struct session_view *session = &state->tower.session;
	cJSON *bus = cJSON_AddObjectToObject(root, "bus"), *lost = cJSON_AddObjectToObject(root, "lost");
	cJSON *counters = cJSON_AddObjectToObject(root, "counters");

	state_add_number(bus, "load_percent", state->live.bus_load_percent);
	state_add_number(bus, "frames_s", state->live.frames_s);
	cJSON_AddBoolToObject(bus, "classic", state->live.classic);
	state_add_number(lost, "blocks", (double)state->live.missing);
	state_add_number(lost, "asked_again", (double)session->asked);
	state_add_number(lost, "link", (double)(link->receive_lost + link->send_lost + link->malformed));
	state_add_number(lost, "errors", (double)link->errors);
	for (unsigned i = 0; i < WIRE_COUNTERS; i++)
		if (session->counter_known[i])
			state_add_number(counters, wire_counter_name(i), session->counters[i]);
}

static void add_series(cJSON *root, const struct state *state)
{
	const struct archive_series *series = &state->work.series;
	cJSON *object;

	if (state->tower.series[0] == '\0' || series->name == NULL ||
	    strcmp(series->name, state->tower.series) != 0) {
		cJSON_AddNullToObject(root, "series");
		return;
	}
	object = cJSON_AddObjectToObject(root, "series");
	cJSON_AddStringToObject(object, "name", series->name);
	cJSON_AddStringToObject(object, "campaign", series->campaign);
	cJSON_AddStringToObject(object, "scene", series->scene_name);
	cJSON_AddStringToObject(object, "title", state->tower.scene.title);
	state_add_number(object, "angle_deg", series->angle_deg);
	state_add_number(object, "height_m", series->height_m);
	state_add_number(object, "planned", series->planned);
	state_add_number(object, "recorded", series->recorded);
	state_add_number(object, "accepted", series->accepted);
	state_add_number(object, "rejected", series->rejected);
	state_add_number(object, "partial", series->partial);
	state_add_number(object, "faulty", series->faulty);
}

static void add_archive(cJSON *root, const struct work_view *work)
{
	cJSON *disk = cJSON_AddObjectToObject(root, "disk"),
	      *archive = cJSON_AddObjectToObject(root, "archive");

	state_add_number(disk, "free_bytes", work->disk_free_bytes);
	state_add_number(disk, "drops_left",
	                 fmax(0, floor((work->disk_free_bytes - ROOM_RESERVE_BYTES) / drop_bytes)));
	cJSON_AddStringToObject(disk, "trouble", work->trouble);
	state_add_number(archive, "revision", (double)work->revision);
	if (work->result[0] != '\0')
		cJSON_AddStringToObject(archive, "result", work->result);
	else
		cJSON_AddNullToObject(archive, "result");
}

static void add_simulation(cJSON *root, const struct tower_view *view)
{
	cJSON *faults;

	if (!view->simulated) {
		cJSON_AddNullToObject(root, "simulation");
		return;
	}
	faults = cJSON_AddArrayToObject(cJSON_AddObjectToObject(root, "simulation"), "faults");
	for (unsigned i = 0; i < view->simulated_count && i < TOWER_SIMULATED_MAX; i++) {
		cJSON *fault = cJSON_CreateObject();

		cJSON_AddStringToObject(fault, "name", view->simulated_name[i]);
		cJSON_AddBoolToObject(fault, "on", (view->simulated_faults >> i & 1u) != 0);
		cJSON_AddItemToArray(faults, fault);
	}
}

cJSON *state_tree(const struct state *state)
{
	cJSON *root = cJSON_CreateObject();
	unsigned io = state->tower.session.io;

	add_tower(root, state);
	add_checks(root, &state->tower.session);
	add_bits(root, "inputs", inputs, sizeof(inputs) / sizeof(inputs[0]), io);
	add_bits(root, "outputs", outputs, sizeof(outputs) / sizeof(outputs[0]), io);
	add_losses(root, state);
	add_archive(root, &state->work);
	add_series(root, state);
	add_simulation(root, &state->tower);
	cJSON_AddStringToObject(root, "version", DT_VERSION);
	return root;
}

char *state_json(const struct state *state)
{
	cJSON *root = state_tree(state);
	char *text = cJSON_PrintUnformatted(root);

	cJSON_Delete(root);
	return text;
}
