/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <signal.h>

#include "common/base/number.h"
#include "common/base/option.h"
#include "firmware/port.h"
#include "firmware/port/posix/posix.h"

static int take_cause(const struct option_table *table, const char *name, const char *text, void *cause)
{
	uint64_t number;

	if (!number_whole(text, 0, PORT_RESETS - 1, &number))
		return option_wrong(table, "--%s is '%s', expected 0 to %d", name, text, PORT_RESETS - 1);
	*(enum port_reset *)cause = (enum port_reset)number;
	return OPTIONS_READ;
}

static int take_kept(const struct option_table *table, const char *name, const char *text, void *kept)
{
	uint64_t number;

	if (!number_whole(text, 0, UINT8_MAX, &number))
		return option_wrong(table, "--%s is '%s', expected 0 to 255", name, text);
	*(uint8_t *)kept = (uint8_t)number;
	return OPTIONS_READ;
}

static const struct option_row rows[] = {
        OPTION_TEXT("bus", "PREFIX", struct posix_options, bus,
                    "write requests to PREFIX.request, read answers from PREFIX.answer"),
        OPTION_TEXT("can", "URL", struct posix_options, can,
                    "CAN on a link of its own, unix:PATH, can:IF or slcan:DEV; without it CAN frames ride in "
                    "the requests and answers"),
        OPTION_FLAG("classic", struct posix_options, classic,
                    "the bus carries no CAN FD: captures are uploaded after the drop"),
        OPTION_FLAG("realtime", struct posix_options, realtime,
                    "keep to the clock, a millisecond for a millisecond; without it time stands still until "
                    "the other end has answered"),
        OPTION_TAKEN(
                "reset-cause", "N", struct posix_options, cause, take_cause,
                "boot as after 0 power-on (the default), 1 command, 2 watchdog, 3 brown-out, 4 reset pin"),
        OPTION_TAKEN("kept", "N", struct posix_options, kept, take_kept,
                     "what the firmware before the reset kept over it, 0 to 255"),
};

static const struct option_table known_options = {
        .program = "droptower-firmware",
        .head = "Usage: droptower-firmware --bus PREFIX [OPTION]...\n"
                "\n"
                "The drop tower's controller as a Linux process. It has no sensors, gates and outputs of its "
                "own: "
                "they are\n"
                "at the other end of two FIFOs, normally droptower-bench, which creates them and starts this "
                "program.\n"
                "\n",
        OPTION_ROWS(rows),
        .tail = "\n"
                "Ends with 0 when the other end closes its pipe or says stop, 2 wrong arguments, 4 link or "
                "bus "
                "fault.\n",
};

int main(int argc, char **argv)
{
	struct posix_options wanted = {.cause = PORT_RESET_POWER_ON};
	int code = option_read(&known_options, &wanted, argc, argv);

	if (code != OPTIONS_READ)
		return code;
	if (wanted.bus == NULL)
		return option_wrong(&known_options, "--bus PREFIX is needed");
	signal(SIGPIPE, SIG_IGN);
	return posix_run(&wanted);
}
