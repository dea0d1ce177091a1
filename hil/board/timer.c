/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "hil/board/chip.h"

/* A timer's counter since `start`, when it was `from`. */
struct counter {
	uint32_t base;
	unsigned exception; /* 0: has none that is used */
	uint32_t most;      /* ARR's bits */
	unsigned trigger;   /* of the converters, 0: none */
	bool runs;
	int64_t start;
	uint32_t from, prescaler; /* the one that works: it changes with an update */
	int64_t update, match[4];
	bool level[4];
};

static struct counter counters[] = {
        {.base = TIM1, .exception = BOARD_TIM1, .most = UINT16_MAX},
        {.base = TIM2, .exception = BOARD_TIM2, .most = UINT32_MAX},
        {.base = TIM3, .exception = BOARD_TIM3, .most = UINT16_MAX, .trigger = 4},
        {.base = TIM4, .exception = BOARD_TIM4, .most = UINT16_MAX, .trigger = 12},
        {.base = TIM5, .most = UINT32_MAX},
};

enum { COUNTERS = sizeof(counters) / sizeof(counters[0]), TIM2_INDEX = 1, TIM5_INDEX = 4, CHANNELS = 4 };

static bool estop_open;
static unsigned gates;
static int64_t began; /* TIM1, and with it the others; negative: not yet */

static uint32_t stored(const struct counter *c, uint32_t offset)
{
	return *registers_at(c->base + offset);
}

static struct counter *counter_at(uint32_t address)
{
	for (unsigned i = 0; i < COUNTERS; i++)
		if (address - counters[i].base < 0x400)
			return &counters[i];
	return NULL;
}

static uint32_t count_at(const struct counter *c, int64_t time)
{
	uint64_t counts;

	if (!c->runs || time < c->start)
		return c->from;
	counts = (uint64_t)(time - c->start) / ((uint64_t)c->prescaler + 1) + c->from;
	return (uint32_t)(counts % ((uint64_t)stored(c, TIM_ARR) + 1));
}

static void raise_line(const struct counter *c)
{
	if (c->exception != 0)
		exception_line(c->exception, stored(c, TIM_SR) & stored(c, TIM_DIER) & 0x1F);
}

static void set_flag(const struct counter *c, uint32_t flag)
{
	*registers_at(c->base + TIM_SR) |= flag;
	raise_line(c);
}

static bool is_capture(const struct counter *c, unsigned channel)
{
	return stored(c, channel < 2 ? TIM_CCMR1 : TIM_CCMR2) >> (8 * (channel % 2)) & 3;
}

static unsigned mode_of(const struct counter *c, unsigned channel)
{
	uint32_t bits = stored(c, channel < 2 ? TIM_CCMR1 : TIM_CCMR2) >> (8 * (channel % 2));

	return (bits >> 4 & 7) | (bits >> 13 & 8);
}

/* When the counter reaches the channel's value next, after `time`. */
static void find_match(struct counter *c, unsigned channel, int64_t time)
{
	uint64_t wrap = (uint64_t)stored(c, TIM_ARR) + 1, value = stored(c, TIM_CCR + 4 * channel);
	uint64_t now = count_at(c, time), step = (uint64_t)c->prescaler + 1, ahead;

	c->match[channel] = BOARD_NEVER;
	if (!c->runs || value >= wrap || is_capture(c, channel))
		return;
	ahead = value > now ? value - now : wrap - now + value;
	if (time >= c->start) /* whole counts since the start, so that no fraction adds up */
		c->match[channel] = c->start + (int64_t)(((uint64_t)(time - c->start) / step + ahead) * step);
	else
		c->match[channel] = c->start + (int64_t)(ahead * step);
}

static void find_all(struct counter *c, int64_t time)
{
	c->update =
	        c->runs ? c->start + ((int64_t)stored(c, TIM_ARR) + 1 - c->from) * ((int64_t)c->prescaler + 1)
	                : BOARD_NEVER;
	for (unsigned channel = 0; channel < CHANNELS; channel++)
		find_match(c, channel, time);
}

static void start_counter(struct counter *c, int64_t time)
{
	if (c->runs)
		return;
	if (!registers_clocked(c->base))
		board_fail("the timer at 0x%08X starts without its clock", c->base);
	*registers_at(c->base + TIM_CR1) |= 1;
	c->runs = true;
	c->start = time;
	c->from = stored(c, TIM_CNT);
	find_all(c, time);
}

