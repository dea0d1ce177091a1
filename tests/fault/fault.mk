# SPDX-License-Identifier: GPL-3.0-or-later
# Tests of the tests: mutants, canaries, coverage.

PACKAGES_TEST += python3

# ---- mutants ------------------------------------------------------------------------------------------

# Where, of what and by what: hil/board names others.
MUTATED = $(BUILD)/mutate
MUTATED_C = $(addprefix firmware/,sequence.c command.c stream.c capture.c measure.c hosts.c input.c health.c) \
	common/wire.c common/segment.c host/record/join.c
MUTATED_O = $(MUTATED_C:%.c=$(MUTATED)/%.o)
# The unit tests that come near them. Not test_port_faults: thousands of drops for each mutant.
MUTATED_BY = sequence hosts input measure command stream capture wire segment join acquire health parameter
MUTATED_UNIT_C = $(wildcard $(foreach m,$(MUTATED_BY),tests/unit/test_$m.c tests/unit/test_$m_*.c))
MUTATED_UNITS = $(MUTATED_UNIT_C:tests/unit/%.c=$(MUTATED)/%)

# Each file's mutants are numbered from its place in the list times 10000.

$(MUTATED)/%.src.i: %.c Makefile
	$(Q)mkdir -p $(@D)
	$(Q)clang -std=c11 $(if $(filter $(FREESTANDING_C),$<),-ffreestanding,$(LINUX)) $(CPPFLAGS) -DDT_MUTANTS -E -MMD -MP -MT $@ \
		-MF $(@:.i=.d) $< -o $@ && sed -i 's/^#pragma GCC unroll.*//' $@

$(MUTATED)/%.i: $(MUTATED)/%.src.i tests/fault/instrument tests/fault/fault.mk
	$(call say,MUTATE,$*.c)
	$(Q)tests/fault/instrument $$(echo $(MUTATED_C) | tr ' ' '\n' | grep -n '^$*.c$$' | cut -d: -f1)0000 $< $@ \
		$(MUTATED)/$(subst /,-,$*).json $*.c $(if $(filter %wire,$*),common/wire.def)

$(MUTATED_O): %.o: %.i
	$(Q)clang -std=c11 -O1 -g -w -fsanitize=undefined -fsanitize-trap=undefined \
		$(if $(filter $(FREESTANDING_C),$(@:$(MUTATED)/%.o=%.c)),-ffreestanding) -x cpp-output -c $< -o $@

$(MUTATED)/mutant.o: tests/fault/mutant.c Makefile
	$(Q)mkdir -p $(@D)
	$(Q)$(CC) $(CFLAGS) $(LINUX) -c $< -o $@

# As the unit tests are linked, but for the mutated sources.
$(MUTATED)/unit: $(DISPATCH_O) $(UNITS_TOGETHER:$(BUILD)/tests/%=$(BUILD)/obj/tests/unit/%.part) \
		$(call obj,$(UNIT_HELPER_C)) $(MUTATED_O) $(MUTATED)/mutant.o $(UNIT_LIBRARIES) $(call lib,stm32g474)
	$(call say,LINK,$@)
	$(link_units)

$(MUTATED_UNITS): $(MUTATED)/unit
	$(Q)ln -sf unit $@

.SECONDARY: $(MUTATED_O:.o=.i) $(MUTATED_O:.o=.src.i)

# changed tells which sources are to be judged; system/test_mutants calls mutate-changed.
MUTATE = tests/fault/mutate $(MUTATED) tests/fault/survivors $(MUTATED_UNITS)
CHANGED = $(BUILD) tests/fault/judged $(MUTATED_C)

.PHONY: mutate mutate-changed mutated-units
mutated-units: $(MUTATED_UNITS)
	@$(MUTATE) >$(MUTATED)/said || [ -s $(MUTATED)/outcomes ]

mutate: setup-test ## make every small mistake in the heart of the firmware, see a unit test fail, renew tests/fault/judged
	@rm -f $(filter-out $(foreach s,$(MUTATED_C:.c=),$(MUTATED)/$(subst /,-,$s).json),$(wildcard $(MUTATED)/*.json))
	@$(MAKE) --no-print-directory -j$(JOBS) BUILD=$(BUILD) $(MUTATED_UNITS)
	@$(MUTATE); judged=$$?; tests/fault/changed --renew $(CHANGED) && exit $$judged

mutate-changed: units ## the same for the sources that tests/fault/judged does not know as they are
	@changed=$$(tests/fault/changed $(CHANGED)) || exit 1; \
	[ -n "$$changed" ] || { echo "no source with mutants has changed since they were judged"; exit 0; }; \
	echo "changed since their mutants were judged: $$changed"; \
	$(MAKE) --no-print-directory -j$(JOBS) BUILD=$(BUILD) $(MUTATED_UNITS) && $(MUTATE) -- $$changed

-include $(MUTATED_O:.o=.src.d)

# ---- failing port calls: the test stands between the firmware and the fake port -----------------------------

WRAPPED = port_time_us port_io port_bias_high port_outputs port_off_at port_off_cancel port_can_setup port_can_send \
	port_can_receive port_can_errors port_watchdog_kick command_handle
$(BUILD)/tests/test_port_faults: LDFLAGS += $(WRAPPED:%=-Wl,--wrap=%)

# ---- failing system calls: the test stands between the links and the C library -------------------------------

WRAPPED_LINK = calloc malloc strdup fopen poll epoll_create1 epoll_ctl epoll_wait eventfd fstat stat lstat flock dup \
	socket bind listen connect accept4 send recv read write tcgetattr tcsetattr tcflush open
$(BUILD)/tests/test_link_faults: LDFLAGS += $(WRAPPED_LINK:%=-Wl,--wrap=%)

# ---- failing calls of the programs ---------------------------------------------------------------------------

.PHONY: faults
faults: setup-test all ## fail every Nth call of each kind in the commands, once, and say what came of it
	@tests/fault/calls $(BUILD) 40

# ---- canaries: what must be caught, built exactly as the unit tests are ------------------------------------

CANARY_C = $(wildcard tests/fault/canary_*.c)
CANARIES = $(CANARY_C:tests/fault/%.c=$(BUILD)/tests/%)

$(call obj,$(CANARY_C)): CPPFLAGS += $(LINUX)
$(CANARIES): $(BUILD)/tests/%: $(BUILD)/obj/tests/fault/%.o
	$(call say,LINK,$@)
	$(Q)mkdir -p $(@D) && $(CC) $(LDFLAGS) $< -lcmocka -o $@
tests: $(CANARIES)

-include $(CANARY_C:%.c=$(BUILD)/obj/%.d)

# ---- coverage -----------------------------------------------------------------------------------------

ifdef COVERAGE
CFLAGS += -O0 --coverage
LDFLAGS += --coverage
endif

.PHONY: cov
cov: setup-test ## run the unit tests and say which lines and branches of common/ and firmware/ they reach
	@$(MAKE) --no-print-directory -j$(JOBS) BUILD=$(BUILD)/cov CC=gcc COVERAGE=1 units
	@tests/fault/cover $(BUILD)/cov
