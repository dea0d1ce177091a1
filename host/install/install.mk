# SPDX-License-Identifier: GPL-3.0-or-later
#
# make install, make uninstall: DESTDIR is put in front of every path, PREFIX is where things will be used. All goes
# below PREFIX, where systemd (252), udev, man and bash-completion look when it is /usr/local or /usr.

PACKAGES_TEST += mandoc systemd

PREFIX ?= /usr/local
BINDIR = $(PREFIX)/bin
SHARE = $(PREFIX)/share
LIBDIR = $(PREFIX)/lib
INSTALL_IN = host/install

INSTALLED_PROGRAMS = $(PROGRAMS) $(CONSOLE) $(if $(HDF5),$(BUILD)/droptower-hdf5) $(if $(MAT),$(BUILD)/droptower-mat)
INSTALLED_SCENES = $(wildcard common/scenes/*.ini)
MAN = $(BUILD)/man
# A page's date is that of the sources, so that the same sources give the same page.
MAN_DATE = $(shell git log -1 --format=%cs 2>/dev/null || date +%F)

.PHONY: man install uninstall
man: all ## write the manual's pages into build/man
	@rm -rf $(MAN)
	@$(INSTALL_IN)/manual $(BUILD)/droptower $(MAN) $(MAN_DATE) $(VERSION)
	@for p in $(filter-out droptower,$(notdir $(INSTALLED_PROGRAMS))); do ln -s droptower.1 $(MAN)/$$p.1; done

# put MODE FILES FOLDER
put = @install -d '$(DESTDIR)$(3)' && install -m $(1) $(2) '$(DESTDIR)$(3)/'

install: man $(CONSOLE) ## install below PREFIX (/usr/local), all of it below DESTDIR
	$(call put,755,$(INSTALLED_PROGRAMS),$(BINDIR))
	$(call put,644,$(INSTALLED_SCENES),$(SHARE)/droptower/scenes)
	$(call put,755,host/batch/droptower.sbatch,$(SHARE)/droptower)
	$(call put,644,$(wildcard $(INSTALL_IN)/droptower_example.*),$(SHARE)/droptower)
	$(call put,644,$(wildcard common/scenes/sensors/*.ini),$(SHARE)/droptower/scenes/sensors)
	$(call put,644,$(MAN)/*.1,$(SHARE)/man/man1)
	$(call put,644,$(INSTALL_IN)/80-can0.network,$(LIBDIR)/systemd/network)
	$(call put,644,$(INSTALL_IN)/80-droptower-slcan.rules,$(LIBDIR)/udev/rules.d)
	@install -d '$(DESTDIR)$(SHARE)/bash-completion/completions' '$(DESTDIR)$(LIBDIR)/systemd/system' \
		'$(DESTDIR)$(LIBDIR)/sysctl.d'
	@install -m 644 $(INSTALL_IN)/droptower.bash '$(DESTDIR)$(SHARE)/bash-completion/completions/droptower'
	@install -m 644 $(INSTALL_IN)/80-droptower-sysctl.conf '$(DESTDIR)$(LIBDIR)/sysctl.d/80-droptower.conf'
	@sed 's|@BINDIR@|$(BINDIR)|' $(INSTALL_IN)/droptower.service.in >'$(DESTDIR)$(LIBDIR)/systemd/system/droptower.service'
	@chmod 644 '$(DESTDIR)$(LIBDIR)/systemd/system/droptower.service'
	@echo 'installed below $(DESTDIR)$(PREFIX)'

# Folders that others use too stay; those that are ours alone go.
uninstall: ## remove what install has installed (same PREFIX and DESTDIR)
	@rm -f $(foreach p,$(notdir $(PROGRAMS) $(CONSOLE)) droptower-hdf5 droptower-mat,'$(DESTDIR)$(BINDIR)/$p') \
		'$(DESTDIR)$(SHARE)/man/man1/droptower.1' '$(DESTDIR)$(SHARE)'/man/man1/droptower-*.1 \
		'$(DESTDIR)$(LIBDIR)/systemd/network/80-can0.network' \
		'$(DESTDIR)$(LIBDIR)/systemd/system/droptower.service' \
		'$(DESTDIR)$(LIBDIR)/sysctl.d/80-droptower.conf' \
		'$(DESTDIR)$(LIBDIR)/udev/rules.d/80-droptower-slcan.rules' \
		'$(DESTDIR)$(SHARE)/bash-completion/completions/droptower'
	@rm -f $(foreach f,droptower.sbatch droptower_example.py droptower_example.m,'$(DESTDIR)$(SHARE)/droptower/$f')
	@rm -rf '$(DESTDIR)$(SHARE)/droptower/scenes'
	@rmdir '$(DESTDIR)$(SHARE)/droptower' 2>/dev/null || true

# ---- a Debian package, with dpkg-deb alone ----

DEB = $(BUILD)/droptower.deb
DEB_STAGE = $(BUILD)/deb

.PHONY: deb
deb: ## build a Debian package of this version, build/droptower.deb; DEBEMAIL= is its maintainer's address
	@rm -rf $(DEB_STAGE)
	@$(MAKE) --no-print-directory BUILD=$(BUILD) PREFIX=/usr DESTDIR=$(abspath $(DEB_STAGE)) install
	@$(INSTALL_IN)/deb $(DEB_STAGE) 0~git$(shell git log -1 --format=%cd --date=format:%Y%m%d 2>/dev/null).$(subst -,.,$(VERSION)) $(DEB)
