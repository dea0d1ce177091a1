# SPDX-License-Identifier: GPL-3.0-or-later

.PHONY: safety
safety: all ## every fault of firmware/SAFETY.md in every phase, and every two of them in five: one table, 0 unsafe, 0 unbraked
	@hil/safety/run $(BUILD)
