# SPDX-License-Identifier: GPL-3.0-or-later
#
# The emulated Cortex-M4: $(BUILD)/firmware-qemu/firmware.elf, the program that runs it.

PACKAGES_TEST += gcc-arm-none-eabi qemu-system-arm python3

M4 = $(BUILD)/firmware-qemu
M4_C = $(FREESTANDING_C) $(wildcard firmware/port/*.c) $(wildcard firmware/port/qemu/*.c)
M4_O = $(M4_C:%.c=$(M4)/obj/%.o)
M4_CC = arm-none-eabi-gcc
M4_CPU = -mcpu=cortex-m4 -mthumb -mfloat-abi=soft
M4_CFLAGS = -std=c11 -O2 -g $(WARNINGS) $(M4_CPU) -ffreestanding -nostdinc \
	-isystem $(shell $(M4_CC) -print-file-name=include) -fno-common -ffunction-sections -fdata-sections \
	-fno-tree-loop-distribute-patterns -Wstack-usage=512

.PHONY: qemu
qemu: $(M4)/firmware.elf $(BUILD)/droptower-firmware-qemu ## build the firmware for the emulated Cortex-M4
ifndef SANITIZE
tests: qemu
endif

$(M4)/obj/%.o: %.c Makefile firmware/port/qemu/port.mk
	$(call say,CC-ARM,$<)
	$(Q)mkdir -p $(@D)
	$(Q)$(M4_CC) $(M4_CFLAGS) -I. -MMD -MP -c $< -o $@

$(M4)/firmware.elf: $(M4_O) firmware/port/qemu/link.ld
	$(call say,LINK,$@)
	$(Q)$(M4_CC) $(M4_CPU) -nostdlib -Wl,--gc-sections,--fatal-warnings -T firmware/port/qemu/link.ld \
		$(M4_O) -lgcc -o $@

$(BUILD)/droptower-firmware-qemu: firmware/port/qemu/droptower-firmware-qemu
	$(Q)mkdir -p $(@D)
	$(Q)cp $< $@

-include $(M4_O:.o=.d)
