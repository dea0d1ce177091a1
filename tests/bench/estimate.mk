# SPDX-License-Identifier: GPL-3.0-or-later
#
# What the analysis costs: host/estimate in this process, and the program from a cold start on a drop of the
# simulated tower. Nothing here passes or fails.

BENCH_O = $(call obj,tests/bench/estimate.c tests/bench/archive.c tests/bench/stopwatch.c tests/bench/material.c \
	tests/unit/synth.c tests/unit/archive_stock.c)
ALL_O += $(BENCH_O)
$(BENCH_O): CPPFLAGS += $(LINUX)
$(BENCH_O): | $(LCM_H)

$(BUILD)/tests/bench: $(BENCH_O) $(foreach l,host link common,$(call lib,$l))
	$(call say,LINK,$@)
	$(link)

$(BUILD)/bench/drop-0001.log: $(PROGRAMS)
	$(Q)rm -rf $(@D) && $(BUILD)/droptower run --scene $(SCENE) --angle $(ANGLE) --out $(@D) >/dev/null 2>&1

.PHONY: bench
bench: $(BUILD)/tests/bench $(BUILD)/bench/drop-0001.log ## what estimates, readers and batch cost in processor time, beside what was asked for and other programs
	@$< $(BUILD)/droptower $(BUILD)/bench/drop-0001.log
	@python3 tests/bench/throughput.py $(BUILD) $(BUILD)/bench/drop-0001.log
	@if python3 -c 'import scipy' 2>/dev/null; then python3 tests/bench/peers.py; \
	else echo 'peers: python3-scipy is not installed'; fi
