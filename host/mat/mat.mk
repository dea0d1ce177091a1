# SPDX-License-Identifier: GPL-3.0-or-later
#
# droptower-mat, where pkg-config tells of libmatio. Without it everything else is built, and a MAT file is refused with
# what to install.

PACKAGES_TEST += libmatio-dev python3-scipy

MAT := $(shell pkg-config --cflags --libs matio zlib 2>/dev/null)

ifneq ($(MAT),)
all: $(BUILD)/droptower-mat
MAT_O = $(call obj,$(wildcard host/mat/*.c))
ALL_O += $(MAT_O)
$(MAT_O): CPPFLAGS += $(LINUX) $(patsubst -I%,-isystem %,$(filter -I%,$(MAT)))

$(BUILD)/droptower-mat: LIBRARIES += $(filter-out -I%,$(MAT))
$(BUILD)/droptower-mat: $(MAT_O) $(foreach l,host link common,$(call lib,$l))
	$(call say,LINK,$@)
	$(link)
endif
