/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_PORT_STM32G474_REGISTERS_H
#define DT_FIRMWARE_PORT_STM32G474_REGISTERS_H
/*
 * The registers of the STM32G474 that this port uses, and how they are reached: RD and WR are plain volatile
 * accesses on the target; on any other machine a register model defines them.
 *
 * Source: RM0440 (STM32G4 reference manual), the section stands at each block; base addresses 2.2.2. NVIC,
 * SCB, MPU: PM0214 4.2, 4.3, 4.4. Everything unlisted keeps its reset value.
 */
#include <stdint.h>

#include "common/error.h"

#ifdef __arm__
static inline uint32_t RD(uint32_t address)
{
	return *(volatile uint32_t *)address;
}

static inline void WR(uint32_t address, uint32_t value)
{
	*(volatile uint32_t *)address = value;
}

/* Any context: no interrupt until register_release gets what this returned. */
static inline uint32_t register_hold(void)
{
	uint32_t mask;

	__asm__ volatile("mrs %0, primask\n\tcpsid i" : "=r"(mask) : : "memory");
	return mask;
}

static inline void register_release(uint32_t mask)
{
	__asm__ volatile("msr primask, %0" : : "r"(mask) : "memory");
}

/* Main: no interrupt of this priority or a lower one; 0 lets all in. */
static inline void register_mask(uint32_t priority)
{
	__asm__ volatile("msr basepri, %0\n\tisb" : : "r"(priority) : "memory");
}

/* What was written holds for all that follows. */
static inline void register_barrier(void)
{
	__asm__ volatile("dsb\n\tisb" : : : "memory");
}
#else
uint32_t RD(uint32_t address);
void WR(uint32_t address, uint32_t value);
uint32_t register_hold(void);
void register_release(uint32_t mask);
void register_mask(uint32_t priority);
void register_barrier(void);
#endif

static inline void register_change(uint32_t address, uint32_t mask, uint32_t bits)
{
	WR(address, (RD(address) & ~mask) | bits);
}

static inline void register_set(uint32_t address, uint32_t bits)
{
	WR(address, RD(address) | bits);
}

/* Reads until the bits of mask have this value, `polls` times at most; else DT_E_TIMEOUT. */
DT_MUST_USE int register_wait(uint32_t address, uint32_t mask, uint32_t value, uint32_t polls);

/* ---- FLASH, 3.7 ---- */
#define FLASH_ACR 0x40022000u
#define FLASH_ACR_LATENCY 0xFu /* mask; the value is the number of wait states */
#define FLASH_ACR_PRFTEN (1u << 8)
#define FLASH_ACR_ICEN (1u << 9)
#define FLASH_ACR_DCEN (1u << 10)
#define FLASH_OPTR 0x40022020u
#define FLASH_OPTR_BOR_LEV (7u << 8)
#define FLASH_OPTR_BOR_LEV_4 (4u << 8)

/* ---- PWR, 6.4 ---- */
#define PWR_CR2 0x40007004u
#define PWR_CR2_PVDE (1u << 0)
#define PWR_CR2_PLS_2V9 (6u << 1)
#define PWR_SR2 0x40007014u
#define PWR_SR2_PVDO (1u << 11)
#define PWR_CR5 0x40007080u
#define PWR_CR5_R1MODE (1u << 8)

