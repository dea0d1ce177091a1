# SPDX-License-Identifier: GPL-3.0-or-later
#
# Fits of simulated drops by the hundred, too long for every test.

FIT_CAMPAIGN_O = $(call obj,tests/fit/campaign.c tests/unit/fit_by_hand.c)
-include $(FIT_CAMPAIGN_O:.o=.d)
$(FIT_CAMPAIGN_O): CPPFLAGS += $(LINUX)
$(BUILD)/tests/fit-campaign: $(FIT_CAMPAIGN_O) $(foreach l,hil host link common,$(call lib,$l))
	$(call say,LINK,$@)
	$(link)

FIT_GROUPS ?= 40
.PHONY: fit-campaign
fit-campaign: $(BUILD)/tests/fit-campaign ## fits of simulated drops: errors, coverage, what is not told (minutes)
	$(Q)for kind in plain common wide narrow coloured clipped low mode late cross; do \
		$< common/scenes/geometry-2A.ini $(FIT_GROUPS) 1 $$kind 15 20 25 30 35; done
	$(Q)for angle in 15 20 25 30 35; do $< common/scenes/geometry-2A.ini $(FIT_GROUPS) 2 plain $$angle; done
