# SPDX-License-Identifier: GPL-3.0-or-later
#
# Completion for droptower in bash. Commands, verbs and options are asked of the program itself (--help), so that this
# file knows nothing that could become wrong.

# Names of commands or verbs: lower-case words at the beginning of a table's row, and alternatives of a usage line.
_droptower_words() {
	"$@" --help 2>/dev/null | awk '
		/^  [a-z]/ || /^[a-z-]+  +[a-z]/ { print $1 }
		/^usage:/ { for (i = 1; i <= NF; i++) if ($i ~ /^[a-z]+(\|[a-z]+)+$/) { gsub(/\|/, "\n", $i); print $i } }'
}

_droptower_options() {
	"$@" --help 2>/dev/null | grep -oE -- '(^|[[ ])--[a-z][a-z0-9-]*' | tr -d '[ ' | sort -u
	echo --help
}

# What comes behind can: and udpm: is cut off by readline, which takes the colon for the end of a word.
_droptower_link() {
	local scheme=$1 rest=$2 device
	case $scheme in
	can)
		for device in /sys/class/net/*; do # type 280 is CAN
			[ "$(cat "$device/type" 2>/dev/null)" = 280 ] && echo "${device##*/}"
		done ;;
	slcan) compgen -G '/dev/tty[AS]*' ;;
	unix | log) compgen -f -- "$rest" ;;
	*) printf '%s\n' can: slcan: unix: udpm: ;;
	esac
}

_droptower_scenes() {
	local program
	program=$(type -P -- "$1") && compgen -G "${program%/*}/../share/droptower/scenes/$2*.ini"
	compgen -f -X '!*.ini' -- "$2"
	compgen -d -S / -- "$2"
}

# Series of the archive that the line names, or else of the one that the program takes.
_droptower_series() {
	local program=$1 word before= archive=()
	for word in "${COMP_WORDS[@]}"; do
		[ "$before" = --archive ] && archive=(--archive "$word")
		before=$word
	done
	"$program" series list "${archive[@]}" 2>/dev/null | awk 'NR > 1 { print $1 }'
}

_droptower() {
	local program=${COMP_WORDS[0]} command=${COMP_WORDS[1]} current=${COMP_WORDS[COMP_CWORD]}
	local before=${COMP_WORDS[COMP_CWORD - 1]} option=${COMP_WORDS[COMP_CWORD - 1]} scheme= choice choices
	COMPREPLY=()
	if [ "$current" = : ]; then
		current= scheme=$before option=${COMP_WORDS[COMP_CWORD - 2]}
	elif [ "$before" = : ]; then
		scheme=${COMP_WORDS[COMP_CWORD - 2]} option=${COMP_WORDS[COMP_CWORD - 3]}
	fi
	if [ "$COMP_CWORD" -eq 1 ]; then
		choices=$(_droptower_words "$program")$'\n--help\n--version'
	else
		case $option in
		--scene) choices=$(_droptower_scenes "$program" "$current") ;;
		--link | --lcm | --to) choices=$(_droptower_link "$scheme" "$current") ;;
		--out | --archive) choices=$(compgen -d -- "$current") ;;
		--series) choices=$(_droptower_series "$program") ;;
		*)
			choices=$(compgen -f -- "$current")
			case $current in
			-*) choices=$(_droptower_options "$program" "$command") ;;
			*)
				[ "$COMP_CWORD" -eq 2 ] && choices=$(_droptower_words "$program" "$command")$'\n'$choices
				case $command$option in
				report--html | report--pdf | report--csv) ;;
				report*) choices=$(_droptower_series "$program") ;;
				esac ;;
			esac ;;
		esac
	fi
	# not compgen -W: it would expand, and run, what a file's name says
	while IFS= read -r choice; do
		# an installed scene is found by its name, and replaced by its path
		[ -n "$choice" ] && [[ $choice == "$current"* || $choice == */scenes/"$current"* ]] && COMPREPLY+=("$choice")
	done <<<"$choices"
	case ${COMPREPLY[0]} in *: | */) compopt -o nospace 2>/dev/null ;; esac
}

complete -o filenames -F _droptower droptower
