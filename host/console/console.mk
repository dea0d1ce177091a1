# SPDX-License-Identifier: GPL-3.0-or-later
#
# droptower-console, the program behind `droptower serve`, with its page inside. Built for `make console`, the tests and
# `make install`, not by `make all`: a drop needs neither npm nor a web server.

NPM_PACKAGE = $(if $(shell command -v npm),,npm)
PACKAGES_CONSOLE = $(PACKAGES_RUN) libmicrohttpd-dev $(NPM_PACKAGE)
PACKAGES_TEST += $(NPM_PACKAGE)

CONSOLE_IN = host/console
CONSOLE = $(BUILD)/droptower-console
CONSOLE_ARCHIVE ?= $(BUILD)/console

COLUMNS_JS = $(BUILD)/generated/columns.js
PAGE_FILES = $(filter-out %.json %.md %.in,$(wildcard $(CONSOLE_IN)/page/*)) $(COLUMNS_JS)
UPLOT_FILES = $(BUILD)/npm/uplot.js $(BUILD)/npm/uplot.css
PAGE_C = $(BUILD)/generated/page_parts.c
PAGE_O = $(BUILD)/obj/page_parts.o

$(UPLOT_FILES) &: $(CONSOLE_IN)/page/package.json $(CONSOLE_IN)/page/package-lock.json
	$(call say,NPM,$<)
	$(Q)mkdir -p $(BUILD)/npm && cp $^ $(BUILD)/npm/
	$(Q)cd $(BUILD)/npm && npm ci --ignore-scripts --no-audit --no-fund --loglevel=error >/dev/null
	$(Q)cp $(BUILD)/npm/node_modules/uplot/dist/uPlot.esm.js $(BUILD)/npm/uplot.js
	$(Q)cp $(BUILD)/npm/node_modules/uplot/dist/uPlot.min.css $(BUILD)/npm/uplot.css

$(COLUMNS_JS): $(CONSOLE_IN)/page/columns.js.in host/result/quantity.def
	$(call say,CPP,$@)
	$(Q)mkdir -p $(@D)
	$(Q)$(CPP) -P -I. -x c $< >$@.new && mv $@.new $@

$(PAGE_C): $(CONSOLE_IN)/embed $(PAGE_FILES) $(UPLOT_FILES)
	$(call say,EMBED,$@)
	$(Q)mkdir -p $(@D)
	$(Q)$^ >$@.new && mv $@.new $@

$(PAGE_O): $(PAGE_C) $(CONSOLE_IN)/page_parts.h
	$(call say,CC,$<)
	$(Q)mkdir -p $(@D)
	$(Q)$(CC) $(CFLAGS) $(CPPFLAGS) -c $< -o $@

ALL_O += $(call obj,$(CONSOLE_IN)/main.c)
$(CONSOLE): LIBRARIES += -lmicrohttpd
$(CONSOLE): $(call obj,$(CONSOLE_IN)/main.c) $(PAGE_O) $(foreach l,console host link common,$(call lib,$l))
	$(call say,LINK,$@)
	$(link)

tests: $(CONSOLE)

.PHONY: console
console: ## set up, build, and serve the technician's page on a simulated tower (CONSOLE_ARCHIVE=)
	$(call install,$(PACKAGES_CONSOLE),serve the page)
	@$(MAKE) --no-print-directory -j$(JOBS) all $(CONSOLE)
	@$(BUILD)/droptower serve --archive $(CONSOLE_ARCHIVE)