/* TIM1's start is the trigger of those that wait for internal trigger 0. */
static void start_slaves(int64_t time)
{
	if ((stored(&counters[0], TIM_CR2) >> 4 & 7) != 1)
		return;
	for (unsigned i = 1; i < COUNTERS; i++)
		if ((stored(&counters[i], TIM_SMCR) & 0x00300077) == 6)
			start_counter(&counters[i], time);
	if (board.options.half_clocks == 0) /* the keeper's timer in step with the gates': no rounding */
		counters[TIM5_INDEX].start += (time - counters[TIM5_INDEX].start) % BOARD_CLOCKS_PER_US;
}

void timer_reset(void)
{
	began = -1;
	gates = 0;
	for (unsigned i = 0; i < COUNTERS; i++) {
		struct counter *c = &counters[i];

		c->runs = false;
		c->from = c->prescaler = 0;
		c->update = BOARD_NEVER;
		for (unsigned channel = 0; channel < CHANNELS; channel++) {
			c->match[channel] = BOARD_NEVER;
			c->level[channel] = false;
		}
		*registers_at(c->base + TIM_ARR) = c->most;
	}
}

void timer_state(void)
{
	preempt_keep(counters, sizeof(counters));
	preempt_keep(&estop_open, sizeof(estop_open));
	preempt_keep(&gates, sizeof(gates));
	preempt_keep(&began, sizeof(began));
}

/* ---- outputs ---- */

static void apply_mode(struct counter *c, unsigned channel)
{
	unsigned mode = mode_of(c, channel);
	uint32_t bits = stored(c, channel < 2 ? TIM_CCMR1 : TIM_CCMR2) >> (8 * (channel % 2));

	if (mode == 4 || mode == 5)
		c->level[channel] = mode == 5;
	else if (bits & 0x80 && stored(c, TIM_SMCR) & 8 && estop_open == (stored(c, TIM_SMCR) >> 15 & 1))
		c->level[channel] = false;
}

bool timer_drives(uint32_t timer, unsigned channel)
{
	return stored(counter_at(timer), TIM_CCER) >> (4 * channel) & 1;
}

bool timer_level(uint32_t timer, unsigned channel)
{
	return counter_at(timer)->level[channel];
}

/* TIM2_ETR, which TIM5 takes over. */
void timer_estop(bool open)
{
	estop_open = open;
	for (unsigned i = TIM2_INDEX; i < COUNTERS; i += TIM5_INDEX - TIM2_INDEX)
		for (unsigned channel = 0; channel < CHANNELS; channel++)
			if ((counters[i].base != TIM5 || stored(&counters[i], TIM_AF1) >> 14 == 8) &&
			    !is_capture(&counters[i], channel))
				apply_mode(&counters[i], channel);
}

int64_t timer_next_edge(void)
{
	int64_t next = BOARD_NEVER;

	for (unsigned i = TIM2_INDEX; i < COUNTERS; i += TIM5_INDEX - TIM2_INDEX)
		for (unsigned channel = 0; channel < CHANNELS; channel++)
			if (counters[i].level[channel] && mode_of(&counters[i], channel) == 2 &&
			    counters[i].match[channel] < next)
				next = counters[i].match[channel];
	return next;
}

/* ---- captures: upper gate, lower gate, keeper current ---- */

void timer_capture(unsigned capture, uint32_t time_us)
{
	struct counter *c = capture == 2 ? &counters[TIM5_INDEX] : &counters[TIM2_INDEX];
	unsigned channel = capture == 2 ? 1 : capture;
	int64_t time = counters[TIM2_INDEX].start +
	               ((int64_t)(time_us - counters[TIM2_INDEX].from)) * BOARD_CLOCKS_PER_US;
	uint32_t flag = 2u << channel;

	if (!is_capture(c, channel) || (stored(c, TIM_CCER) >> (4 * channel) & 3) != 3)
		return; /* not on, or not on a falling pin */
	if (capture != 2)
		*registers_at(c->base + TIM_CCR + 4 * channel) = time_us;
	else /* the same instant in the other timer's counts */
		*registers_at(c->base + TIM_CCR + 4 * channel) = count_at(c, time + BOARD_CLOCKS_PER_US / 2);
	gates += capture != 2 && !(stored(c, TIM_SR) & flag);
	set_flag(c, stored(c, TIM_SR) & flag ? flag | flag << 8 : flag);
	board.woken = true;
}

