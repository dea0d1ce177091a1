/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "hil/verdict.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "common/wire_table.h"

enum { TEXT_MAX = 800 };

struct verdict {
	FILE *out;
	unsigned failures;
	char *failed; /* names */
	size_t size;
};

static void verdict_say(struct verdict *verdict, bool good, const char *name, const char *measured,
                        const char *expected)
{
	size_t used = strlen(verdict->failed);

	/* a path is too long for its column: what was expected then stands below it */
	fprintf(verdict->out, "  %-5s%-22s %-28s%s%s\n", good ? "ok" : "FAIL", name, measured,
	        strlen(measured) > 28 ? "\n                              " : " ", expected);
	if (good)
		return;
	verdict->failures++;
	if (used + strlen(name) + 2 < verdict->size)
		snprintf(verdict->failed + used, verdict->size - used, "%s%s", used ? " " : "", name);
}

static void judge_range(struct verdict *verdict, const char *name, double value,
                        const struct scenario_range *range)
{
	char measured[40], expected[80];

	if (isnan(range->min))
		return;
	snprintf(measured, sizeof(measured), isnan(value) ? "did not happen" : "%.9g", value);
	if (range->min == range->max)
		snprintf(expected, sizeof(expected), "%.9g", range->min);
	else
		snprintf(expected, sizeof(expected), "%.9g..%.9g", range->min, range->max);
	verdict_say(verdict, value >= range->min && value <= range->max, name, measured, expected);
}

/* ---- lists ---- */

static const char *verdict_error_of(unsigned number)
{
	return scenario_error_name((int)(int32_t)number);
}

static void add_item(char text[TEXT_MAX], uint32_t number, const char *(*name_of)(unsigned))
{
	size_t used = strlen(text);

	if (name_of != NULL)
		snprintf(text + used, TEXT_MAX - used, "%s%s", used ? " " : "", name_of(number));
	else
		snprintf(text + used, TEXT_MAX - used, "%s0x%08" PRIX32, used ? " " : "", number);
}

static void judge_notes(struct verdict *verdict, const char *name, const struct monitor_notes *notes,
                        const struct scenario_list *list, const char *(*name_of)(unsigned))
{
	char measured[TEXT_MAX] = "", expected[TEXT_MAX] = "";
	bool good = notes->count == list->count;

	if (!list->given)
		return;
	for (unsigned i = 0; i < notes->count && i < MONITOR_NOTES; i++) {
		add_item(measured, notes->note[i].number, name_of);
		good = good && (int32_t)notes->note[i].number == list->item[i];
	}
	for (unsigned i = 0; i < list->count; i++)
		add_item(expected, (uint32_t)list->item[i], name_of);
	verdict_say(verdict, good, name, measured[0] ? measured : "-", expected[0] ? expected : "-");
}

static void judge_one(struct verdict *verdict, const char *name, uint32_t number,
                      const struct scenario_list *list, const char *(*name_of)(unsigned))
{
	const struct monitor_notes notes = {1, {{number, 0}}};

	judge_notes(verdict, name, &notes, list, name_of);
}

/* Bits in any order. */
static void judge_bits(struct verdict *verdict, const char *name, unsigned bits,
                       const struct scenario_list *list, const char *(*name_of)(unsigned))
{
	char measured[TEXT_MAX] = "", expected[TEXT_MAX] = "";
	unsigned wanted = 0;

	if (!list->given)
		return;
	for (unsigned i = 0; i < list->count; i++)
		wanted |= 1u << list->item[i];
	for (unsigned bit = 0; bit < 32; bit++) {
		if (bits >> bit & 1)
			add_item(measured, bit, name_of);
		if (wanted >> bit & 1)
			add_item(expected, bit, name_of);
	}
	verdict_say(verdict, wanted == bits, name, measured[0] ? measured : "-",
	            expected[0] ? expected : "-");
}

static void judge_marks(struct verdict *verdict, const struct monitor *monitor,
                        const struct scenario_list *list)
{
	if (list->given && monitor->captures == 0)
		verdict_say(verdict, false, "marks", "no capture", "a capture end");
	else
		judge_bits(verdict, "marks", monitor->capture.marks, list, wire_mark_name);
}

static void judge_counters(struct verdict *verdict, const struct scenario *scenario,
                           const struct monitor *monitor)
{
	for (unsigned i = 0; i < WIRE_COUNTERS; i++)
		judge_range(verdict, wire_counter_name(i),
		            monitor->has_counter[i] ? (double)monitor->counter[i] : (double)NAN,
		            &scenario->counter[i]);
}

unsigned verdict_print(const struct scenario *scenario, const struct monitor *monitor,
                       const double results[SCENARIO_RESULTS], FILE *out, char *failed, size_t size)
{
	struct verdict verdict = {.out = out, .failed = failed, .size = size};

	failed[0] = '\0';
	judge_one(&verdict, "end", monitor->state, &scenario->end, wire_state_name);
	judge_one(&verdict, "fault", monitor->fault, &scenario->fault, wire_fault_name);
	judge_notes(&verdict, "emcy", &monitor->emcy, &scenario->emcy, wire_fault_name);
	judge_notes(&verdict, "path", &monitor->path, &scenario->path, wire_state_name);
	judge_bits(&verdict, "checks", monitor->checks, &scenario->checks, wire_check_name);
	judge_marks(&verdict, monitor, &scenario->marks);
	judge_notes(&verdict, "replies", &monitor->replies, &scenario->replies, wire_state_name);
	judge_notes(&verdict, "refused", &monitor->refused, &scenario->refused, verdict_error_of);
	judge_notes(&verdict, "aborts", &monitor->aborts, &scenario->aborts, NULL);
	for (unsigned i = 0; i < SCENARIO_RESULTS; i++)
		judge_range(&verdict, scenario_result_name(i), results[i], &scenario->result[i]);
	judge_counters(&verdict, scenario, monitor);
	return verdict.failures;
}
