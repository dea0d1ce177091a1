/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "firmware/port/stm32g474/protect.h"

#include "firmware/port/stm32g474/registers.h"

#define DATA (MPU_RASR_READ_WRITE | MPU_RASR_NO_EXECUTE)

static const struct {
	uint32_t begin, rasr;
} regions[] = {
        {0x08000000, MPU_RASR_FLASH | MPU_RASR_READ_ONLY | MPU_RASR_ENABLE(19)},
        /* SRAM1 and 2; what is above their 96 KiB is the CCM again */
        {0x20000000, MPU_RASR_SRAM | DATA | MPU_RASR_WITHOUT_EIGHTHS(0xC0) | MPU_RASR_ENABLE(17)},
        {0x10000000, MPU_RASR_SRAM | DATA | MPU_RASR_ENABLE(12)},   /* the stack, at the CCM's bottom */
        {0x40000000, MPU_RASR_DEVICE | DATA | MPU_RASR_ENABLE(18)}, /* APB1, APB2, AHB1 */
        {0x48000000, MPU_RASR_DEVICE | DATA | MPU_RASR_ENABLE(13)}, /* GPIO */
        {0x50000000, MPU_RASR_DEVICE | DATA | MPU_RASR_ENABLE(19)}, /* converters, random numbers */
};

void protect_setup(void)
{
	for (uint32_t i = 0; i < sizeof(regions) / sizeof(regions[0]); i++) {
		WR(MPU_RBAR, regions[i].begin | MPU_RBAR_VALID | i);
		WR(MPU_RASR, regions[i].rasr);
	}
	register_set(SCB_SHCSR, SCB_SHCSR_FAULTS);
	WR(MPU_CTRL, MPU_CTRL_ENABLE);
	register_barrier();
}
