#compdef cairn
# SPDX-License-Identifier: BSD-3-Clause
# Completion for zsh: verbs and options come from the tool's help, so that they are never out of date.
_cairn() {
  local word help
  local -a before entries
  for word in ${words[2,CURRENT-1]}; do
    [[ $word == -* ]] && continue
    help=$(cairn $before --help-all 2>/dev/null) || return 1
    [[ -n $(sed -n '/^Verbs:/,/^$/p' <<<$help | grep "^  $word  ") ]] || break
    before+=$word
  done
  help=$(cairn $before --help-all 2>/dev/null) || return 1
  if [[ $words[CURRENT] == -* ]]; then
    entries=(${(f)"$(sed -nE 's/^  (-., )?(--[a-z-]+)[^ ]*( [^ ]+)? +(.*)$/\2:\4/p' <<<$help)"})
    _describe option entries
  else
    entries=(${(f)"$(sed -n '/^Verbs:/,/^$/s/^  \([a-z][a-z-]*\)  *\(.*\)$/\1:\2/p' <<<$help)"})
    if (( $#entries )); then _describe verb entries; else _files; fi
  fi
}
_cairn "$@"
