# SPDX-License-Identifier: GPL-3.0-or-later
#
# The study, again: 75 drops on the simulated tower, its tables and figures beside the published ones.

STUDY_C = $(wildcard hil/study/*.c)
ALL_O += $(call obj,$(STUDY_C))
$(call obj,$(STUDY_C)): CPPFLAGS += $(LINUX)

$(BUILD)/droptower-study: $(call obj,$(STUDY_C)) $(foreach l,host link common,$(call lib,$l))
	$(call say,LINK,$@)
	$(link)

# Only the plain build draws.
ifeq ($(SANITIZE)$(COVERAGE),)
tests: $(BUILD)/droptower-study
endif

REPEATS ?= 5
ANGLES ?= 15 20 25 30 35

.PHONY: study study-readme
study: setup ## drop the study's 75 again; tables and figures beside the published ones (REPEATS= ANGLES=)
	@$(MAKE) --no-print-directory -j$(JOBS) BUILD=$(BUILD) all $(BUILD)/droptower-study
	@hil/study/run $(BUILD) $(BUILD)/study $(REPEATS) $(ANGLES)

# Without what gnuplot writes and nobody needs: groups with nothing in them, attributes at their defaults.
study-readme: study ## the same, and renew the picture the README shows of it
	@sed -z -e 's/ stroke-linecap="butt" stroke-linejoin="miter"//g' -e 's/<g [^>]*>\n<\/g>\n//g' \
		-e 's/[ \t]*\n[ \t]*/\n/g' $(BUILD)/study/figures.svg >hil/study/figures.svg
