/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "firmware/port/stm32g474/interrupt.h"

#include "firmware/port/stm32g474/registers.h"

static const struct {
	uint8_t irq, priority;
} interrupts[] = {
        {21, INTERRUPT_CONTROL}, /* FDCAN1 */
        {25, INTERRUPT_SAMPLES}, /* TIM1 update: the millisecond */
        {28, INTERRUPT_CONTROL}, /* TIM2: the gates */
        {29, INTERRUPT_SAMPLES}, /* TIM3: 10 kHz */
        {30, INTERRUPT_SAMPLES}, /* TIM4: 7 kHz */
};

void interrupt_setup(void)
{
	uint32_t enabled = 0;

	register_change(SCB_SHPR3, SCB_SHPR3_PENDSV(0xFF), SCB_SHPR3_PENDSV(INTERRUPT_CONTROL));
	for (unsigned i = 0; i < sizeof(interrupts) / sizeof(interrupts[0]); i++) {
		uint32_t irq = interrupts[i].irq;

		register_change(NVIC_IPR(irq), NVIC_IPR_PRIORITY(irq, 0xFF),
		                NVIC_IPR_PRIORITY(irq, interrupts[i].priority));
		enabled |= 1u << irq;
	}
	WR(NVIC_ISER0, enabled);
}

void interrupt_control(void)
{
	WR(SCB_ICSR, SCB_ICSR_PENDSVSET);
}
