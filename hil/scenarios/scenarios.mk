# SPDX-License-Identifier: GPL-3.0-or-later

PORT ?= posix qemu
SCENARIO ?=

.PHONY: hil
hil: ## run the bench's scenarios on posix and qemu, one table (PORT= SCENARIO=)
	@$(MAKE) --no-print-directory setup-test
	@$(MAKE) --no-print-directory -j$(JOBS) all $(filter qemu,$(PORT))
	@hil/scenarios/run $(BUILD) "$(PORT)" $(SCENARIO)
