/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * droptower-bench: reads the command line, see usage below and hil/README.md.
 */
#include <errno.h>
#include <getopt.h>
#include <math.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hil/bench.h"

static const char usage[] =
        "droptower-bench --scene FILE (--link URL | --operate) [OPTION]...\n"
        "Runs a firmware against the simulated tower.\n"
        "\n"
        "  --scene FILE         what is dropped (common/scenes/*.ini)\n"
        "  --angle DEG          contact angle instead of the scene's\n"
        "  --link URL           the host's CAN: unix:PATH, can:IF, ...; until SIGINT or SIGTERM\n"
        "  --operate            no host: a scripted operator in virtual time\n"
        "  --drops N            as many drops of the operator (1)\n"
        "  --firmware COMMAND   instead of droptower-firmware beside this program\n"
        "  --pace max|1         as fast as it goes (with --operate), by the clock (with --link)\n"
        "  --seed N             of the tower's scatter and noise and of the bus (1)\n"
        "  --ideal              no noise, no scatter, no high-pass\n"
        "  --loss P             frames lost, probability, both ways\n"
        "  --burst N@+SECONDS   N live blocks in a row lost, so long after each impact\n"
        "  --duplicate P        frames that come twice\n"
        "  --reorder P          frames held back behind the next 1 to 3\n"
        "  --cut-resend         no resent block passes\n"
        "  --fault NAME@SECONDS of the tower, at a virtual time; may be repeated:\n"
        "                      ";

enum {
	OPTION_SCENE = 1,
	OPTION_ANGLE,
	OPTION_LINK,
	OPTION_OPERATE,
	OPTION_DROPS,
	OPTION_FIRMWARE,
	OPTION_PACE,
	OPTION_SEED,
	OPTION_IDEAL,
	OPTION_LOSS,
	OPTION_BURST,
	OPTION_DUPLICATE,
	OPTION_REORDER,
	OPTION_CUT_RESEND,
	OPTION_FAULT,
	OPTION_LOG,
	OPTION_TRUTH,
	OPTION_READY_FD,
	OPTION_HELP,
};

static const struct option options_long[] = {
        {"scene", required_argument, NULL, OPTION_SCENE},
        {"angle", required_argument, NULL, OPTION_ANGLE},
        {"link", required_argument, NULL, OPTION_LINK},
        {"operate", no_argument, NULL, OPTION_OPERATE},
        {"drops", required_argument, NULL, OPTION_DROPS},
        {"firmware", required_argument, NULL, OPTION_FIRMWARE},
        {"pace", required_argument, NULL, OPTION_PACE},
        {"seed", required_argument, NULL, OPTION_SEED},
        {"ideal", no_argument, NULL, OPTION_IDEAL},
        {"loss", required_argument, NULL, OPTION_LOSS},
        {"burst", required_argument, NULL, OPTION_BURST},
        {"duplicate", required_argument, NULL, OPTION_DUPLICATE},
        {"reorder", required_argument, NULL, OPTION_REORDER},
        {"cut-resend", no_argument, NULL, OPTION_CUT_RESEND},
        {"fault", required_argument, NULL, OPTION_FAULT},
        {"log", required_argument, NULL, OPTION_LOG},
        {"truth", required_argument, NULL, OPTION_TRUTH},
        {"ready-fd", required_argument, NULL, OPTION_READY_FD},
        {"help", no_argument, NULL, OPTION_HELP},
        {0},
};

/* What is read besides the bench's own options. */
struct line {
	struct bench_options bench;
	bool operate, drops_given;
	const char *pace;
};

__attribute__((format(printf, 1, 2), noreturn)) static void refuse(const char *format, ...)
{
	char text[400];
	va_list arguments;

	va_start(arguments, format);
	vsnprintf(text, sizeof(text), format, arguments);
	va_end(arguments);
	bench_say("%s (--help lists the options)", text);
	exit(BENCH_USAGE);
}

static void help(void)
{
	fputs(usage, stdout);
	for (int i = 0; i < TOWER_FAULTS; i++)
		printf(" %s%s", tower_fault_name((enum tower_fault)i),
		       i == TOWER_FAULTS / 2 ? "\n                      " : "");
	fputs("\n"
	      "  --log FILE           frames on the host's side, candump text in virtual time\n"
	      "  --truth FILE         converter codes: tick sensor x0..x6 y0..y9 z0..z9\n"
	      "  --ready-fd N         gets one byte when the firmware runs\n"
	      "\n"
	      "Exit: 0 done, 1 a drop of the operator did not end complete and SAFE, 2 usage,\n"
	      "3 scene unusable, 4 link or firmware\n",
	      stdout);
	exit(BENCH_DONE);
}

static double number(const char *name, const char *text, double min, double max)
{
	char *end;
	double value = strtod(text, &end);

	if (end == text || *end != '\0' || !(value >= min && value <= max))
		refuse("--%s %s: expected a number from %g to %g", name, text, min, max);
	return value;
}

static unsigned long long whole(const char *name, const char *text, unsigned long long min,
                                unsigned long long max)
{
	char *end;
	unsigned long long value;

	errno = 0;
	value = strtoull(text, &end, 10);
	if (*text < '0' || *text > '9' || *end != '\0' || errno != 0 || value < min || value > max)
		refuse("--%s %s: expected a whole number from %llu to %llu", name, text, min, max);
	return value;
}

