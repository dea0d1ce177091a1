# SPDX-License-Identifier: GPL-3.0-or-later
# What the program tells of simulated drops, byte for byte: tests/system/test_golden compares, `make golden` renews.

.PHONY: golden
golden: setup ## renew tests/golden/list and show what changed in the outputs since it was made
	@$(MAKE) --no-print-directory -j$(JOBS) BUILD=$(BUILD) all
	@tests/golden/compare $(BUILD) renew
