# SPDX-License-Identifier: GPL-3.0-or-later
# Damaged files of our own formats, read in process; beside the program that reads HDF5.

DAMAGE_O = $(call obj,tests/damage/damage.c)
ALL_O += $(DAMAGE_O)
$(DAMAGE_O): CPPFLAGS += $(LINUX)

$(BUILD)/droptower-damage: $(DAMAGE_O) $(foreach l,host link common,$(call lib,$l))
	$(call say,LINK,$@)
	$(link)
tests: $(BUILD)/droptower-damage

.PHONY: damage
damage: all $(BUILD)/droptower-damage ## damage 100 000 files of our own formats and say what reading them tells
	@tests/damage/run $(BUILD) 14000

-include $(DAMAGE_O:.o=.d)
