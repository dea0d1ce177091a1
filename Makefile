# SPDX-License-Identifier: GPL-3.0-or-later
#
# GNU make, everything built out of the tree in $(BUILD). `make help` lists the targets.
# CC=clang, BUILD=DIR, SANITIZE=1 and V=1 change how; nothing else needs setting.

BUILD ?= build
CC = gcc
MAKEFLAGS += --no-builtin-rules
JOBS ?= $(shell nproc)

# ---- what must be installed ------------------------------------------------------------------------

PACKAGES_RUN = gcc libc6-dev libgsl-dev liblcm-dev liblcm-bin libinih-dev libcjson-dev gnuplot-nox \
	libsqlite3-dev nettle-dev zlib1g-dev libzstd-dev
PACKAGES_TEST = $(PACKAGES_RUN) libcmocka-dev clang llvm libclang-rt-14-dev can-utils python3-canmatrix \
	iproute2 util-linux gawk libmicrohttpd-dev libode-dev valgrind

# ---- flags -----------------------------------------------------------------------------------------

WARNINGS = -Wall -Wextra -Werror -Wconversion -Wshadow -Wstrict-prototypes -Wmissing-prototypes \
	-Wundef -Wcast-qual -Wwrite-strings -Wvla -Wpointer-arith -Wimplicit-fallthrough
# Lines and names are all that a sanitizer's report needs.
DEBUG = $(if $(SANITIZE),-g1,-g)
OPTIMIZED = -O2
CFLAGS = -std=c11 $(OPTIMIZED) $(DEBUG) -ffp-contract=off -fno-common $(WARNINGS)
ifdef SANITIZE
CFLAGS += -fsanitize=address,undefined -fno-sanitize-recover=all -fno-omit-frame-pointer
LDFLAGS += -fsanitize=address,undefined
endif
CPPFLAGS = -I. -I$(BUILD)/generated
# The posix side may use all of Linux; common/ and the firmware core get only what C11 has.
LINUX = -D_GNU_SOURCE
# Statically what every start would have to bind: three quarters of a start's instructions.
LIBRARIES = -Wl,-Bstatic -lsqlite3 -lnettle -linih -lzstd -lgsl -lgslcblas -Wl,-Bdynamic -llcm -lcjson -lz -lm -lpthread

VERSION := $(shell git describe --always --dirty 2>/dev/null || echo unknown)

Q = $(if $(V),,@)
say = @$(if $(V),true,printf '  %-8s %s\n' $(1) '$(2)')

# ---- sources: a new file needs no line here ---------------------------------------------------------

