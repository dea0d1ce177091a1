/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "hil/busfault.h"

#include "common/wire.h"
#include "hil/random.h"

/* Uniform in [0, 1), so that a probability of 0 never and of 1 always happens. */
static double random_unit(uint64_t *state)
{
	return (double)(random_next(state) >> 11) * 0x1p-53;
}

void busfault_init(struct busfault *fault, const struct busfault_options *options, uint64_t seed)
{
	*fault = (struct busfault){.options = *options, .random = seed};
}

void busfault_burst(struct busfault *fault, unsigned frames)
{
	fault->burst_left = frames;
}

void busfault_silence(struct busfault *fault, bool on)
{
	fault->silent = on;
}

static bool burst_takes(struct busfault *fault, uint32_t id)
{
	if (fault->burst_left == 0 || (id != WIRE_ID_BLOCK_S1 && id != WIRE_ID_BLOCK_S2))
		return false;
	fault->burst_left--;
	return true;
}

/* False when every slot is taken: the frame then passes in its turn. */
static bool busfault_hold(struct busfault *fault, const struct frame *frame, unsigned copies, unsigned behind)
{
	for (unsigned i = 0; i < BUSFAULT_BEHIND_MAX; i++) {
		if (fault->held[i].copies == 0) {
			fault->held[i] = (struct busfault_slot){*frame, copies, behind};
			return true;
		}
	}
	return false;
}

static unsigned give(struct busfault *fault, const struct frame *frame, unsigned copies, struct frame *out)
{
	for (unsigned i = 0; i < copies; i++)
		out[i] = *frame;
	fault->counters.given += copies;
	return copies;
}

/* Those whose last frame to wait for has just passed. */
static unsigned busfault_give_held(struct busfault *fault, struct frame *out)
{
	unsigned count = 0;

	for (unsigned i = 0; i < BUSFAULT_BEHIND_MAX; i++) {
		struct busfault_slot *slot = &fault->held[i];

		if (slot->copies == 0 || --slot->behind > 0)
			continue;
		count += give(fault, &slot->frame, slot->copies, out + count);
		slot->copies = 0;
	}
	return count;
}

unsigned busfault_pass(struct busfault *fault, const struct frame *frame, struct frame out[BUSFAULT_OUT_MAX])
{
	const struct busfault_options *options = &fault->options;
	struct busfault_counters *counters = &fault->counters;
	bool lost = random_unit(&fault->random) < options->loss;
	unsigned copies = random_unit(&fault->random) < options->duplicate ? 2 : 1;
	bool late = random_unit(&fault->random) < options->reorder;
	unsigned behind = 1 + (unsigned)(random_next(&fault->random) % BUSFAULT_BEHIND_MAX);
	unsigned count;

	counters->taken++;
	if (fault->silent) {
		counters->silenced++;
		return 0;
	}
	if (options->cut_resend && (frame->id == WIRE_ID_RESENT_S1 || frame->id == WIRE_ID_RESENT_S2)) {
		counters->cut++;
		return 0;
	}
	if (burst_takes(fault, frame->id)) {
		counters->burst_lost++;
		return 0;
	}
	if (lost) {
		counters->lost++;
		return 0;
	}
	counters->duplicated += copies - 1;
	if (late && busfault_hold(fault, frame, copies, behind)) {
		counters->reordered++;
		return 0;
	}
	count = give(fault, frame, copies, out);
	return count + busfault_give_held(fault, out + count);
}

unsigned busfault_held(const struct busfault *fault)
{
	unsigned count = 0;

	for (unsigned i = 0; i < BUSFAULT_BEHIND_MAX; i++)
		count += fault->held[i].copies;
	return count;
}
