# SPDX-License-Identifier: GPL-3.0-or-later
#
# Estimates against their Cramer-Rao bounds: a short set for `make test`, the long one for `make accuracy`.

ACCURACY_C = $(wildcard tests/accuracy/*.c)
ACCURACY_O = $(call obj,$(filter-out %/accuracy.c %/test_accuracy.c,$(ACCURACY_C))) $(BUILD)/obj/tests/unit/synth.o
ALL_O += $(call obj,$(ACCURACY_C))
$(call obj,$(ACCURACY_C)): CPPFLAGS += $(LINUX)

$(BUILD)/tests/accuracy $(BUILD)/tests/test_accuracy: $(BUILD)/tests/%: $(BUILD)/obj/tests/accuracy/%.o $(ACCURACY_O) \
		$(foreach l,host link common,$(call lib,$l))
	$(call say,LINK,$@)
	$(Q)mkdir -p $(@D) && $(CC) $(LDFLAGS) $(filter %.o,$^) -Wl,--start-group $(filter %.a,$^) -Wl,--end-group \
		$(LIBRARIES) -lcmocka -o $@

# Only the plain build measures.
ifeq ($(SANITIZE)$(COVERAGE),)
tests: $(BUILD)/tests/test_accuracy
endif

DROPS ?= 10000

.PHONY: accuracy chart
accuracy: setup ## every estimate against its Cramer-Rao bound, thousands of drops of known truth (DROPS=)
	@$(MAKE) --no-print-directory -j$(JOBS) BUILD=$(BUILD) $(BUILD)/tests/accuracy
	@$(BUILD)/tests/accuracy --drops $(DROPS)

# What README.md and host/chart/README.md show; the other pictures stay in the build folder.
SHOWN = accuracy-peak accuracy-plate-peak accuracy-frequency stability-peak stability-frequency \
	model-tables model-integrators \
	$(addprefix model-stability-,resonance step restitution angle dent decrement)

chart: setup ## error against cost, and where methods fail; renews the pictures of host/chart
	@$(MAKE) --no-print-directory -j$(JOBS) BUILD=$(BUILD) all
	@$(BUILD)/droptower chart accuracy --out $(BUILD)/chart
	@$(BUILD)/droptower chart stability --out $(BUILD)/chart
	@$(BUILD)/droptower chart model --out $(BUILD)/chart
	@$(BUILD)/droptower chart model-stability --out $(BUILD)/chart
	@for picture in $(SHOWN); do sed 's/[ \t]*$$//' $(BUILD)/chart/$$picture.svg >host/chart/$$picture.svg || exit 1; done
	@echo "pictures and CSV files: $(BUILD)/chart"
