# SPDX-License-Identifier: BSD-3-Clause
# Sourced by the scripts that simulate sessions.

# second_session KIND SEED: how the second session of a place differs from the first, as options of cairn simulate: it is as the
# first, with a quarter of the things moved, or these on another path.
second_session() {
  local changed=0 path=sweep
  if [ $(($2 % 3)) != 1 ]; then changed=0.25; fi
  if [ $(($2 % 3)) = 0 ]; then
    case $1 in corridor | warehouse | kitchen) path=walk ;; *) path=orbit ;; esac
  fi
  echo --session 1 --changed $changed --path $path
}
