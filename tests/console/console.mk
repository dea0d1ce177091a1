# SPDX-License-Identifier: GPL-3.0-or-later
#
# The page in a real browser: system/test_console_browser drives Debian's Chromium through playwright-core, which
# comes from npm as the lock file says. The lock file has no download addresses: any registry will do.

PACKAGES_TEST += chromium

# Two pictures of the page for the README are made by the same programs.
.PHONY: console-pictures
console-pictures: $(BUILD)/tests/npm/installed all ## renew the page's pictures in host/console from a simulated series
	@node tests/console/pictures.mjs $(BUILD)

$(BUILD)/tests/npm/installed: tests/console/package.json tests/console/package-lock.json
	$(call say,NPM,tests/console)
	$(Q)rm -rf $(@D) && mkdir -p $(@D) && cp $^ $(@D)
	$(Q)cd $(@D) && npm ci --no-audit --no-fund --ignore-scripts --loglevel=error >/dev/null
	$(Q)touch $@

ifeq ($(SANITIZE)$(COVERAGE),)
tests: $(BUILD)/tests/npm/installed
endif
