# SPDX-License-Identifier: GPL-3.0-or-later
#
# awk -v name=SCENARIO [-v clocks=N] -f differences.awk differences SCENARIO.ini: the scenario with what is expected of the
# board, with N clocks an instruction (1). A ledger or a counter of samples that the scenario does not mention is added; a
# list that goes on there stands in as many lines here. What is said of all scenarios comes first, and of one replaces it.
BEGIN { if (clocks == "") clocks = 1 }
FNR == NR {
	split($0, column, "\t")
	own = column[1] == name || column[1] == name "@" clocks
	if (own || column[1] == "*" || column[1] == "*@" clocks) {
		goes_on = column[2] in limits && owned[column[2]] == own
		limits[column[2]] = (goes_on ? limits[column[2]] "\n" column[2] " = " : "") column[3]
		owned[column[2]] = own
	}
	next
}
function add_missing(key) {
	for (key in limits)
		if (!(key in printed) && (section == "[expect]" && key ~ /^ledger_/ || section == "[counters]" && key ~ /^samples_/)) {
			print key " = " limits[key]
			printed[key] = 1
		}
}
/^\[/ { add_missing(); section = $1 }
{
	key = $1
	if ((section == "[expect]" || section == "[counters]") && (key in limits) && $2 == "=") {
		if (!(key in printed)) print key " = " limits[key]
		printed[key] = 1
	} else
		print
}
END { add_missing() }
