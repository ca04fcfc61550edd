#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Makes the sessions that cairn_placement_sessions_benchmark reads: two of each place, rendered and mapped.
# Each seed has a layout of its own unless one is given: seeds of one layout are twins.
# KINDS="kitchen office" makes places of these kinds only.
# What is there already is kept, so that it can be stopped and gone on with.
set -euo pipefail

if [ $# -lt 2 ]; then
  echo "Usage: studies/placement_sessions.sh CAIRN FOLDER [SEED[:LAYOUT]...]  (1 to 6 by default)" >&2
  exit 2
fi
source "$(dirname "${BASH_SOURCE[0]}")/second_session.sh"
cairn=$1
folder=$2
shift 2
[ $# -gt 0 ] || set -- 1 2 3 4 5 6
mkdir -p "$folder"
sequence=$(mktemp -d)
trap 'rm -rf "$sequence"' EXIT

for place in "$@"; do
  seed=${place%:*}
  layout=${place#*:}
  for kind in ${KINDS:-desk office corridor warehouse room kitchen}; do
    for session in 0 1; do
      name=$folder/$kind-$seed-$session
      [ -f "$name.gt" ] && continue
      options="--session 0 --changed 0 --path sweep"
      if [ $session = 1 ]; then options=$(second_session "$kind" "$seed"); fi
      rm -rf "$sequence/frames"
      "$cairn" simulate "$sequence/frames" --environment "$kind" --seed "$seed" --layout "$layout" \
        $options --rate 20 --frames 260 --quiet
      "$cairn" map "$sequence/frames" -o "$name.cairn" \
        --start-from "$sequence/frames/groundtruth.txt" --quiet
      cp "$sequence/frames/groundtruth.txt" "$name.gt"
      echo "$name"
    done
  done
done
