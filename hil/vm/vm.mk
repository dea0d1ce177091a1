# SPDX-License-Identifier: GPL-3.0-or-later
#
# SocketCAN on machines that have it and on those that have not.

PACKAGES_TEST += qemu-system-x86 busybox-static cpio kmod iproute2 can-utils

.PHONY: socketcan socketcan-shell
socketcan: ## drops over real SocketCAN: this machine's vcan, or an emulated Linux that has it
	@$(MAKE) --no-print-directory setup-test
	@$(MAKE) --no-print-directory -j$(JOBS) all
	@tests/system/test_socketcan $(BUILD) $(BUILD)/sanitize

socketcan-shell: ## a shell in that Linux; exit ends it
	@$(MAKE) --no-print-directory setup-test
	@GUEST_S=86400 hil/vm/guest $(BUILD) /bin/bash