/* "LEFT@SECONDS" or "LEFT@+SECONDS": copies LEFT and returns the seconds. */
static double split_at(const char *name, const char *text, char *left, size_t size)
{
	const char *at = strchr(text, '@');

	if (at == NULL || (size_t)(at - text) >= size)
		refuse("--%s %s: expected %sSECONDS", name, text,
		       strcmp(name, "burst") == 0 ? "N@+" : "NAME@");
	memcpy(left, text, (size_t)(at - text));
	left[at - text] = '\0';
	return number(name, at + 1, 0.0, 1e6);
}

static void add_fault(struct bench_options *bench, const char *text)
{
	char name[32];
	double time_s = split_at("fault", text, name, sizeof(name));

	if (bench->fault_count == BENCH_FAULTS_MAX)
		refuse("--fault %s: only %d faults in a run", text, BENCH_FAULTS_MAX);
	for (int i = 0; i < TOWER_FAULTS; i++) {
		if (strcmp(name, tower_fault_name((enum tower_fault)i)) == 0) {
			bench->faults[bench->fault_count++] =
			        (struct bench_fault){(enum tower_fault)i, time_s};
			return;
		}
	}
	refuse("--fault %s: the tower has no such fault", text);
}

static void set_burst(struct bench_options *bench, const char *text)
{
	char count[16];

	bench->burst_after_s = split_at("burst", text, count, sizeof(count));
	bench->burst = (unsigned)whole("burst", count, 1, 1000000);
}

/* The options of the bus; false for another one. */
static bool take_bus_option(struct bench_options *bench, int option, const char *text)
{
	switch (option) {
	case OPTION_LOSS:
		bench->bus.loss = number("loss", text, 0.0, 1.0);
		return true;
	case OPTION_BURST:
		set_burst(bench, text);
		return true;
	case OPTION_DUPLICATE:
		bench->bus.duplicate = number("duplicate", text, 0.0, 1.0);
		return true;
	case OPTION_REORDER:
		bench->bus.reorder = number("reorder", text, 0.0, 1.0);
		return true;
	case OPTION_CUT_RESEND:
		bench->bus.cut_resend = true;
		return true;
	default:
		return false;
	}
}

static bool take_file_option(struct bench_options *bench, int option, const char *text)
{
	switch (option) {
	case OPTION_SCENE:
		bench->scene_file = text;
		return true;
	case OPTION_LINK:
		bench->link = text;
		return true;
	case OPTION_FIRMWARE:
		bench->firmware = text;
		return true;
	case OPTION_LOG:
		bench->log = text;
		return true;
	case OPTION_TRUTH:
		bench->truth = text;
		return true;
	case OPTION_READY_FD:
		bench->ready_fd = (int)whole("ready-fd", text, 0, 1023);
		return true;
	default:
		return false;
	}
}

static void take_option(struct line *line, int option, const char *text)
{
	struct bench_options *bench = &line->bench;

	switch (option) {
	case OPTION_ANGLE:
		bench->angle_deg = number("angle", text, -360.0, 360.0); /* the scene knows the true limits */
		break;
	case OPTION_OPERATE:
		line->operate = true;
		break;
	case OPTION_DROPS:
		bench->drops = (unsigned)whole("drops", text, 1, 1000000);
		line->drops_given = true;
		break;
	case OPTION_PACE:
		line->pace = text;
		break;
	case OPTION_SEED:
		bench->seed = whole("seed", text, 0, UINT64_MAX);
		break;
	case OPTION_IDEAL:
		bench->ideal = true;
		break;
	case OPTION_FAULT:
		add_fault(bench, text);
		break;
	default:
		help();
	}
}

static void check(struct line *line)
{
	struct bench_options *bench = &line->bench;

	if (bench->scene_file == NULL)
		refuse("--scene FILE is missing");
	if (line->operate == (bench->link != NULL))
		refuse("expected either --link URL or --operate");
	if (line->drops_given && !line->operate)
		refuse("--drops counts the drops of --operate; with --link the host decides");
	if (line->pace != NULL && strcmp(line->pace, "max") != 0 && strcmp(line->pace, "1") != 0)
		refuse("--pace %s: expected max or 1", line->pace);
	bench->realtime = line->pace ? strcmp(line->pace, "1") == 0 : !line->operate;
}

int main(int argc, char **argv)
{
	struct line line = {.bench = {.angle_deg = NAN, .seed = 1, .drops = 1, .ready_fd = -1}};
	int option;

	signal(SIGPIPE, SIG_IGN); /* a broken pipe is an error code, not an end */
	opterr = 0;
	while ((option = getopt_long(argc, argv, ":", options_long, NULL)) != -1) {
		if (option == ':')
			refuse("%s: an argument is missing", argv[optind - 1]);
		if (option == '?')
			refuse("%s: no such option", argv[optind - 1]);
		if (!take_bus_option(&line.bench, option, optarg) &&
		    !take_file_option(&line.bench, option, optarg))
			take_option(&line, option, optarg);
	}
	if (optind < argc)
		refuse("%s: expected an option", argv[optind]);
	check(&line);
	return bench_run(&line.bench);
}
