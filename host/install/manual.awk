# SPDX-License-Identifier: GPL-3.0-or-later
#
# One page of the manual, man(7). First file: pages, of which the part of this name is kept for the end. Second: the
# command's --help: usage lines, paragraphs, and tables of "  word  what it does".

function escaped(text) {
	gsub(/\\/, "\\e", text)
	gsub(/-/, "\\-", text)
	gsub(/'/, "\\(aq", text)
	return text ~ /^\./ ? "\\&" text : text
}

# A row of a table: the word up to two blanks, or up to one where the word leaves no room for two.
function split_row(line) {
	if (match(line, /^ *[^ ]+( [^ ]+)*  +/)) {
		word = substr(line, 1, RLENGTH)
		rest = substr(line, RLENGTH + 1)
	} else if (match(line, /^  --[a-z0-9-]+ [A-Z]+ /) || match(line, /^  [a-z]+ \[[^]]*\] /)) {
		word = substr(line, 1, RLENGTH)
		rest = substr(line, RLENGTH + 1)
	} else {
		word = line
		rest = ""
	}
	gsub(/^ +| +$/, "", word)
}

FNR == NR {
	if ($0 ~ /^\[.*\]$/)
		mine = $0 == "[" name "]" || $0 == "[*]"
	else if (mine && $0 !~ /^#/)
		tail = tail $0 "\n"
	next
}

FNR == 1 {
	printf ".TH %s 1 \"%s\" \"droptower %s\" \"Drop tower\"\n", toupper(name), date, version
	printf ".SH NAME\n%s \\- %s\n.SH SYNOPSIS\n.nf\n", escaped(name), escaped(what)
	usage = 1
}

usage && /^(usage:|       )/ {
	print escaped(substr($0, 8))
	next
}

usage {
	print ".fi\n.SH DESCRIPTION"
	usage = 0
	begin = 0
}

/^$/ {
	begin = 1
	next
}

/^  [^ ]/ || /^[a-z-]+  +[a-z]/ {
	split_row($0)
	if (word ~ /^--/ && !options++)
		print ".SH OPTIONS"
	printf ".TP\n.B %s\n", escaped(word)
	if (rest != "")
		print escaped(rest)
	begin = 0
	row = 1
	next
}

{
	continued = row && /^   / # of a row
	text = $0
	gsub(/^ +/, "", text)
	if (begin && started && !continued)
		print ".PP"
	if (!continued)
		row = 0
	print escaped(text)
	begin = 0
	started = 1
}

END {
	printf "%s.SH SEE ALSO\n", tail
	count = split(see, names, /[ \n]+/)
	for (i = 1; i <= count; i++)
		printf ".BR %s (1)%s\n", names[i] == "droptower" ? "droptower" : "droptower\\-" names[i], i < count ? "," : ""
}
