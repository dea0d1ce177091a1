# SPDX-License-Identifier: GPL-3.0-or-later
#
# The board, a Nucleo-G474RE: $(BUILD)/firmware-stm32g474/firmware.elf and .bin. On the host the drivers, without
# port.c and start.c, are a library for their tests, which bring a register model. The image is the same in whatever folder.

PACKAGES_TEST += gcc-arm-none-eabi

STM32G474 = $(BUILD)/firmware-stm32g474
STM32G474_DRIVER_C = $(filter-out %/port.c %/start.c,$(wildcard firmware/port/stm32g474/*.c))
STM32G474_C = $(FREESTANDING_C) $(wildcard firmware/port/stm32g474/*.c) firmware/port/memory.c
STM32G474_O = $(STM32G474_C:%.c=$(STM32G474)/obj/%.o)
STM32G474_CC = arm-none-eabi-gcc
STM32G474_CPU = -mcpu=cortex-m4 -mthumb -mfloat-abi=soft
STM32G474_CFLAGS = -std=c11 -O2 -g $(WARNINGS) $(STM32G474_CPU) -ffreestanding -nostdinc \
	-isystem $(shell $(STM32G474_CC) -print-file-name=include) -fno-common -ffunction-sections -fdata-sections \
	-fno-tree-loop-distribute-patterns -Wstack-usage=512 -fcallgraph-info=su -fdebug-prefix-map=$(CURDIR)=.

.PHONY: stm32g474
stm32g474: $(STM32G474)/firmware.bin ## build the firmware for the board and print its size
	@arm-none-eabi-size $(STM32G474)/firmware.elf

$(STM32G474)/firmware.bin: $(STM32G474)/firmware.elf
	$(Q)arm-none-eabi-objcopy -O binary $< $@

$(STM32G474)/firmware.elf: $(STM32G474_O) firmware/port/stm32g474/link.ld
	$(call say,LINK,$@)
	$(Q)$(STM32G474_CC) $(STM32G474_CPU) -nostdlib -Wl,--gc-sections,--fatal-warnings \
		-T firmware/port/stm32g474/link.ld $(STM32G474_O) -lgcc -o $@

$(STM32G474)/obj/%.o: %.c Makefile firmware/port/stm32g474/port.mk
	$(call say,CC-ARM,$<)
	$(Q)mkdir -p $(@D)
	$(Q)$(STM32G474_CC) $(STM32G474_CFLAGS) -I. -MMD -MP -c $< -o $@

$(call obj,$(STM32G474_DRIVER_C)): CFLAGS += -ffreestanding
$(call lib,stm32g474): $(call obj,$(STM32G474_DRIVER_C))
$(BUILD)/tests/unit: $(call lib,stm32g474)

ifndef SANITIZE
tests: $(STM32G474)/firmware.bin
endif

-include $(STM32G474_O:.o=.d) $(STM32G474_DRIVER_C:%.c=$(BUILD)/obj/%.d)
