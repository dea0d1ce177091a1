# SPDX-License-Identifier: GPL-3.0-or-later
#
# The load of the bus from the rules of the frame formats; unit/test_busload holds the same lengths against
# others made by hand.

BUSLOAD_O = $(BUILD)/obj/tests/bench/busload.o
ALL_O += $(BUSLOAD_O)

$(BUILD)/tests/busload: $(BUSLOAD_O) $(call lib,link) $(call lib,common)
	$(call say,LINK,$@)
	$(link)

.PHONY: busload
busload: $(BUILD)/tests/busload ## how much of the CAN bus the wire takes at worst
	@$<