/* ---- RCC, 7.4 ---- */
#define RCC 0x40021000u
#define RCC_CR (RCC + 0x00u)
#define RCC_CR_HSEON (1u << 16)
#define RCC_CR_HSERDY (1u << 17)
#define RCC_CR_CSSON (1u << 19)
#define RCC_CR_PLLON (1u << 24)
#define RCC_CR_PLLRDY (1u << 25)
#define RCC_CFGR (RCC + 0x08u)
#define RCC_CFGR_SW 3u
#define RCC_CFGR_SW_PLL 3u
#define RCC_CFGR_SWS (3u << 2)
#define RCC_CFGR_SWS_PLL (3u << 2)
#define RCC_CFGR_HPRE (0xFu << 4)
#define RCC_CFGR_HPRE_2 (8u << 4)
#define RCC_PLLCFGR (RCC + 0x0Cu)
#define RCC_PLLCFGR_SRC_HSE 3u
#define RCC_PLLCFGR_M(divisor) (((divisor)-1u) << 4)
#define RCC_PLLCFGR_N(factor) ((factor) << 8)
#define RCC_PLLCFGR_QEN (1u << 20)
#define RCC_PLLCFGR_Q(divisor) (((divisor) / 2u - 1u) << 21) /* 2, 4, 6, 8 */
#define RCC_PLLCFGR_REN (1u << 24)
#define RCC_PLLCFGR_R(divisor) (((divisor) / 2u - 1u) << 25)
#define RCC_AHB1ENR (RCC + 0x48u)
#define RCC_AHB1ENR_DMA1 (1u << 0)
#define RCC_AHB1ENR_DMAMUX (1u << 2)
#define RCC_AHB2ENR (RCC + 0x4Cu)
#define RCC_AHB2ENR_GPIOABC (7u << 0)
#define RCC_AHB2ENR_ADC12 (1u << 13)
#define RCC_AHB2ENR_ADC345 (1u << 14)
#define RCC_AHB2ENR_RNG (1u << 26)
#define RCC_APB1ENR1 (RCC + 0x58u)
#define RCC_APB1ENR1_TIM2345 (0xFu << 0)
#define RCC_APB1ENR1_FDCAN (1u << 25)
#define RCC_APB1ENR1_PWR (1u << 28)
#define RCC_APB2ENR (RCC + 0x60u)
#define RCC_APB2ENR_TIM1 (1u << 11)
#define RCC_APB2ENR_TIM17 (1u << 18)
#define RCC_CCIPR (RCC + 0x88u)
#define RCC_CCIPR_FDCAN (3u << 24)
#define RCC_CCIPR_FDCAN_HSE (0u << 24)
#define RCC_CCIPR_FDCAN_PLLQ (1u << 24)
#define RCC_CCIPR_CLK48 (3u << 26) /* 0: HSI48 */
#define RCC_CSR (RCC + 0x94u)
#define RCC_CSR_RMVF (1u << 23)
#define RCC_CSR_BORRSTF (1u << 27)
#define RCC_CSR_SFTRSTF (1u << 28)
#define RCC_CSR_IWDGRSTF (1u << 29)
#define RCC_CRRCR (RCC + 0x98u)
#define RCC_CRRCR_HSI48ON (1u << 0)
#define RCC_CRRCR_HSI48RDY (1u << 1)

/* ---- GPIO, 9.4; port 0 is A ---- */
#define GPIO(port) (0x48000000u + 0x400u * (port))
#define GPIO_MODER 0x00u
#define GPIO_OSPEEDR 0x08u
#define GPIO_PUPDR 0x0Cu
#define GPIO_IDR 0x10u
#define GPIO_BSRR 0x18u
#define GPIO_AFR 0x20u /* and 0x24 for pins 8 to 15 */

/* ---- DMA, 12.6; DMAMUX, 13.6; channel from 0 ---- */
#define DMA1_ISR 0x40020000u
#define DMA1_IFCR 0x40020004u
#define DMA_CLEAR(channel) (0xFu << (4u * (channel)))
#define DMA_TCIF(channel) (2u << (4u * (channel)))
#define DMA1_CCR(channel) (0x40020008u + 0x14u * (channel))
#define DMA_CCR_EN (1u << 0)
#define DMA_CCR_CIRC (1u << 5)
#define DMA_CCR_MINC (1u << 7)
#define DMA_CCR_PSIZE_32 (2u << 8)
#define DMA_CCR_MSIZE_32 (2u << 10)
#define DMA_CCR_PL_HIGHEST (3u << 12)
#define DMA1_CNDTR(channel) (0x4002000Cu + 0x14u * (channel))
#define DMA1_CPAR(channel) (0x40020010u + 0x14u * (channel))
#define DMA1_CMAR(channel) (0x40020014u + 0x14u * (channel))
#define DMAMUX_CCR(channel) (0x40020800u + 4u * (channel))
#define DMAMUX_ADC1 5u
#define DMAMUX_ADC3 37u