LCM_TYPES = $(basename $(notdir $(wildcard common/lcm/*.lcm)))
LCM_C = $(LCM_TYPES:%=$(BUILD)/generated/droptower_%.c)
LCM_H = $(LCM_C:.c=.h)

FREESTANDING_C = $(wildcard common/*.c firmware/*.c)
COMMON_C = $(wildcard common/*.c)
FIRMWARE_C = $(wildcard firmware/*.c)
POSIX_C = $(wildcard firmware/port/posix/*.c)
LOCKSTEP_C = firmware/port/lockstep.c
INSIDE_C = firmware/port/inside/inside.c firmware/port/posix/port.c
LINK_C = $(wildcard common/base/*.c common/link/*.c common/scenes/*.c)
HOST_C = $(filter-out host/main.c host/hdf5/% host/mat/% host/console/%,$(wildcard host/*.c host/*/*.c))
# The page's program: its main is built by console.mk, the rest is a library that tests use too.
CONSOLE_C = $(filter-out host/console/main.c,$(wildcard host/console/*.c))
HIL_C = $(filter-out hil/main.c,$(wildcard hil/*.c))
UNIT_C = $(wildcard tests/unit/test_*.c)
UNIT_HELPER_C = $(filter-out $(UNIT_C),$(wildcard tests/unit/*.c))
TOOL_C = $(wildcard tests/system/*.c)

obj = $(patsubst %.c,$(BUILD)/obj/%.o,$(1))
lib = $(BUILD)/lib/lib$(1).a

LCM_O = $(LCM_C:.c=.o)
ALL_O = $(call obj,$(FREESTANDING_C) $(LOCKSTEP_C) $(sort $(POSIX_C) $(INSIDE_C)) $(LINK_C) $(HOST_C) host/main.c $(CONSOLE_C) $(HIL_C) hil/main.c \
	$(UNIT_C) $(UNIT_HELPER_C) $(TOOL_C))
PROGRAMS = $(BUILD)/droptower $(BUILD)/droptower-firmware $(BUILD)/droptower-bench
UNITS = $(UNIT_C:tests/unit/%.c=$(BUILD)/tests/%)
TOOLS = $(TOOL_C:tests/system/%.c=$(BUILD)/tests/%)

.PHONY: all
all: $(PROGRAMS) ## build the three programs into build/

# ---- compiling --------------------------------------------------------------------------------------

$(call obj,$(FREESTANDING_C) $(LOCKSTEP_C)): CFLAGS += -ffreestanding
# Firmware and plant in one program are thousands of small calls a simulated ms: gcc joins them across
# files, there only: --wrap of a test sees no call that has been joined.
LTO = $(if $(SANITIZE),,$(if $(findstring gcc,$(CC)),-flto=auto -ffat-lto-objects))
$(call obj,$(HIL_C) hil/main.c $(LOCKSTEP_C) $(INSIDE_C) $(FREESTANDING_C)): CFLAGS += $(LTO) -O3
$(call obj,$(HIL_C)): CFLAGS += -fno-math-errno
LDFLAGS += $(if $(LTO),-fno-lto)
$(BUILD)/droptower-bench: LDFLAGS := $(filter-out -fno-lto,$(LDFLAGS)) $(LTO) -O3
$(call obj,$(POSIX_C) $(INSIDE_C) $(LINK_C) $(HOST_C) host/main.c $(CONSOLE_C) host/console/main.c $(HIL_C) hil/main.c $(UNIT_C) \
	$(UNIT_HELPER_C) $(TOOL_C)): CPPFLAGS += $(LINUX)

$(BUILD)/obj/%.o: %.c Makefile
	$(call say,CC,$<)
	$(Q)mkdir -p $(@D)
	$(Q)$(CC) $(CFLAGS) $(CPPFLAGS) -MMD -MP -c $< -o $@

$(call obj,$(HOST_C) host/main.c $(CONSOLE_C) host/console/main.c $(UNIT_C) $(TOOL_C)): | $(LCM_H) $(BUILD)/generated/droptower_version.h

# Touched only when the version changes, so that nothing is compiled in vain.
$(BUILD)/generated/droptower_version.h: always
	$(Q)mkdir -p $(@D)
	$(Q)echo '#define DT_VERSION "$(VERSION)"' | cmp -s - $@ || echo '#define DT_VERSION "$(VERSION)"' >$@
.PHONY: always

$(BUILD)/generated/droptower_%.c $(BUILD)/generated/droptower_%.h: common/lcm/%.lcm
	$(call say,LCM,$<)
	$(Q)mkdir -p $(@D)
	$(Q)lcm-gen -c --c-cpath $(@D) --c-hpath $(@D) $<

# Generated code is lcm-gen's business: our warnings do not apply to it, nor does its memcpy of nothing to
# nowhere stop the sanitizer.
$(LCM_O): %.o: %.c | $(LCM_H)
	$(Q)$(CC) $(filter-out $(WARNINGS),$(CFLAGS)) $(if $(SANITIZE),-fno-sanitize=nonnull-attribute) \
		$(CPPFLAGS) -c $< -o $@

$(BUILD)/lib/%.a:
	$(call say,AR,$@)
	$(Q)mkdir -p $(@D)
	$(Q)rm -f $@ && ar qcs $@ $^

$(call lib,common): $(call obj,$(COMMON_C))
$(call lib,firmware): $(call obj,$(FIRMWARE_C))
$(call lib,link): $(call obj,$(LINK_C))
$(call lib,host): $(call obj,$(HOST_C)) $(LCM_O)
$(call lib,console): $(call obj,$(CONSOLE_C))
$(call lib,hil): $(call obj,$(HIL_C))

link = $(Q)mkdir -p $(@D) && $(CC) $(LDFLAGS) $(filter %.o,$^) -Wl,--start-group $(filter %.a,$^) -Wl,--end-group \
	$(LIBRARIES) -o $@

$(BUILD)/droptower: $(call obj,host/main.c) $(foreach l,host link common,$(call lib,$l))
	$(call say,LINK,$@)
	$(link)

$(BUILD)/droptower-bench: $(call obj,hil/main.c $(LOCKSTEP_C) $(INSIDE_C)) $(foreach l,hil firmware link common,$(call lib,$l))
	$(call say,LINK,$@)
	$(link)

$(BUILD)/droptower-firmware: $(call obj,$(LOCKSTEP_C) $(POSIX_C)) $(foreach l,firmware link common,$(call lib,$l))
	$(call say,LINK,$@)
	$(link)

$(TOOLS): $(BUILD)/tests/%: $(BUILD)/obj/tests/system/%.o $(foreach l,host link common,$(call lib,$l))
	$(call say,LINK,$@)
	$(link)

# What a port, the bench's helpers and the tests add: their own programs, targets and packages.
include $(sort $(wildcard firmware/port/*/*.mk host/*/*.mk hil/*/*.mk tests/*/*.mk))

# ---- set-up -----------------------------------------------------------------------------------------

# Installs what is missing and says so; asks for nothing when all is there.
define install
@missing=; for p in $(1); do \
	dpkg-query -W -f '$${Status}' $$p 2>/dev/null | grep -q 'ok installed' || missing="$$missing $$p"; done; \
if [ -n "$$missing" ]; then \
	echo "Installing Debian packages needed to $(2):$$missing"; \
	sudo=; [ "$$(id -u)" = 0 ] || sudo=sudo; \
	$$sudo apt-get update -qq && \
	DEBIAN_FRONTEND=noninteractive $$sudo apt-get install -y -qq --no-install-recommends $$missing >/dev/null || \
	{ echo "Could not install:$$missing. Install them by hand and run make again." >&2; exit 1; }; fi
endef

.PHONY: setup setup-test
setup: ## install the Debian packages that building and running needs
	$(call install,$(PACKAGES_RUN),build and run)
setup-test: ## install the Debian packages that the tests need as well
	$(call install,$(PACKAGES_TEST),test)

# ---- the two commands of the README -----------------------------------------------------------------

SCENE ?= common/scenes/geometry-2A.ini
ANGLE ?= 25
OUT ?= $(BUILD)/drop

.PHONY: drop test
drop: ## set up, build, and run one simulated drop end to end (SCENE= ANGLE= OUT=)
	@$(MAKE) --no-print-directory setup
	@$(MAKE) --no-print-directory -j$(JOBS) all
	@$(BUILD)/droptower run --scene $(SCENE) --angle $(ANGLE) --out $(OUT)

test: ## set up, build, and run every test; the last line counts them
	@$(MAKE) --no-print-directory setup-test
	@$(MAKE) --no-print-directory -j$(JOBS) BUILD=$(BUILD) all tests sanitized
	@tests/run $(BUILD) $(BUILD)/sanitize

.PHONY: tests sanitized
tests: $(UNITS) $(TOOLS)

# With the plain build's jobs: where one waits for a download or a link, the other compiles.
sanitized: ## the whole of it again with clang and sanitizers, in build/sanitize
	@$(MAKE) --no-print-directory BUILD=$(BUILD)/sanitize CC=clang SANITIZE=1 all tests

# ---- more ---------------------------------------------------------------------------------------------

.PHONY: check edges dbc schema readme format clean help
check: edges ## test, both compilers with warnings as errors, sanitizers, include edges, formatting
	@$(MAKE) --no-print-directory test
	@clang-format --dry-run --Werror $$(git ls-files '*.c' '*.h')

edges: all ## check that no folder includes or calls what it must not (tests/edges lists the rules)
	@tests/edges $(BUILD)

schema: $(BUILD)/droptower.schema.json ## write the table of results as a JSON Schema
$(BUILD)/droptower.schema.json: $(BUILD)/droptower
	$(Q)$(BUILD)/droptower --schema >$@

dbc: $(BUILD)/droptower.dbc ## write the wire as a DBC file for CAN tools
$(BUILD)/droptower.dbc: $(BUILD)/droptower
	$(Q)$(BUILD)/droptower convert --dbc $@
	@echo $@

readme: all ## drop once and renew what README.md shows of it
	@tests/readme $(BUILD)

format: ## run clang-format over all sources
	@clang-format -i $$(git ls-files '*.c' '*.h')

clean: ## remove build/
	rm -rf $(BUILD)

help: ## this list
	@awk -F ':.*## ' '/^[a-z0-9-]+:.*## /{printf "  %-12s %s\n", $$1, $$2}' $(filter %Makefile %.mk,$(MAKEFILE_LIST))

-include $(ALL_O:.o=.d)
