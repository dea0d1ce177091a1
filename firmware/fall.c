/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "firmware/fall.h"

#include "common/units.h"

#define STANDARD_GRAVITY_UM_S2 ((uint32_t)(UNITS_G_M_S2 * 1e6))
#define LARGEST_GRAVITY_UM_S2 9840000u /* no place on earth has more */

/* Bit by bit, rounded down. */
static uint32_t square_root(uint64_t value)
{
	uint64_t root = 0;

	for (uint64_t bit = (uint64_t)1 << 31; bit != 0; bit >>= 1)
		if ((root + bit) * (root + bit) <= value)
			root += bit;
	return (uint32_t)root;
}

/* sqrt(um) with 16 fractional bits. */
static uint32_t root_of(uint32_t travel_um)
{
	return square_root((uint64_t)travel_um << 32);
}

/* Time to fall travel_um from rest. */
static uint32_t fall_us(uint32_t travel_um, uint32_t um_s2)
{
	return square_root(2u * travel_um * 1000000000000u / um_s2);
}

static uint32_t free_fall_us(uint32_t travel_um)
{
	return fall_us(travel_um, STANDARD_GRAVITY_UM_S2);
}

void fall_plan(struct fall_plan *plan, const struct parameters *parameters)
{
	const uint32_t *value = parameters->value;
	uint32_t travel_um[] = {value[WIRE_PARAMETER_gate_upper_um], value[WIRE_PARAMETER_gate_lower_um]};
	uint64_t permille = 1000u - value[WIRE_PARAMETER_slow_permille];
	uint32_t slow_um_s2 = (uint32_t)(STANDARD_GRAVITY_UM_S2 * permille / 1000u), gate_us[2];
	uint32_t upper = root_of(travel_um[0]), lower = root_of(travel_um[1]);
	uint32_t separation = root_of(value[WIRE_PARAMETER_separation_um]);
	uint32_t dampers = root_of(value[WIRE_PARAMETER_dampers_um]);

	plan->upper_root = upper;
	plan->lower_root = lower;
	/* At most 120, with the gates PARAMETER_GATE_DISTANCE_UM apart and travels to 2.4 m. */
	plan->separation_q24 = (uint32_t)(((uint64_t)(separation - lower) << 24) / (lower - upper));
	plan->dampers_q24 = (uint32_t)(((uint64_t)(dampers - lower) << 24) / (lower - upper));
	for (unsigned gate = 0; gate < 2; gate++) {
		gate_us[gate] = free_fall_us(travel_um[gate]);
		plan->gate_first_us[gate] = gate_us[gate] * 7u / 8u;
		plan->gate_last_us[gate] = 2u * gate_us[gate];
	}
	plan->fast_us = (gate_us[1] - gate_us[0]) * 7u / 8u;
	plan->slow_us = fall_us(travel_um[1], slow_um_s2) - fall_us(travel_um[0], slow_um_s2);
	plan->gate_distance_um = travel_um[1] - travel_um[0];
	plan->relief_us = fall_us(value[WIRE_PARAMETER_dampers_um], LARGEST_GRAVITY_UM_S2);
	plan->end_us = 2u * free_fall_us(value[WIRE_PARAMETER_dampers_um]);
}

uint32_t fall_part(uint32_t time_us, uint32_t factor_q24)
{
	return (uint32_t)(((uint64_t)time_us * factor_q24 + (1u << 23)) >> 24);
}

/* How fast sqrt(um) grows, per us, 40 fractional bits: sqrt(g / 2) is 2.435e9, and a fall that is believed is
 * at most 8/7 as fast: 32 bits hold it. */
static uint32_t rate_of(const struct fall_plan *plan, const struct fall_times *times)
{
	uint32_t between_us = times->lower_us - times->upper_us;

	return (uint32_t)(((uint64_t)(plan->lower_root - plan->upper_root) << 24) / between_us);
}

struct fall_state fall_at(const struct fall_plan *plan, const struct fall_times *times, uint32_t time_us)
{
	uint32_t rate = rate_of(plan, times);
	int64_t since_us = (int32_t)(time_us - times->lower_us);
	int64_t root = (int64_t)plan->lower_root + since_us * rate / (1 << 24);
	uint64_t positive = root < 0 ? 0 : root > UINT32_MAX ? UINT32_MAX : (uint64_t)root;

	/* s = root^2, v = 2 root rate; um/us are 1000 mm/s */
	return (struct fall_state){
	        .travel_um = (uint32_t)(positive * positive >> 32),
	        .speed_mm_s = (uint32_t)((positive >> 12) * rate * 2000u >> 44),
	};
}

uint32_t fall_acceleration(const struct fall_plan *plan, const struct fall_times *times)
{
	uint64_t rate = rate_of(plan, times) >> 12; /* 28 fractional bits */

	return (uint32_t)((rate * rate >> 8) * 2000000000u >> 48); /* 2 rate^2; um/us2 are 1e9 mm/s2 */
}

int32_t fall_delay_us(const struct fall_plan *plan, const struct fall_times *times)
{
	uint32_t between_us = times->lower_us - times->upper_us;
	uint64_t fallen_us = (uint64_t)between_us * plan->lower_root / (plan->lower_root - plan->upper_root);

	return (int32_t)(times->lower_us - times->released_us) - (int32_t)fallen_us;
}
