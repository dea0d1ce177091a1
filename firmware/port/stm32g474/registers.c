/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "firmware/port/stm32g474/registers.h"

int register_wait(uint32_t address, uint32_t mask, uint32_t value, uint32_t polls)
{
	while (polls-- > 0)
		if ((RD(address) & mask) == value)
			return 0;
	return DT_E_TIMEOUT;
}