/* ---- ADC, 21.7 and 21.8 ---- */
#define ADC1 0x50000000u
#define ADC2 0x50000100u
#define ADC3 0x50000400u
#define ADC4 0x50000500u
#define ADC12 0x50000000u /* with the common offsets */
#define ADC345 0x50000400u
#define ADC_ISR 0x00u
#define ADC_ISR_ADRDY (1u << 0)
#define ADC_ISR_OVR (1u << 4)
#define ADC_CR 0x08u
#define ADC_CR_ADEN (1u << 0)
#define ADC_CR_ADSTART (1u << 2)
#define ADC_CR_ADSTP (1u << 4)
#define ADC_CR_ADVREGEN (1u << 28)
#define ADC_CR_ADCAL (1u << 31)
#define ADC_CFGR 0x0Cu
#define ADC_CFGR_EXTSEL(trigger) ((trigger) << 5)
#define ADC_CFGR_EXTEN_RISING (1u << 10)
#define ADC_CFGR_JQDIS (1u << 31)
#define ADC_CFGR2 0x10u
#define ADC_CFGR2_ROVSE (1u << 0)
#define ADC_CFGR2_OVSR_16 (3u << 2)
#define ADC_SMPR1 0x14u
#define ADC_SMPR2 0x18u
#define ADC_SMPR1_ALL_24_5 0x1B6DB6DBu /* 3 = 24.5 cycles, channels 0 to 9 */
#define ADC_SMPR2_ALL_24_5 0x036DB6DBu /* channels 10 to 18 */
#define ADC_SQR1 0x30u
#define ADC_SQR2 0x34u
#define ADC_CCR 0x308u
#define ADC_CCR_DUAL_REGULAR 6u
#define ADC_CCR_DMACFG (1u << 13)
#define ADC_CCR_MDMA_12 (2u << 14)
#define ADC_CCR_CKMODE_4 (3u << 16)
#define ADC_CDR 0x30Cu
#define ADC_TRIGGER_TIM3 4u  /* tim3_trgo, ADC1/2 */
#define ADC_TRIGGER_TIM4 12u /* tim4_trgo, ADC3/4/5 */

/* ---- timers, 29.6 (TIM1), 30.5 (TIM2 to 5), 31.8 (TIM17) ---- */
#define TIM1 0x40012C00u
#define TIM2 0x40000000u
#define TIM3 0x40000400u
#define TIM4 0x40000800u
#define TIM5 0x40000C00u
#define TIM17 0x40014800u
#define TIM_CR1 0x00u
#define TIM_CR1_CEN (1u << 0)
#define TIM_CR2 0x04u
#define TIM_CR2_MMS_ENABLE (1u << 4)
#define TIM_CR2_MMS_UPDATE (2u << 4)
#define TIM_SMCR 0x08u
#define TIM_SMCR_TRIGGER_ITR0 6u     /* starts with tim_itr0, which is TIM1's trigger output (table 291) */
#define TIM_SMCR_OCCS_ETRF (1u << 3) /* tim_etrf clears the references that TIM_CCMR_CLEAR lets it */
#define TIM_SMCR_ETF_32_8 (15u << 8)
#define TIM_SMCR_ETP_LOW (1u << 15) /* tim_etrf is active while the input is low */
#define TIM_DIER 0x0Cu
#define TIM_SR 0x10u
#define TIM_UIF (1u << 0)
#define TIM_CCIF(channel) (2u << (channel))     /* channel from 0; the same bits in DIER */
#define TIM_CCOF(channel) (0x200u << (channel)) /* overcapture */
#define TIM_EGR 0x14u
#define TIM_EGR_UG (1u << 0)
#define TIM_CCMR1 0x18u
#define TIM_CCMR2 0x1Cu
#define TIM_CCMR_CAPTURE 1u /* on the channel's own input */
#define TIM_CCMR_CAPTURE_PSC_8 (3u << 2)
#define TIM_CCMR_FILTER_32_8 (15u << 4) /* 8 samples, 32 timer clocks apart */
#define TIM_CCMR_CLEAR (1u << 7)        /* OCxCE; not heeded while a mode forces the level */
#define TIM_CCMR_MODE 0x00010070u       /* mask */
#define TIM_CCMR_MODE_FROZEN (0u << 4)
#define TIM_CCMR_MODE_OFF_AT_MATCH (2u << 4)
#define TIM_CCMR_MODE_OFF (4u << 4)
#define TIM_CCMR_MODE_ON (5u << 4)
#define TIM_CCMR_MODE_PWM1 (6u << 4)
#define TIM_CCER 0x20u
#define TIM_CCER_CCE(channel) (1u << (4u * (channel)))
#define TIM_CCER_FALLING(channel) (2u << (4u * (channel))) /* of a capture */
#define TIM_CNT 0x24u
#define TIM_PSC 0x28u
#define TIM_ARR 0x2Cu
#define TIM_CCR(channel) (0x34u + 4u * (channel))
#define TIM_BDTR 0x44u
#define TIM_BDTR_MOE (1u << 15)
#define TIM_TISEL 0x5Cu
#define TIM_AF1 0x60u
#define TIM5_AF1_ETRSEL_TIM2_ETR (8u << 14)
#define TIM17_TISEL_HSE_32 3u
#define TIM_OR1 0x68u
#define TIM17_OR1_HSE32EN (1u << 0)

