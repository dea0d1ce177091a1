# SPDX-License-Identifier: GPL-3.0-or-later
# Fuzz targets: one program for each fuzz_*.c, libFuzzer with address and undefined-behaviour sanitizers. The sanitized build
# has them too, for a short run in `make test`; there only the targets are instrumented, so that they hardly learn from what
# they do. `make fuzz` builds all of it so that they do.

# That of HDF5 is there when its library is.
FUZZ_C = $(filter-out $(if $(HDF5),,%/fuzz_hdf5.c),$(wildcard tests/fuzz/fuzz_*.c))
FUZZ_O = $(call obj,$(FUZZ_C) tests/fuzz/fuzz.c)
FUZZERS = $(FUZZ_C:tests/fuzz/%.c=$(BUILD)/fuzz/%)
ALL_O += $(FUZZ_O)

ifdef FUZZ
CFLAGS += -fsanitize=fuzzer-no-link
endif
$(FUZZ_O): CPPFLAGS += $(LINUX)
$(FUZZ_O): | $(LCM_H)
$(BUILD)/obj/tests/fuzz/fuzz_hdf5.o: CPPFLAGS += $(patsubst -I%,-isystem %,$(filter -I%,$(HDF5)))
$(BUILD)/fuzz/fuzz_hdf5: $(filter-out %/main.o,$(HDF5_O))
$(BUILD)/fuzz/fuzz_hdf5: LIBRARIES += $(filter-out -I%,$(HDF5))
ifneq ($(and $(SANITIZE),$(findstring clang,$(CC))),)
$(FUZZ_O): CFLAGS += -fsanitize=fuzzer-no-link
endif

$(FUZZERS): $(BUILD)/fuzz/%: $(BUILD)/obj/tests/fuzz/%.o $(call obj,tests/fuzz/fuzz.c) \
		$(foreach l,console host link common,$(call lib,$l))
	$(call say,LINK,$@)
	$(Q)mkdir -p $(@D) && $(CC) $(LDFLAGS) -fsanitize=fuzzer $(filter %.o,$^) -Wl,--start-group $(filter %.a,$^) \
		-Wl,--end-group $(LIBRARIES) -lmicrohttpd -o $@

.PHONY: fuzzers fuzz
fuzzers: $(FUZZERS)
ifneq ($(and $(SANITIZE),$(findstring clang,$(CC))),)
tests: fuzzers
endif

T = 60
fuzz: setup-test all ## run each fuzz target (TARGETS="read http": those) for T seconds (T=60), with a corpus that stays in build/fuzzed
	@$(MAKE) --no-print-directory -j$(JOBS) BUILD=$(BUILD)/fuzzed CC=clang SANITIZE=1 FUZZ=1 fuzzers
	@TARGETS="$(TARGETS)" tests/fuzz/run $(BUILD) $(BUILD)/fuzzed/fuzz $(BUILD)/fuzzed/corpus -max_total_time=$(T)

-include $(FUZZ_C:%.c=$(BUILD)/obj/%.d)
