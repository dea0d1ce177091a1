/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * damage FILE MOST: reads FILE, a file of ours, then MOST files of each kind that differ from it: a bit of a
 * byte turned round, a digit replaced, the end cut off; every place when there are no more than MOST, else
 * every Nth. Prints a line of outcomes for each kind.
 *
 *   same     reads as before; what only counts frames may differ
 *   marked   reads otherwise, and a flag of the record says so, not one of the drop
 *   refused  one line that names the file
 *   silent   samples or what is known of the drop differ, and nothing says so: each of the first is told
 *
 * Exit 0: nothing silent; 1: something was; 2: a message that is no line, or FILE that cannot be read.
 */
#include <fcntl.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "host/record/read.h"

enum { TELL_MAX = 5, BITS = 8, OTHER_DIGITS = 9 };
/* What these tell is of the drop, not of the file. */
#define OF_THE_DROP                                                                                  \
	(RECORD_FLAG_CLIPPED | RECORD_FLAG_SLOW_FRAME | RECORD_FLAG_NO_IMPACT | RECORD_FLAG_FAULT |  \
	 RECORD_FLAG_FULL_SCALE | RECORD_FLAG_OVERRUN | RECORD_FLAG_ZERO_SHIFT | RECORD_FLAG_CABLE | \
	 RECORD_FLAG_STUCK | RECORD_FLAG_SEPARATED_LATE | RECORD_FLAG_DROPOUT_CHANGED |              \
	 RECORD_FLAG_FRAME_NOT_DOWN)

enum outcome { SAME, MARKED, REFUSED, SILENT, OUTCOMES };

struct trial {
	char path[64];
	int fd;
	const unsigned char *bytes;
	size_t size;
	struct record record; /* as it was */
	unsigned long long silent;
};

/* ---- what differs ---- */

static bool other(double a, double b)
{
	return !(a == b || (isnan(a) && isnan(b)));
}

static const char *channel_differs(const struct channel *a, const struct channel *b)
{
	if (strcmp(a->name, b->name) != 0)
		return "a channel's name";
	if (other(a->rate_hz, b->rate_hz) || other(a->start_s, b->start_s) || a->count != b->count)
		return "a channel's times";
	if (other(a->range_g, b->range_g))
		return "a channel's range";
	for (size_t k = 0; k < a->count; k++)
		if (other(a->value_g[k], b->value_g[k]) || a->sample[k] != b->sample[k])
			return "a sample";
	return NULL;
}

static bool measured_differs(const struct wire_measured *a, const struct wire_measured *b)
{
	return a->dropout_us != b->dropout_us || a->dropout_used_us != b->dropout_used_us ||
	       a->separation_mm_s != b->separation_mm_s || a->separation_um != b->separation_um ||
	       a->acceleration_mm_s2 != b->acceleration_mm_s2 || a->latch_delay_us != b->latch_delay_us ||
	       a->clock_ppm != b->clock_ppm || a->trigger_latency_us != b->trigger_latency_us;
}

/* A part that is there or not is told as such; one that is there and says something else is not. */
static const char *tower_differs(const struct record *a, const struct record *b)
{
	if (b->crc_known && (a->parameters_crc32 != b->parameters_crc32 || a->trigger_us != b->trigger_us))
		return "the capture end";
	if (b->seal_known && a->seal != b->seal)
		return "the seal";
	if (b->measured_known && measured_differs(&a->measured, &b->measured))
		return "what the tower measured";
	for (unsigned i = 0; i < WIRE_PARAMETERS; i++)
		if (b->parameters_held >> i & 1 && a->parameters[i] != b->parameters[i])
			return "a parameter";
	return NULL;
}

static const char *differs(const struct record *a, const struct record *b)
{
	const char *what = NULL;

	if (a->channel_count != b->channel_count)
		return "the channels";
	for (size_t c = 0; c < a->channel_count && what == NULL; c++)
		what = channel_differs(&a->channels[c], &b->channels[c]);
	if (what != NULL)
		return what;
	if (a->is_drop != b->is_drop || a->drop_id != b->drop_id)
		return "the drop's number";
	if (a->first_tick_ms != b->first_tick_ms || a->last_tick_ms != b->last_tick_ms)
		return "the drop's ticks";
	if (other(a->trigger_s, b->trigger_s))
		return "the trigger";
	if (other(a->frame_speed_m_s, b->frame_speed_m_s))
		return "the frame's speed";
	if (a->camera_frame != b->camera_frame)
		return "the camera's frame";
	if (a->marks != b->marks)
		return "the marks";
	return tower_differs(a, b);
}

/* ---- one file ---- */

static bool is_one_line(const char *message, const char *path)
{
	return strncmp(message, path, strlen(path)) == 0 && strchr(message, '\n') == NULL;
}

static enum outcome read_again(struct trial *trial, const char *where)
{
	char message[READ_MESSAGE_MAX] = "";
	struct record record;
	const char *what;
	bool marked;

