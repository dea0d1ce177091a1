# SPDX-License-Identifier: GPL-3.0-or-later
#
# The contact table by finite elements, made anew by hand: it needs calculix-ccx, which nothing else does. Half an hour;
# what is solved stays in build/contact-table.

.PHONY: contact-table
contact-table: ## solve host/model/corner.def again with CalculiX (calculix-ccx)
	@command -v ccx >/dev/null || { echo "contact-table needs ccx: apt-get install calculix-ccx"; exit 1; }
	@host/model/corner.py $(BUILD)/contact-table $(JOBS) >$(BUILD)/corner.def
	@mv $(BUILD)/corner.def host/model/corner.def