unsigned timer_gates(void)
{
	return gates;
}

int64_t timer_start_time(void)
{
	return began;
}

/* TIM2's own count, by the time that it should keep. */
uint32_t timer_us(int64_t time)
{
	return (uint32_t)((time - began) / BOARD_CLOCKS_PER_US) - 7;
}

/* ---- registers ---- */

bool timer_read(uint32_t address, uint32_t *value)
{
	struct counter *c = counter_at(address);
	uint32_t offset;

	if (c == NULL)
		return false;
	offset = address - c->base;
	*value = stored(c, offset);
	if (offset == TIM_CNT)
		*value = count_at(c, board.now);
	for (unsigned channel = 0; channel < CHANNELS; channel++)
		if (offset == TIM_CCR + 4 * channel && is_capture(c, channel)) {
			*registers_at(c->base + TIM_SR) &= ~(2u << channel);
			raise_line(c);
		}
	return true;
}

static void update_now(struct counter *c)
{
	c->prescaler = stored(c, TIM_PSC);
	c->from = 0;
	*registers_at(c->base + TIM_CNT) = 0;
	*registers_at(c->base + TIM_SR) |= 1;
}

static void write_mode(struct counter *c)
{
	for (unsigned channel = 0; channel < CHANNELS; channel++)
		if (!is_capture(c, channel)) {
			apply_mode(c, channel);
			find_match(c, channel, board.now);
		}
	system_pins(board.now);
}

void timer_write(uint32_t address, uint32_t value)
{
	struct counter *c = counter_at(address);
	uint32_t offset = address - c->base, before = stored(c, offset);

	if (c->runs && (offset == TIM_CNT || offset == TIM_ARR || offset == TIM_EGR))
		board_fail("the timer at 0x%08X is set while it runs", c->base);
	*registers_at(address) = offset == TIM_SR ? before & value : value;
	if (offset == TIM_CNT)
		c->from = value;
	if (offset == TIM_EGR) {
		*registers_at(address) = 0;
		update_now(c);
	}
	if (offset == TIM_SR || offset == TIM_DIER)
		raise_line(c);
	if (offset == TIM_CCMR1 || offset == TIM_CCMR2 || offset == TIM_CCER)
		write_mode(c);
	if (offset >= TIM_CCR && offset < TIM_CCR + 16)
		find_match(c, (offset - TIM_CCR) / 4, board.now);
	if (offset == TIM_CR1 && value & 1) {
		c->runs = false;
		start_counter(c, board.now);
		if (c->base == TIM1) {
			began = board.now;
			start_slaves(board.now);
		}
	}
}

/* ---- events ---- */

int64_t timer_next(void)
{
	int64_t next = BOARD_NEVER;

	for (unsigned i = 0; i < COUNTERS; i++) {
		const struct counter *c = &counters[i];

		next = c->update < next ? c->update : next;
		for (unsigned channel = 0; channel < CHANNELS; channel++)
			next = c->match[channel] < next ? c->match[channel] : next;
	}
	return next;
}

static void overflow(struct counter *c)
{
	int64_t time = c->update;

	c->start = time;
	c->from = 0;
	c->prescaler = stored(c, TIM_PSC);
	find_all(c, time);
	if (c->trigger != 0 && (stored(c, TIM_CR2) >> 4 & 7) == 2)
		sampling_trigger(c->trigger, time);
	set_flag(c, 1);
}

static void match(struct counter *c, unsigned channel)
{
	int64_t time = c->match[channel];

	find_match(c, channel, time);
	if (mode_of(c, channel) == 2 && c->level[channel]) {
		c->level[channel] = false;
		system_pins(time);
	}
	set_flag(c, 2u << channel);
}

void timer_event(void)
{
	for (unsigned i = 0; i < COUNTERS; i++) {
		struct counter *c = &counters[i];

		for (unsigned channel = 0; channel < CHANNELS; channel++)
			if (c->match[channel] <= board.now)
				match(c, channel);
		if (c->update <= board.now)
			overflow(c);
	}
}
