# SPDX-License-Identifier: BSD-3-Clause
# Completion for bash: verbs and options come from the tool's help, so that they are never out of date.
_cairn() {
  local current=${COMP_WORDS[COMP_CWORD]} word words=() help
  COMPREPLY=()
  for word in "${COMP_WORDS[@]:1:COMP_CWORD-1}"; do
    case $word in
      -*) ;;
      *)
        help=$(cairn "${words[@]}" --help-all 2>/dev/null) || return
        grep -q "^  $word  " <<<"$(sed -n '/^Verbs:/,/^$/p' <<<"$help")" || break
        words+=("$word")
        ;;
    esac
  done
  help=$(cairn "${words[@]}" --help-all 2>/dev/null) || return
  if [[ $current == -* ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$(grep -oE '^  (-., )?--[a-z-]+' <<<"$help" | grep -oE -- '--[a-z-]+')" -- "$current")
  else
    mapfile -t COMPREPLY < <(compgen -W "$(sed -n '/^Verbs:/,/^$/s/^  \([a-z][a-z-]*\) .*/\1/p' <<<"$help")" -- "$current")
  fi
}
complete -o default -F _cairn cairn
