# SPDX-License-Identifier: GPL-3.0-or-later
#
# Many drops at once: locally and under Slurm, workers killed on the way.

LAKE_DROPS ?= 100000
LAKE_O = $(BUILD)/obj/tests/bench/lake.o
ALL_O += $(LAKE_O)
$(LAKE_O): CPPFLAGS += $(LINUX)
$(LAKE_O): | $(LCM_H)

$(BUILD)/tests/lake: $(LAKE_O) $(foreach l,host link common,$(call lib,$l))
	$(call say,LINK,$@)
	$(link)

.PHONY: lake
lake: all $(BUILD)/tests/lake ## batch over LAKE_DROPS drops (100 000: hours): locally, in 2 and 7 Slurm shares, workers killed
	@DROPTOWER_LAKE=$(LAKE_DROPS) tests/system/test_slurm $(BUILD) $(BUILD)/sanitize test_arrays