/* ---- RNG, 26.7 ---- */
#define RNG_CR 0x50060800u
#define RNG_CR_RNGEN (1u << 2)
#define RNG_SR 0x50060804u
#define RNG_SR_DRDY (1u << 0)
#define RNG_SR_CECS (1u << 1) /* the clock is too slow, now */
#define RNG_SR_SECS (1u << 2) /* the noise is none, now */
#define RNG_SR_CEIS (1u << 5) /* the same, since it was last cleared by 0 */
#define RNG_SR_SEIS (1u << 6)
#define RNG_DR 0x50060808u

/* ---- IWDG, 35.4 ---- */
#define IWDG_KR 0x40003000u
#define IWDG_KR_START 0xCCCCu
#define IWDG_KR_ACCESS 0x5555u
#define IWDG_KR_RELOAD 0xAAAAu
#define IWDG_PR 0x40003004u
#define IWDG_PR_16 2u
#define IWDG_RLR 0x40003008u
#define IWDG_SR 0x4000300Cu
#define IWDG_SR_BUSY 7u

/* ---- FDCAN, 44.4; message RAM 44.3.6 to 44.3.9 ---- */
#define FDCAN1 0x40006400u
#define FDCAN_DBTP (FDCAN1 + 0x0Cu)
#define FDCAN_DBTP_TDC (1u << 23)
#define FDCAN_CCCR (FDCAN1 + 0x18u)
#define FDCAN_CCCR_INIT (1u << 0)
#define FDCAN_CCCR_CCE (1u << 1)
#define FDCAN_CCCR_ASM (1u << 2)
#define FDCAN_CCCR_FDOE (1u << 8)
#define FDCAN_CCCR_BRSE (1u << 9)
#define FDCAN_NBTP (FDCAN1 + 0x1Cu)
#define FDCAN_ECR (FDCAN1 + 0x40u)
#define FDCAN_PSR (FDCAN1 + 0x44u)
#define FDCAN_PSR_EP (1u << 5)
#define FDCAN_PSR_BO (1u << 7)
#define FDCAN_TDCR (FDCAN1 + 0x48u)
#define FDCAN_IR (FDCAN1 + 0x50u)
#define FDCAN_IR_RF0N (1u << 0)
#define FDCAN_IR_RF0L (1u << 2)
#define FDCAN_IR_ALL 0x00FFFFFFu
#define FDCAN_IE (FDCAN1 + 0x54u)
#define FDCAN_ILS (FDCAN1 + 0x58u)
#define FDCAN_ILE (FDCAN1 + 0x5Cu)
#define FDCAN_RXGFC (FDCAN1 + 0x80u)
#define FDCAN_RXGFC_RRFE (1u << 0) /* remote frames, extended and standard, are rejected */
#define FDCAN_RXGFC_RRFS (1u << 1)
#define FDCAN_RXGFC_ANFE_REJECT (2u << 2) /* what matches no filter */
#define FDCAN_RXGFC_ANFS_REJECT (2u << 4)
#define FDCAN_RXGFC_LSS(count) ((uint32_t)(count) << 16) /* standard filters */
#define FDCAN_RXF0S (FDCAN1 + 0x90u)
#define FDCAN_RXF0A (FDCAN1 + 0x94u)
#define FDCAN_TXBC (FDCAN1 + 0xC0u)
#define FDCAN_TXFQS (FDCAN1 + 0xC4u)
#define FDCAN_TXFQS_TFQF (1u << 21)
#define FDCAN_TXBAR (FDCAN1 + 0xCCu)
#define FDCAN_CKDIV (FDCAN1 + 0x100u)
#define FDCAN_RAM 0x4000A400u
#define FDCAN_RAM_BYTES 0x350u
#define FDCAN_RAM_FILTER(number) (FDCAN_RAM + 4u * (number))
#define FDCAN_FILTER_DUAL(id1, id2) \
	(1u << 30 | 1u << 27 | (uint32_t)(id1) << 16 | (id2)) /* either, to FIFO 0 */
