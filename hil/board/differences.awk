# SPDX-License-Identifier: GPL-3.0-or-later
#
# awk -v name=SCENARIO [-v clocks=N] -f differences.awk differences SCENARIO.ini: the scenario with what is expected of the
# board, with N clocks an instruction (1). A ledger that the scenario does not mention is added; a list that goes on there
# stands in as many lines here.
BEGIN { if (clocks == "") clocks = 1 }
FNR == NR {
	split($0, column, "\t")
	if (column[1] == "*" || column[1] == name || column[1] == "*@" clocks || column[1] == name "@" clocks)
		limits[column[2]] = (column[2] in limits ? limits[column[2]] "\n" column[2] " = " : "") column[3]
	next
}
function add_ledgers(key) {
	for (key in limits)
		if (section == "[expect]" && key ~ /^ledger_/ && !(key in printed)) {
			print key " = " limits[key]
			printed[key] = 1
		}
}
/^\[/ { add_ledgers(); section = $1 }
{
	key = $1
	if ((section == "[expect]" || section == "[counters]") && (key in limits) && $2 == "=") {
		if (!(key in printed)) print key " = " limits[key]
		printed[key] = 1
	} else
		print
}
END { add_ledgers() }
