/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <droptower_command.h>
#include <getopt.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/command/command.h"
#include "host/command/evaluate.h"
#include "host/command/notify.h"
#include "host/command/publish.h"
#include "host/command/session.h"
#include "host/command/tower_setup.h"

static const char help[] =
        "usage: droptower bridge --link URL [--lcm URL] [--scene FILE [--angle DEG]]\n"
        "\n"
        "CAN to LCM and commands back: publishes DT_BLOCK, DT_STATE, DT_DROP and DT_RESULT, takes "
        "DT_COMMAND. Keeps\n"
        "the host's heartbeat going, collects every drop until its CRC-32 agrees, accepts and analyses it.\n"
        "\n"
        "  --link URL     unix:PATH, can:IF or slcan:DEV\n"
        "  --lcm URL      default " PUBLISH_URL "\n"
        "  --scene FILE   sets the tower's parameters and adds the model to the results\n"
        "  --angle DEG    contact angle, instead of the scene's\n";

struct bridge {
	const char *link, *lcm, *scene_file;
	double angle_deg;
	bool help;
	struct scene scene;
	struct session *session;
	struct publisher *publisher;
	int publish_error;
	bool commanded; /* a DT_COMMAND waits */
	droptower_command command;
};

static int parse(struct bridge *bridge, int argc, char **argv)
{
	static const struct option options[] = {
	        {"link", required_argument, NULL, 'l'},  {"lcm", required_argument, NULL, 'L'},
	        {"scene", required_argument, NULL, 's'}, {"angle", required_argument, NULL, 'a'},
	        {"help", no_argument, NULL, 'h'},        {0}};
	int option, code = COMMAND_DONE;

	opterr = 0;
	while (code == COMMAND_DONE && (option = getopt_long(argc, argv, "h", options, NULL)) != -1) {
		switch (option) {
		case 'l':
			bridge->link = optarg;
			break;
		case 'L':
			bridge->lcm = optarg;
			break;
		case 's':
			bridge->scene_file = optarg;
			break;
		case 'a':
			code = command_angle("bridge", optarg, &bridge->angle_deg);
			break;
		case 'h':
			bridge->help = true;
			return COMMAND_DONE;
		default:
			return command_option("bridge", argv[optind - 1]);
		}
	}
	if (code == COMMAND_DONE && optind != argc)
		code = command_usage("bridge", "'%s' is too much", argv[optind]);
	if (code == COMMAND_DONE && bridge->link == NULL)
		code = command_usage("bridge", "no --link given");
	if (code == COMMAND_DONE && !isnan(bridge->angle_deg) && bridge->scene_file == NULL)
		code = command_usage("bridge", "--angle needs a --scene to lay it over");
	return code;
}

static void on_frame(void *user, const struct frame *frame)
{
	struct bridge *bridge = user;
	int result = publisher_frame(bridge->publisher, frame);

	if (result != 0)
		bridge->publish_error = result;
}

static bool abort_waits(const struct bridge *bridge)
{
	return bridge->commanded && bridge->command.op == WIRE_OP_ABORT;
}

static void on_command(const lcm_recv_buf_t *buffer, const char *channel, const droptower_command *command,
                       void *user)
{
	struct bridge *bridge = user;

	(void)buffer;
	(void)channel;
	if (abort_waits(bridge))
		return; /* nothing that comes behind an ABORT is carried out before it */
	bridge->commanded = true;
	bridge->command = *command;
}

/* Carries out the command that came in; its outcome goes with the next state. */
static int obey(struct bridge *bridge)
{
	int result;

	if (!bridge->commanded)
		return 0;
	bridge->commanded = false;
	if (bridge->command.op < WIRE_OP_ARM || bridge->command.op > WIRE_OP_CLEAR ||
	    bridge->command.token < 0 || bridge->command.token > UINT16_MAX)
		result = DT_E_ARGUMENT;
	else
		result = session_command(bridge->session, (enum wire_op)bridge->command.op,
		                         (uint16_t)bridge->command.token);
	return publisher_answer(bridge->publisher, bridge->command.utime, result);
}

/* While a command waits for its reply an ABORT must not wait for it. */
static bool cancelled(void *user)
{
	struct bridge *bridge = user;

	while (lcm_handle_timeout(bridge->publisher->lcm, 0) > 0)
		continue;
	return abort_waits(bridge);
}

static int hand_on_drop(struct bridge *bridge)
{
	struct record record;
	char *json;
	int taken = session_take_drop(bridge->session, &record);
	int result;

	if (taken <= 0)
		return taken;
	result = publisher_drop(bridge->publisher, &record);
	json = evaluate_json(&record, bridge->scene_file != NULL ? &bridge->scene : NULL);
	if (json == NULL)
		command_error("drop %u: no result, it cannot be analysed", record.drop_id);
	else if (result == 0)
		result = publisher_result(bridge->publisher, record.drop_id, json);
	fprintf(stderr,
	        "droptower: drop %u: %" PRIu64 " samples lost; %" PRIu64 " blocks, %" PRIu64
	        " states published\n",
	        record.drop_id, record.lost_samples, bridge->publisher->blocks, bridge->publisher->states);
	free(json);
	record_free(&record);
	return result;
}

static int serve(struct bridge *bridge)
{
	int result = 0;

	notify("READY=1");
	while (result == 0 && !command_interrupted()) {
		notify_alive();
		result = session_poll(bridge->session, 5);
		while (result == 0 && lcm_handle_timeout(bridge->publisher->lcm, 0) > 0)
			continue;
		if (result == 0)
			result = obey(bridge);
		if (result == 0)
			result = hand_on_drop(bridge);
		if (result == 0)
			result = bridge->publish_error;
	}
	notify("STOPPING=1");
	return result == 0 ? COMMAND_DONE : command_link_failed("bridge", result);
}

static int bridge_session(struct bridge *bridge)
{
	struct session_options options = {.on_frame = on_frame, .cancelled = cancelled, .user = bridge};
	char message[SESSION_MESSAGE_MAX];
	int code = COMMAND_DONE;

	bridge->session = session_open(bridge->link, &options, message);
	if (bridge->session == NULL) {
		command_error("%s", message);
		return COMMAND_LINK;
	}
	droptower_command_subscribe(bridge->publisher->lcm, PUBLISH_COMMAND, on_command, bridge);
	if (bridge->scene_file != NULL) {
		code = tower_setup_hear(bridge->session, message);
		if (code == COMMAND_DONE)
			code = tower_setup_write(bridge->session, &bridge->scene, message);
		if (code != COMMAND_DONE)
			command_error("%s", message);
	}
	if (code == COMMAND_DONE)
		code = serve(bridge);
	session_close(bridge->session);
	return code;
}

int command_bridge(int argc, char **argv)
{
	struct bridge bridge = {.lcm = PUBLISH_URL, .angle_deg = NAN};
	char message[PUBLISH_MESSAGE_MAX];
	int code = parse(&bridge, argc, argv);

	if (code == COMMAND_DONE && bridge.help) {
		fputs(help, stdout);
		return COMMAND_DONE;
	}
	if (code == COMMAND_DONE && bridge.scene_file != NULL)
		code = evaluate_read_scene(&bridge.scene, bridge.scene_file, bridge.angle_deg);
	if (code != COMMAND_DONE)
		return code;
	command_catch_signals();
	bridge.publisher = publisher_open(bridge.lcm, message);
	if (bridge.publisher == NULL) {
		command_error("%s", message);
		return COMMAND_LINK;
	}
	code = bridge_session(&bridge);
	publisher_close(bridge.publisher);
	return code;
}
