/* SPDX-License-Identifier: GPL-2.0-or-later */
#include <getopt.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "hil/board/board.h"

struct board board;

static const char usage[] =
        "Usage: droptower-firmware-board --bus PREFIX [OPTION]...\n"
        "\n"
        "The drop tower's controller as it is flashed to the board: the image itself, from its reset vector, "
        "on\n"
        "an emulated Cortex-M4 with models of the chip's peripherals. Sensors, gates, outputs and CAN are at "
        "the\n"
        "other end of two FIFOs, normally droptower-bench, which creates them and starts this program.\n"
        "\n"
        "  --bus PREFIX       write requests to PREFIX.request, read answers from PREFIX.answer\n"
        "  --reset-cause N    boot as after 0 power-on (the default), 1 command, 2 watchdog, 3 brown-out,\n"
        "                     4 reset pin\n"
        "  --kept N           what the firmware before the reset kept over it, 0 to 255\n"
        "  --image FILE       the ELF file; firmware-stm32g474/firmware.elf beside this program without it\n"
        "  --clocks N         an instruction takes 0, 0.5, 1, 1.5 or 2 clocks; 1 without it\n"
        "  --record FILE      write what is said to the other end, and its answers, to FILE\n"
        "  --compare FILE     no other end: the answers in FILE; end where something else is said (exit 1)\n"
        "  --preempt FILE     no other end: the answers in FILE; interrupt what the image does after every\n"
        "                     instruction, and say what breaks (exit 1)\n"
        "  --shared FILE      with it: memory that main and interrupts share without a lock: address bytes "
        "name\n"
        "  --every N          with it: after each Nth instruction only\n"
        "  --only PLACE       with it: main, control, CAN or gate alone\n"
        "  --share I/N        with it: only the Ith of N parts, from 0\n"
        "  --counts FILE      add the counted instructions of the run to FILE: name calls least most sum\n"
        "  --help             this text\n"
        "\n"
        "Ends with 0 when the other end closes its pipe or says stop, 2 wrong arguments, 4 bus fault, 70 "
        "when\n"
        "the firmware did what the chip does not allow, with one line that says what.\n";

void board_fail(const char *format, ...)
{
	va_list arguments;

	fprintf(stderr, "droptower-firmware-board: ");
	va_start(arguments, format);
	vfprintf(stderr, format, arguments);
	va_end(arguments);
	fprintf(stderr, ", at 0x%08X\n", core_pc());
	preempt_where();
	exit(BOARD_EXIT_FAIL);
}

static _Noreturn void refuse(const char *what, const char *word)
{
	fprintf(stderr, "droptower-firmware-board: %s%s; see --help\n", what, word);
	exit(BOARD_EXIT_USAGE);
}

static unsigned number(const char *text, unsigned most)
{
	char *end;
	unsigned long value = strtoul(text, &end, 10);

	if (*text == '\0' || *end != '\0' || value > most)
		refuse("not a number in its range: ", text);
	return (unsigned)value;
}

static unsigned half_clocks(const char *text)
{
	static const char *const known[] = {"0", "0.5", "1", "1.5", "2"};

	for (unsigned i = 0; i < 5; i++)
		if (strcmp(text, known[i]) == 0)
			return i;
	refuse("--clocks takes 0, 0.5, 1, 1.5 or 2, not ", text);
}

static void read_options(int argc, char **argv, struct board_options *options)
{
	static const struct option known[] = {
	        {"bus", required_argument, NULL, 'b'},
	        {"reset-cause", required_argument, NULL, 'r'},
	        {"kept", required_argument, NULL, 'k'},
	        {"image", required_argument, NULL, 'i'},
	        {"clocks", required_argument, NULL, 'c'},
	        {"counts", required_argument, NULL, 'n'},
	        {"record", required_argument, NULL, 'R'},
	        {"preempt", required_argument, NULL, 'p'},
	        {"compare", required_argument, NULL, 'C'},
	        {"shared", required_argument, NULL, 's'},
	        {"every", required_argument, NULL, 'e'},
	        {"share", required_argument, NULL, 'S'},
	        {"only", required_argument, NULL, 'o'},
	        {"help", no_argument, NULL, 'h'},
	        {NULL, 0, NULL, 0},
	};
	int letter;

	while ((letter = getopt_long(argc, argv, "", known, NULL)) != -1)
		switch (letter) {
		case 'b':
			options->bus = optarg;
			break;
		case 'r':
			options->cause = number(optarg, BOARD_RESETS - 1);
			break;
		case 'k':
			options->kept = number(optarg, UINT8_MAX);
			break;
		case 'i':
			options->image = optarg;
			break;
		case 'c':
			options->half_clocks = half_clocks(optarg);
			break;
		case 'n':
			options->counts = optarg;
			break;
		case 'R':
			options->record = optarg;
			break;
		case 'C':
			options->compare = optarg;
			break;
		case 'p':
			options->preempt = optarg;
			break;
		case 's':
			options->shared = optarg;
			break;
		case 'e':
			options->every = number(optarg, UINT16_MAX);
			break;
		case 'o':
			options->only = optarg;
			break;
		case 'S':
			if (sscanf(optarg, "%u/%u", &options->share, &options->shares) != 2 ||
			    options->share >= options->shares)
				refuse("not a part of so many: ", optarg);
			break;
		case 'h':
			fputs(usage, stdout);
			exit(0);
		default:
			refuse("wrong option", "");
		}
	if ((options->bus != NULL) + (options->preempt != NULL) + (options->compare != NULL) != 1 ||
	    optind != argc)
		refuse("one of --bus, --preempt and --compare is needed, and nothing behind the options", "");
}

/* firmware-stm32g474/firmware.elf next to this program. */
static const char *image_beside(void)
{
	static char path[4096];
	static const char name[] = "firmware-stm32g474/firmware.elf";
	ssize_t length = readlink("/proc/self/exe", path, sizeof(path) - sizeof(name) - 1);
	char *slash;

	if (length < 0)
		refuse("cannot tell where this program lies, give --image", "");
	path[length] = '\0';
	slash = strrchr(path, '/');
	memcpy(slash + 1, name, sizeof(name));
	return path;
}

int main(int argc, char **argv)
{
	board.options.half_clocks = 2;
	board.options.every = board.options.shares = 1;
	read_options(argc, argv, &board.options);
	if (board.options.image == NULL)
		board.options.image = image_beside();
	signal(SIGPIPE, SIG_IGN);
	core_open();
	image_load(board.options.image);
	plant_open(&board.options);
	if (board.options.preempt != NULL)
		preempt_run();
	else
		core_run();
	if (board.options.counts != NULL)
		core_report(board.options.counts);
	return 0;
}
