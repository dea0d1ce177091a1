# SPDX-License-Identifier: GPL-3.0-or-later
#
# What a prediction costs; `make bench` runs it before the analysis.

BENCH_MODEL_O = $(call obj,tests/bench/model.c tests/bench/stopwatch.c)
ALL_O += $(BENCH_MODEL_O)
$(call obj,tests/bench/model.c): CPPFLAGS += $(LINUX)
$(call obj,tests/bench/model.c): | $(LCM_H)

$(BUILD)/tests/bench-model: $(BENCH_MODEL_O) $(foreach l,host link common,$(call lib,$l))
	$(call say,LINK,$@)
	$(link)

.PHONY: bench bench-model
bench: bench-model
bench-model: $(BUILD)/tests/bench-model
	@$<
