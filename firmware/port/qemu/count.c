/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A plugin of the emulator: counts the instructions of the core, each sample interrupt as a whole, each call
 * from the control interrupt and each app_poll. Instructions, not cycles. What the port does for the sensor
 * bus lies outside; the few instructions that bring the codes to the calls are in. One in which both timers'
 * samples come counts as the 10 kHz timer's.
 *
 *     -plugin count.so,out=FILE,gate=ADDRESS,...      an address in hex for each of `places`
 *
 * FILE gets a line for each: name, calls, least, most, sum of the instructions.
 * The emulator calls from its one processor's thread. Its header is not packaged: what is used of version 1
 * of the interface is declared here (QEMU 7.2, include/qemu/qemu-plugin.h).
 */
#include <inttypes.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct qemu_plugin_tb;
struct qemu_plugin_insn;
struct qemu_info;
enum { QEMU_PLUGIN_CB_NO_REGS = 0, QEMU_PLUGIN_INLINE_ADD_U64 = 0 };

int qemu_plugin_install(uint64_t id, const struct qemu_info *info, int argc, char **argv);
extern int qemu_plugin_version;

void qemu_plugin_register_vcpu_tb_trans_cb(uint64_t id, void (*cb)(uint64_t id, struct qemu_plugin_tb *tb));
void qemu_plugin_register_atexit_cb(uint64_t id, void (*cb)(uint64_t id, void *data), void *data);
size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb *tb);
struct qemu_plugin_insn *qemu_plugin_tb_get_insn(const struct qemu_plugin_tb *tb, size_t index);
uint64_t qemu_plugin_insn_vaddr(const struct qemu_plugin_insn *insn);
void qemu_plugin_register_vcpu_insn_exec_cb(struct qemu_plugin_insn *insn,
                                            void (*cb)(unsigned cpu, void *data), int flags, void *data);
void qemu_plugin_register_vcpu_insn_exec_inline(struct qemu_plugin_insn *insn, int op, void *counter,
                                                uint64_t add);

int qemu_plugin_version = 1;

/* Where something begins. SAMPLE begins an interrupt of which X and YZ tell the kind; the rest of the last
 * four only end what came before. */
enum place { GATE, TICK, X, YZ, POLL, SAMPLE, DELIVERED, CONTROLLED, POLLED, PLACES, KINDS = SAMPLE };

static const char *const places[PLACES] = {"gate",   "tick",      "x",          "yz",    "poll",
                                           "sample", "delivered", "controlled", "polled"};

static uint64_t address[PLACES];
static uint64_t executed; /* instructions so far, the present one included */
static struct {
	uint64_t calls, least, most, sum;
} counts[KINDS];
static struct span {
	uint64_t begin;
	int kind; /* KINDS: none is open */
} interrupt = {.kind = KINDS}, poll = {.kind = KINDS};
static const char *out;

static void end_span(struct span *span)
{
	uint64_t count = executed - span->begin;

	if (span->kind == KINDS)
		return;
	if (counts[span->kind].calls++ == 0 || count < counts[span->kind].least)
		counts[span->kind].least = count;
	if (count > counts[span->kind].most)
		counts[span->kind].most = count;
	counts[span->kind].sum += count;
	span->kind = KINDS;
}

static void on_place(unsigned cpu, void *data)
{
	int place = (int)(uintptr_t)data;
	struct span *span = place == POLL || place == POLLED ? &poll : &interrupt;

	(void)cpu;
	if (place == X || place == YZ) {
		span->kind = place;
		return;
	}
	end_span(span);
	*span = (struct span){executed, place < KINDS ? place : KINDS};
}

static void on_translation(uint64_t id, struct qemu_plugin_tb *tb)
{
	(void)id;
	for (size_t i = 0; i < qemu_plugin_tb_n_insns(tb); i++) {
		struct qemu_plugin_insn *insn = qemu_plugin_tb_get_insn(tb, i);

		qemu_plugin_register_vcpu_insn_exec_inline(insn, QEMU_PLUGIN_INLINE_ADD_U64, &executed, 1);
		for (uintptr_t place = 0; place < PLACES; place++)
			if (qemu_plugin_insn_vaddr(insn) == address[place])
				qemu_plugin_register_vcpu_insn_exec_cb(insn, on_place, QEMU_PLUGIN_CB_NO_REGS,
				                                       (void *)place);
	}
}

static void write_counts(uint64_t id, void *data)
{
	FILE *file = fopen(out, "w");

	(void)id;
	(void)data;
	if (file == NULL) {
		perror(out);
		return;
	}
	for (int i = 0; i < KINDS; i++)
		fprintf(file, "%s %" PRIu64 " %" PRIu64 " %" PRIu64 " %" PRIu64 "\n", places[i],
		        counts[i].calls, counts[i].least, counts[i].most, counts[i].sum);
	fclose(file);
}

static bool take_argument(const char *argument)
{
	const char *value = strchr(argument, '=');

	if (value == NULL)
		return false;
	if (strncmp(argument, "out=", 4) == 0) {
		out = strdup(value + 1);
		return out != NULL;
	}
	for (int i = 0; i < PLACES; i++)
		if (strlen(places[i]) == (size_t)(value - argument) &&
		    strncmp(argument, places[i], strlen(places[i])) == 0) {
			address[i] = strtoull(value + 1, NULL, 16) & ~UINT64_C(1); /* bit 0 says Thumb */
			return true;
		}
	return false;
}

int qemu_plugin_install(uint64_t id, const struct qemu_info *info, int argc, char **argv)
{
	(void)info;
	for (int i = 0; i < argc; i++)
		if (!take_argument(argv[i])) {
			fprintf(stderr, "count: %s: no such argument\n", argv[i]);
			return -1;
		}
	for (int i = 0; i < PLACES; i++)
		if (address[i] == 0 || out == NULL) {
			fprintf(stderr, "count: %s= or out= is missing\n", places[i]);
			return -1;
		}
	qemu_plugin_register_vcpu_tb_trans_cb(id, on_translation);
	qemu_plugin_register_atexit_cb(id, write_counts, NULL);
	return 0;
}
