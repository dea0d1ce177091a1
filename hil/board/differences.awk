# SPDX-License-Identifier: GPL-3.0-or-later
#
# awk -v name=SCENARIO -f differences.awk differences SCENARIO.ini: the scenario with what is expected of the board. A
# ledger that the scenario does not mention is added; a list that goes on there stands in as many lines here.
FNR == NR {
	split($0, column, "\t")
	if (column[1] == "*" || column[1] == name)
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
