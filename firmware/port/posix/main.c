/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <getopt.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>

#include "firmware/port.h"
#include "firmware/port/posix/posix.h"

static const char usage[] =
        "Usage: droptower-firmware --bus PREFIX [OPTION]...\n"
        "\n"
        "The drop tower's controller as a Linux process. It has no sensors, gates and outputs of its own: "
        "they are\n"
        "at the other end of two FIFOs, normally droptower-bench, which creates them and starts this "
        "program.\n"
        "\n"
        "  --bus PREFIX       write requests to PREFIX.request, read answers from PREFIX.answer\n"
        "  --can URL          CAN on a link of its own, unix:PATH, can:IF or slcan:DEV; without it CAN "
        "frames ride\n"
        "                     in the requests and answers\n"
        "  --classic          the bus carries no CAN FD: captures are uploaded after the drop\n"
        "  --realtime         keep to the clock, a millisecond for a millisecond; without it time stands "
        "still\n"
        "                     until the other end has answered\n"
        "  --reset-cause N    boot as after 0 power-on (the default), 1 command, 2 watchdog, 3 brown-out,\n"
        "                     4 reset pin\n"
        "  --kept N           what the firmware before the reset kept over it, 0 to 255\n"
        "  --help             this text\n"
        "\n"
        "Ends with 0 when the other end closes its pipe or says stop, 2 wrong arguments, 4 link or bus "
        "fault.\n";

enum {
	OPTION_BUS = 1,
	OPTION_CAN,
	OPTION_CLASSIC,
	OPTION_REALTIME,
	OPTION_RESET_CAUSE,
	OPTION_KEPT,
	OPTION_HELP
};

static const struct option options[] = {
        {"bus", required_argument, NULL, OPTION_BUS},
        {"can", required_argument, NULL, OPTION_CAN},
        {"classic", no_argument, NULL, OPTION_CLASSIC},
        {"realtime", no_argument, NULL, OPTION_REALTIME},
        {"reset-cause", required_argument, NULL, OPTION_RESET_CAUSE},
        {"kept", required_argument, NULL, OPTION_KEPT},
        {"help", no_argument, NULL, OPTION_HELP},
        {NULL, 0, NULL, 0},
};

static int refuse(const char *what, const char *value)
{
	fprintf(stderr, "droptower-firmware: %s%s; see --help\n", what, value);
	return POSIX_EXIT_USAGE;
}

static int parse_number(const char *text, unsigned long max, unsigned long *number)
{
	char *end;
	unsigned long value = strtoul(text, &end, 10);

	if (*text < '0' || *text > '9' || *end != '\0' || value > max)
		return DT_E_ARGUMENT;
	*number = value;
	return 0;
}

int main(int argc, char **argv)
{
	struct posix_options wanted = {.cause = PORT_RESET_POWER_ON};
	unsigned long number;
	int option;

	while ((option = getopt_long(argc, argv, "", options, NULL)) != -1) {
		switch (option) {
		case OPTION_BUS:
			wanted.bus = optarg;
			break;
		case OPTION_CAN:
			wanted.can = optarg;
			break;
		case OPTION_CLASSIC:
			wanted.classic = true;
			break;
		case OPTION_REALTIME:
			wanted.realtime = true;
			break;
		case OPTION_RESET_CAUSE:
			if (parse_number(optarg, PORT_RESETS - 1, &number) != 0)
				return refuse("--reset-cause takes 0 to 4, not ", optarg);
			wanted.cause = (enum port_reset)number;
			break;
		case OPTION_KEPT:
			if (parse_number(optarg, UINT8_MAX, &number) != 0)
				return refuse("--kept takes 0 to 255, not ", optarg);
			wanted.kept = (uint8_t)number;
			break;
		case OPTION_HELP:
			fputs(usage, stdout);
			return 0;
		default:
			return POSIX_EXIT_USAGE; /* getopt has said why */
		}
	}
	if (optind < argc)
		return refuse("no arguments expected beside options, got ", argv[optind]);
	if (wanted.bus == NULL)
		return refuse("--bus PREFIX is needed", "");
	signal(SIGPIPE, SIG_IGN);
	return posix_run(&wanted);
}
