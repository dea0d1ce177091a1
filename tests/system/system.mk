# SPDX-License-Identifier: GPL-3.0-or-later

REPLAYED = DROPTOWER_DROPS=100 DROPTOWER_TIMES=100 DROPTOWER_RECORDING=$(abspath $(BUILD))/tests/recording.log

.PHONY: replay-safety
replay-safety: all ## 100 recorded drops, each sent 100 times at a ready and at an armed tower: unix, LCM
	@rm -f $(BUILD)/tests/recording.log
	@for suite in replay_safety lcm; do env $(REPLAYED) \
		tests/system/test_$$suite $(BUILD) $(BUILD)/sanitize test_recorded_drops_move_nothing || exit 1; done

.PHONY: day
day: all ## the log of a day, 1 GB and 3 000 drops: each is what its own file says, in 36 MB of memory
	@DROPTOWER_DAY=3000 tests/system/test_drops_in_log $(BUILD) $(BUILD)/sanitize test_a_day
