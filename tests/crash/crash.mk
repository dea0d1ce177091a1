# SPDX-License-Identifier: GPL-3.0-or-later
# Crashes of the archive, at every step of its writing.

PACKAGES_TEST += strace

.PHONY: crash
crash: setup-test all $(BUILD)/tests/archive_recorder ## replay an archive's writing up to each step, open it, and find every drop
	@tests/crash/prefixes $(BUILD) 1000000
