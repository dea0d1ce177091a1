# SPDX-License-Identifier: GPL-3.0-or-later

PORT ?= posix inside qemu board
SCENARIO ?=

.PHONY: hil
hil: ## run the bench's scenarios on posix, inside the bench, on qemu and the board's own image, one table (PORT= SCENARIO=)
	@$(MAKE) --no-print-directory setup-test
	@$(MAKE) --no-print-directory -j$(JOBS) all $(filter qemu board,$(PORT))
	@hil/scenarios/run $(BUILD) "$(PORT)" $(SCENARIO)