#define FDCAN_RAM_RX0 (FDCAN_RAM + 0xB0u)
#define FDCAN_RAM_TX (FDCAN_RAM + 0x278u)
#define FDCAN_ELEMENT_BYTES 72u
#define FDCAN_ELEMENT_ESI (1u << 31)
#define FDCAN_ELEMENT_XTD (1u << 30)
#define FDCAN_ELEMENT_RTR (1u << 29)
#define FDCAN_ELEMENT_FDF (1u << 21)
#define FDCAN_ELEMENT_BRS (1u << 20)

/* ---- Cortex-M4 ---- */
#define NVIC_ISER0 0xE000E100u
#define NVIC_IPR(irq) (0xE000E400u + (irq) / 4u * 4u) /* a byte each */
#define NVIC_IPR_PRIORITY(irq, priority) ((uint32_t)(priority) << (irq) % 4u * 8u)
#define SCB_ICSR 0xE000ED04u
#define SCB_ICSR_PENDSVSET (1u << 28)
#define SCB_VTOR 0xE000ED08u
#define SCB_AIRCR 0xE000ED0Cu
#define SCB_SHPR3 0xE000ED20u
#define SCB_SHCSR 0xE000ED24u
#define SCB_SHCSR_FAULTS (7u << 16) /* memory, bus, usage: each its own exception */
#define SCB_SHPR3_PENDSV(priority) ((uint32_t)(priority) << 16)
#define SCB_AIRCR_SYSRESETREQ 0x05FA0004u /* with the key */
#define MPU_CTRL 0xE000ED94u
#define MPU_CTRL_ENABLE 1u /* and no default map behind it */
#define MPU_RBAR 0xE000ED9Cu
#define MPU_RBAR_VALID (1u << 4) /* the region's number comes along */
#define MPU_RASR 0xE000EDA0u
#define MPU_RASR_ENABLE(log2_size) (((log2_size)-1u) << 1 | 1u)
#define MPU_RASR_WITHOUT_EIGHTHS(mask) ((uint32_t)(mask) << 8)
#define MPU_RASR_FLASH (2u << 16) /* normal memory, not shared */
#define MPU_RASR_SRAM (6u << 16)  /* normal memory, shared with the DMA */
#define MPU_RASR_DEVICE (5u << 16)
#define MPU_RASR_READ_WRITE (3u << 24)
#define MPU_RASR_READ_ONLY (6u << 24)
#define MPU_RASR_NO_EXECUTE (1u << 28)

#endif
