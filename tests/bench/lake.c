/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * lake OUT SCRATCH COUNT EACH LOG...: COUNT drops in LCM logs of EACH, OUT/lake-00001.lcm and on. Drop k is
 * that of the log k modulo their number with other noise of a count, -1 0 0 1 drawn for each sample from k,
 * sealed as the tower would: no two have the same samples. SCRATCH: a folder in memory.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/base/number.h"
#include "common/base/text.h"
#include "common/crc.h"
#include "common/wire.h"
#include "host/record/drop.h"
#include "host/record/write.h"

enum { NAME_BYTES = 4200 };

static void must(int result, const char *message)
{
	if (result == 0)
		return;
	fprintf(stderr, "lake: %s\n", message);
	exit(1);
}

static unsigned draw(uint64_t *state)
{
	*state ^= *state << 13;
	*state ^= *state >> 7;
	*state ^= *state << 17;
	return (unsigned)(*state >> 33);
}

static void shake(struct record *record, const struct record *from, unsigned k)
{
	static const double step_g[4] = {-1.0 / WIRE_COUNTS_PER_G, 0, 0, 1.0 / WIRE_COUNTS_PER_G};
	uint64_t state = (k + 1) * UINT64_C(0x9E3779B97F4A7C15);

	for (size_t i = 0; i < record->channel_count; i++)
		for (size_t j = 0; j < record->channels[i].count; j++) {
			double value_g = from->channels[i].value_g[j] + step_g[draw(&state) & 3];

			if (drop_is_count(value_g))
				record->channels[i].value_g[j] = value_g;
		}
}

/* What the tower would send behind these samples. */
static void close_capture(struct record *record, unsigned k)
{
	uint32_t crc = CRC32_INIT;
	struct wire_capture_end end;
	struct frame frame;

	for (uint32_t tick = 0; tick < drop_ticks(record); tick++)
		for (unsigned sensor = 1; sensor <= WIRE_SENSORS; sensor++) {
			struct wire_block block = {0};

			must(!drop_get(record, sensor, tick, block.x, block.y, block.z), "a block is lost");
			wire_pack_block(&frame, WIRE_ID_BLOCK_S1, &block);
			crc = crc32(crc, frame.data + WIRE_SAMPLE_OFFSET, WIRE_SAMPLE_BYTES);
		}
	record->drop_id = (uint16_t)(k % UINT16_MAX + 1);
	record->crc32 = crc;
	drop_capture_end(record, &frame);
	wire_seal_capture_end(&frame);
	must(wire_unpack_capture_end(&frame, &end), "a capture end");
	record->seal = end.seal;
}

static void append(FILE *out, const char *file)
{
	char bytes[1 << 16];
	FILE *in = fopen(file, "re");
	size_t count;

	must(in == NULL, file);
	while ((count = fread(bytes, 1, sizeof(bytes), in)) > 0)
		must(fwrite(bytes, 1, count, out) != count, "full");
	fclose(in);
}

static void make(const char *folder, const char *scratch, unsigned count, unsigned each, char **log, int logs)
{
	char message[READ_MESSAGE_MAX], name[NAME_BYTES], one[NAME_BYTES];
	struct record *from = calloc((size_t)logs, sizeof(*from)), record;
	FILE *out = NULL;

	must(from == NULL, "no memory");
	for (int i = 0; i < logs; i++)
		must(read_record(&from[i], log[i], NULL, message), message);
	snprintf(one, sizeof(one), "%s/drop.lcm", scratch);
	for (unsigned k = 0; k < count; k++) {
		int i = (int)(k % (unsigned)logs);

		if (k % each == 0) {
			snprintf(name, sizeof(name), "%s/lake-%05u.lcm", folder, k / each + 1);
			must(out != NULL && stream_close(out) != 0, name);
			out = fopen(name, "we");
			must(out == NULL, name);
		}
		must(read_record(&record, log[i], NULL, message), message);
		shake(&record, &from[i], k);
		close_capture(&record, k);
		must(write_record(&record, one, message), message);
		record_free(&record);
		append(out, one);
	}
	must(out != NULL && stream_close(out) != 0, name);
	for (int i = 0; i < logs; i++)
		record_free(&from[i]);
	free(from);
}

int main(int argc, char **argv)
{
	unsigned count = argc > 5 ? (unsigned)strtoul(argv[3], NULL, 10) : 0;
	unsigned each = argc > 5 ? (unsigned)strtoul(argv[4], NULL, 10) : 0;

	if (count == 0 || each == 0) {
		fprintf(stderr, "usage: lake OUT SCRATCH COUNT EACH LOG...\n");
		return 2;
	}
	make(argv[1], argv[2], count, each, argv + 5, argc - 5);
	return 0;
}