	if (read_record(&record, trial->path, NULL, message) != 0) {
		if (!is_one_line(message, trial->path)) {
			printf("# %s: \"%s\"\n", where, message);
			exit(2);
		}
		return REFUSED;
	}
	what = differs(&trial->record, &record);
	marked = (record.flags & ~trial->record.flags & ~(unsigned)(OF_THE_DROP)) != 0;
	record_free(&record);
	if (what == NULL)
		return SAME;
	if (marked)
		return MARKED;
	if (trial->silent++ < TELL_MAX)
		printf("# silent: %s: %s\n", where, what);
	return SILENT;
}

static void put(const struct trial *trial, const void *bytes, size_t size, size_t at)
{
	if (pwrite(trial->fd, bytes, size, (off_t)at) != (ssize_t)size)
		exit(2);
}

/* ---- kinds of damage: places, and what is done at the nth ---- */

struct kind {
	const char *name;
	size_t (*places)(const struct trial *trial);
	enum outcome (*damage)(struct trial *trial, size_t place);
};

static size_t bit_places(const struct trial *trial)
{
	return trial->size * BITS;
}

static enum outcome replace(struct trial *trial, size_t at, unsigned char by)
{
	char where[64];
	enum outcome outcome;

	snprintf(where, sizeof(where), "byte %zu, %02x as %02x", at, trial->bytes[at], by);
	put(trial, &by, 1, at);
	outcome = read_again(trial, where);
	put(trial, &trial->bytes[at], 1, at);
	return outcome;
}

static enum outcome turn_bit(struct trial *trial, size_t place)
{
	size_t at = place / BITS;

	return replace(trial, at, (unsigned char)(trial->bytes[at] ^ 1u << place % BITS));
}

static bool is_digit(unsigned char byte)
{
	return byte >= '0' && byte <= '9';
}

static size_t digit_places(const struct trial *trial)
{
	size_t count = 0;

	for (size_t i = 0; i < trial->size; i++)
		count += is_digit(trial->bytes[i]) ? OTHER_DIGITS : 0;
	return count;
}

static enum outcome other_digit(struct trial *trial, size_t place)
{
	size_t at = 0, left = place / OTHER_DIGITS;

	while (!is_digit(trial->bytes[at]) || left-- > 0)
		at++;
	return replace(trial, at,
	               (unsigned char)('0' + (trial->bytes[at] - '0' + 1u + place % OTHER_DIGITS) % 10));
}

static size_t end_places(const struct trial *trial)
{
	return trial->size - 1;
}

static enum outcome cut_end(struct trial *trial, size_t place)
{
	char where[64];
	enum outcome outcome;

	snprintf(where, sizeof(where), "cut behind %zu bytes", place + 1);
	if (ftruncate(trial->fd, (off_t)place + 1) != 0)
		exit(2);
	outcome = read_again(trial, where);
	put(trial, trial->bytes, trial->size, 0);
	return outcome;
}

static void try_kind(struct trial *trial, const struct kind *kind, size_t most)
{
	size_t places = kind->places(trial), files = places < most ? places : most;
	unsigned long long count[OUTCOMES] = {0};

	for (size_t i = 0; i < files; i++)
		count[kind->damage(trial, (size_t)((double)i * (double)places / (double)files))]++;
	printf("%-8s %-6s %7zu %7llu %7llu %7llu %7llu\n", trial->record.format, kind->name, files,
	       count[SAME], count[MARKED], count[REFUSED], count[SILENT]);
}

static int load(struct trial *trial, const char *file)
{
	char message[READ_MESSAGE_MAX];
	int in = open(file, O_RDONLY | O_CLOEXEC);
	off_t size = in >= 0 ? lseek(in, 0, SEEK_END) : -1;
	void *bytes = size > 0 ? mmap(NULL, (size_t)size, PROT_READ, MAP_PRIVATE, in, 0) : MAP_FAILED;

	trial->fd = memfd_create("damaged", 0); /* HDF5 files are read by a program of their own */
	if (bytes == MAP_FAILED || trial->fd < 0)
		return -1;
	trial->bytes = bytes;
	trial->size = (size_t)size;
	snprintf(trial->path, sizeof(trial->path), "/proc/%ld/fd/%d", (long)getpid(), trial->fd);
	put(trial, bytes, trial->size, 0);
	if (read_record(&trial->record, trial->path, NULL, message) == 0)
		return 0;
	fprintf(stderr, "%s: %s\n", file, message);
	return -1;
}

int main(int argc, char **argv)
{
	static const struct kind kinds[] = {{"bits", bit_places, turn_bit},
	                                    {"digits", digit_places, other_digit},
	                                    {"ends", end_places, cut_end}};
	static struct trial trial;
	size_t most = argc == 3 ? (size_t)strtoul(argv[2], NULL, 10) : 0;

	if (most == 0 || load(&trial, argv[1]) != 0)
		return 2;
	for (unsigned i = 0; i < sizeof(kinds) / sizeof(kinds[0]); i++)
		try_kind(&trial, &kinds[i], most);
	record_free(&trial.record);
	return trial.silent > 0;
}
