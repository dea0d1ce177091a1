# SPDX-License-Identifier: GPL-3.0-or-later
#
# The board's image on an emulated processor: $(BUILD)/droptower-firmware-board, where libunicorn is. It is a program of
# its own under GPL-2.0-or-later, as that library is, and not installed.

PACKAGES_TEST += libunicorn-dev

BOARD_C = $(wildcard hil/board/*.c)
BOARD_O = $(call obj,$(BOARD_C) common/sensorbus.c)
BOARD = $(if $(wildcard /usr/include/unicorn/unicorn.h),$(BUILD)/droptower-firmware-board)

$(call obj,$(BOARD_C)): CPPFLAGS += $(LINUX)

.PHONY: board size mistakes preempt mutate-board
board: $(BOARD) stm32g474 ## build the program that runs the board's image, if libunicorn is there
size: $(BUILD)/droptower-bench board ## size, stack and instruction counts of the image that is flashed, against their budgets
	@hil/board/size $(BUILD)

MISTAKES ?=
mistakes: $(BUILD)/droptower-bench board ## build the board's image with mistakes (MISTAKES= some) and see that a drop, or preemption, finds each
	@hil/board/mistakes $(BUILD) '$(STM32G474_CC) $(STM32G474_CFLAGS)' $(MISTAKES)

MUTANTS ?= 100
DRIVERS ?=
# First, but for those in port.c, the unit tests on the register model, which see most of them in milliseconds: their verdicts lie in
# $(BUILD)/mutate-drivers/outcomes.
DRIVER_C = $(addprefix firmware/port/stm32g474/,adc.c can.c clock.c interrupt.c output.c pin.c protect.c random.c reset.c \
	timer.c)
MUTATE_DRIVERS = MUTATED=$(BUILD)/mutate-drivers MUTATED_C='$(DRIVER_C)' MUTATED_BY=stm32g474

mutate-board: $(BUILD)/droptower-bench board ## make MUTANTS= small mistakes in the board's drivers, or all, see a unit test or a scenario on the board notice each (DRIVERS= some, SEED=)
	@$(MAKE) --no-print-directory $(MUTATE_DRIVERS) mutated-units
	@hil/board/mutate $(BUILD) '$(STM32G474_CC) $(STM32G474_CFLAGS)' $(MUTANTS) $(DRIVERS)

preempt: $(BUILD)/droptower-bench board ## interrupt the board's image after every instruction of its longest polls and of control
	@hil/board/preempt $(BUILD)

ifndef SANITIZE
tests: $(BOARD)
endif

$(BUILD)/droptower-firmware-board: $(BOARD_O)
	$(call say,LINK,$@)
	$(Q)mkdir -p $(@D)
	$(Q)$(CC) $(LDFLAGS) $^ -lunicorn -lm -o $@

-include $(BOARD_O:.o=.d)
