# SPDX-License-Identifier: GPL-3.0-or-later
#
# The unit tests are one program, linked once; each $(BUILD)/tests/test_X is a link to it. Those that replace functions
# of the C library, of the port or of the firmware are programs of their own. `make unit` and
# `make check-fast` are the fast loop.

UNITS_ALONE = $(addprefix $(BUILD)/tests/,test_promises test_port_faults test_link_faults test_multibody)
UNITS_TOGETHER = $(filter-out $(UNITS_ALONE),$(UNITS))
DISPATCH_O = $(BUILD)/obj/tests/dispatch/dispatch.o
# They are compiled twice, two thirds of it for the optimizer, and few run for a second: it is left out but where a test
# itself computes for longer than that, or repeats the firmware's steps by the million.
COMPUTING = $(UNITS_ALONE) $(addprefix $(BUILD)/tests/,test_doubt test_log_file test_planar)
$(patsubst $(BUILD)/tests/%,$(BUILD)/obj/tests/unit/%.o,$(filter-out $(COMPUTING),$(UNITS))) \
	$(call obj,$(wildcard tests/fault/canary_*.c)): OPTIMIZED = -O0
UNIT_LIBRARIES = $(foreach l,console host hil firmware link common,$(call lib,$l))
ALL_O += $(DISPATCH_O)

$(BUILD)/generated/droptower_units.h: always
	$(Q)mkdir -p $(@D)
	$(Q)printf 'UNIT(%s)\n' $(notdir $(UNITS_TOGETHER)) | cmp -s - $@ || printf 'UNIT(%s)\n' $(notdir $(UNITS_TOGETHER)) >$@

$(DISPATCH_O): CPPFLAGS += $(LINUX)
$(DISPATCH_O): $(BUILD)/generated/droptower_units.h

# Its main by its own name, and no other name seen outside.
$(BUILD)/obj/tests/unit/%.part: $(BUILD)/obj/tests/unit/%.o
	$(Q)objcopy --redefine-sym main=$*_main --keep-global-symbol=$*_main $< $@

link_units = $(Q)mkdir -p $(@D) && $(CC) $(LDFLAGS) $(filter %.o %.part,$^) -Wl,--start-group $(filter %.a,$^) \
	-Wl,--end-group $(LIBRARIES) -lmicrohttpd -lcmocka -o $@

$(BUILD)/tests/unit: $(DISPATCH_O) $(UNITS_TOGETHER:$(BUILD)/tests/%=$(BUILD)/obj/tests/unit/%.part) \
		$(call obj,$(UNIT_HELPER_C)) $(UNIT_LIBRARIES)
	$(call say,LINK,$@)
	$(link_units)

$(UNITS_TOGETHER): $(BUILD)/tests/unit
	$(Q)ln -sf unit $@

# Another's mechanics, to hold ours against.
$(BUILD)/tests/test_multibody: LIBRARIES += -lode

$(UNITS_ALONE): $(BUILD)/tests/%: $(BUILD)/obj/tests/unit/%.o $(call obj,$(UNIT_HELPER_C)) $(UNIT_LIBRARIES)
	$(call say,LINK,$@)
	$(link_units)

.PHONY: units unit check-fast
units: $(UNITS)

# Each is a make of its own, which would build the libraries beside the one that called it.
unit check-fast: | $(filter all,$(MAKECMDGOALS))

unit: ## build the unit tests and run them side by side
	@$(MAKE) --no-print-directory -j$(JOBS) BUILD=$(BUILD) units
	@tests/run -q -j $(JOBS) $(BUILD) $(BUILD) $(UNITS)

check-fast: ## the fast loop: build, unit tests, edges, outputs, the estimates' short campaign
	@$(MAKE) --no-print-directory -j$(JOBS) BUILD=$(BUILD) all units $(BUILD)/tests/test_accuracy
	@tests/run -q -j $(JOBS) $(BUILD) $(BUILD) tests/system/test_accuracy tests/system/test_golden tests/system/test_edges \
		$(UNITS)
