# SPDX-License-Identifier: GPL-3.0-or-later
#
# Estimates against their Cramer-Rao bounds: a short set for `make test`, the long one for `make accuracy`.

ACCURACY_C = $(wildcard tests/accuracy/*.c)
KNOCKOUT_C = $(wildcard tests/accuracy/knockout*.c)
ACCURACY_O = $(call obj,$(filter-out %/accuracy.c %/test_accuracy.c $(KNOCKOUT_C),$(ACCURACY_C)))
ALL_O += $(call obj,$(ACCURACY_C))
$(call obj,$(ACCURACY_C)): CPPFLAGS += $(LINUX)

$(BUILD)/tests/accuracy $(BUILD)/tests/test_accuracy: $(BUILD)/tests/%: $(BUILD)/obj/tests/accuracy/%.o $(ACCURACY_O) \
		$(foreach l,host link common,$(call lib,$l))
	$(call say,LINK,$@)
	$(Q)mkdir -p $(@D) && $(CC) $(LDFLAGS) $(filter %.o,$^) -Wl,--start-group $(filter %.a,$^) -Wl,--end-group \
		$(LIBRARIES) -lcmocka -o $@

# The same library: what a mechanism is reached by is led through knockout_wrap.c by the linker.
KNOCKOUT_WRAPS = $(shell sed -n 's/^WRAP.[a-z _]*, \([a-z_]*\),.*/\1/p; s/^.* __wrap_\([a-z_]*\)(.*);$$/\1/p' \
	tests/accuracy/knockout_wrap.c)

$(BUILD)/tests/knockout: $(call obj,$(filter-out %_none.c,$(KNOCKOUT_C))) $(ACCURACY_O) $(foreach l,host link common,$(call lib,$l))
	$(call say,LINK,$@)
	$(Q)mkdir -p $(@D) && $(CC) $(LDFLAGS) $(KNOCKOUT_WRAPS:%=-Wl,--wrap=%) $(filter %.o,$^) \
		-Wl,--start-group $(filter %.a,$^) -Wl,--end-group $(LIBRARIES) -o $@

# Only the plain build measures.
ifeq ($(SANITIZE)$(COVERAGE),)
tests: $(BUILD)/tests/test_accuracy $(BUILD)/tests/knockout
endif

DROPS ?= 10000

.PHONY: accuracy adversarial knockout thresholds chart
accuracy: setup ## every estimate against its Cramer-Rao bound, thousands of drops of known truth (DROPS=)
	@$(MAKE) --no-print-directory -j$(JOBS) BUILD=$(BUILD) $(BUILD)/tests/accuracy
	@$(BUILD)/tests/accuracy --drops $(DROPS)
	@$(MAKE) --no-print-directory -j$(JOBS) BUILD=$(BUILD) $(BUILD)/tests/test_budget
	@DROPS=$(DROPS) $(BUILD)/tests/test_budget

ADVERSARIAL_DROPS ?= 1400

adversarial: setup ## silently wrong values and false alarms in 100 000 drops that nothing is fitted to (ADVERSARIAL_DROPS=)
	@$(MAKE) --no-print-directory -j$(JOBS) BUILD=$(BUILD) $(BUILD)/tests/test_adversarial
	@DROPS=$(ADVERSARIAL_DROPS) $(BUILD)/tests/test_adversarial

# Drops of our own tower, in virtual time; recordings where somebody has put them.
KNOCKOUT_DROPS = $(foreach s,geometry-1 geometry-2A geometry-2B,$(foreach a,15 20 25 30 35,$(BUILD)/knockout/$s-$a.log))
KNOCKOUT_DATA = $(patsubst %,%=time:ms$(,)a:g$(,)-$(,)-$(,)-$(,)-,$(wildcard ../shared/data/afrl_in_situ/*.txt)) \
	$(patsubst %,%=time:s$(,)a:g,$(wildcard ../shared/data/repeated_impacts/acc_*.txt)) \
	$(patsubst %,%=time:s$(,)x:m/s2$(,)y:m/s2$(,)z:m/s2$(,)-,$(wildcard ../shared/data/phone_fall/*.csv))
, = ,

$(BUILD)/knockout/%.log: $(BUILD)/droptower-bench $(BUILD)/droptower-firmware
	$(Q)mkdir -p $(@D)
	$(Q)drop=$*; $(BUILD)/droptower-bench --operate --inside --quiet --seed 1 --log $@ \
		--scene common/scenes/$${drop%-*}.ini --angle $${drop##*-}

knockout: all $(BUILD)/tests/knockout $(KNOCKOUT_DROPS) ## what each special mechanism of the estimators is worth
	@$(BUILD)/tests/knockout $(KNOCKOUT_DROPS) $(KNOCKOUT_DATA)

thresholds: all $(BUILD)/tests/knockout $(call obj,tests/accuracy/knockout_none.c) $(KNOCKOUT_DROPS) ## what each hand-set number does at half and at twice
	@LIBRARIES="$(LIBRARIES)" tests/accuracy/thresholds $(BUILD) $(BUILD)/thresholds.txt $(KNOCKOUT_DROPS) $(KNOCKOUT_DATA)
	@echo "$(BUILD)/thresholds.txt"

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
