/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The posix port within the bench's program (common/sensorbus.h): the firmware has a stack of its own and
 * goes on when its request is asked for, until it wants the answer. The exchange is two copies.
 */
#include <setjmp.h>
#include <stdio.h>
#include <string.h>
#include <ucontext.h>

#include "common/sensorbus.h"
#include "firmware/port/lockstep.h"
#include "firmware/port/posix/posix.h"

enum { STACK_BYTES = 1 << 20 };

struct side {
	ucontext_t context;
	jmp_buf place;
	bool begun;
};

static struct {
	struct side bench, firmware;
	char stack[STACK_BYTES];
	struct posix_options options;
	bool running;
	uint8_t request[SENSORBUS_MESSAGE_MAX];
	size_t asked; /* bytes of it */
	const uint8_t *answer;
	size_t answered;
} inside;

/* Contexts change by themselves, too, but ask the system each time, a quarter of what a drop costs. */
static void change(struct side *from, struct side *to)
{
	from->begun = true;
	if (_setjmp(from->place) != 0)
		return;
	if (to->begun)
		_longjmp(to->place, 1);
	(void)setcontext(&to->context);
}

int pipes_open(const char *bus, char *message, size_t size)
{
	(void)bus;
	snprintf(message, size, "nothing to be opened");
	return 0;
}

int lockstep_write(const void *bytes, size_t count)
{
	if (count > sizeof(inside.request) - inside.asked)
		return DT_E_RANGE;
	memcpy(inside.request + inside.asked, bytes, count);
	inside.asked += count;
	return 0;
}

int lockstep_read(void *bytes, size_t size, size_t *count)
{
	if (inside.answered == 0)
		change(&inside.firmware, &inside.bench);
	if (inside.answered == 0 || inside.answered > size)
		return LOCKSTEP_GONE;
	memcpy(bytes, inside.answer, inside.answered);
	*count += inside.answered;
	inside.answered = 0;
	return 0;
}

static void inside_run(void)
{
	(void)posix_run(&inside.options);
	inside.running = false;
	change(&inside.firmware, &inside.bench);
}

static void inside_start(unsigned cause, uint8_t kept)
{
	ucontext_t *context = &inside.firmware.context;

	inside.options = (struct posix_options){.cause = (enum port_reset)cause, .kept = kept};
	inside.asked = inside.answered = 0;
	inside.firmware.begun = false;
	inside.running = getcontext(context) == 0;
	context->uc_stack.ss_sp = inside.stack;
	context->uc_stack.ss_size = sizeof(inside.stack);
	makecontext(context, inside_run, 0);
}

static size_t inside_ask(const uint8_t **request)
{
	inside.asked = 0;
	if (inside.running)
		change(&inside.bench, &inside.firmware);
	*request = inside.request;
	return inside.running ? inside.asked : 0;
}

static void inside_answer(const uint8_t *bytes, size_t count)
{
	inside.answer = bytes;
	inside.answered = count;
}

const struct sensorbus_inside sensorbus_inside = {inside_start, inside_ask, inside_answer};
