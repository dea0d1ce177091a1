# SPDX-License-Identifier: GPL-3.0-or-later
#
# awk -v name=SCENARIO -f differences.awk differences SCENARIO.ini: the scenario with what is expected of the board. A
# ledger that the scenario does not mention is added.
FNR == NR {
	split($0, column, "\t")
	if (column[1] == "*" || column[1] == name) limits[column[2]] = column[3]
	next
}
function add_ledgers(key) {
	for (key in limits)
		if (section == "[expect]" && key ~ /^ledger_/) {
			print key " = " limits[key]
			delete limits[key]
		}
}
/^\[/ { add_ledgers(); section = $1 }
{
	key = $1
	if ((section == "[expect]" || section == "[counters]") && (key in limits) && $2 == "=") {
		print key " = " limits[key]
		delete limits[key]
	} else
		print
}
END { add_ledgers() }
