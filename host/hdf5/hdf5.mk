# SPDX-License-Identifier: GPL-3.0-or-later
#
# droptower-hdf5, where libhdf5 is: told by pkg-config, or by the library's own h5cc. Without it everything else is
# built, and `droptower convert` says what is missing.

PACKAGES_TEST += libhdf5-dev pkg-config python3-h5py

# h5cc links the static library and so names all that it needs.
HDF5 := $(shell pkg-config --cflags --libs hdf5 2>/dev/null || h5cc -show 2>/dev/null | cut -d' ' -f2-)

ifneq ($(HDF5),)
all: $(BUILD)/droptower-hdf5
HDF5_O = $(call obj,$(wildcard host/hdf5/*.c))
ALL_O += $(HDF5_O)
$(HDF5_O): CPPFLAGS += $(LINUX) $(patsubst -I%,-isystem %,$(filter -I%,$(HDF5)))

$(BUILD)/droptower-hdf5: LIBRARIES += $(filter-out -I%,$(HDF5))
$(BUILD)/droptower-hdf5: $(HDF5_O) $(foreach l,host link common,$(call lib,$l))
	$(call say,LINK,$@)
	$(link)
endif
