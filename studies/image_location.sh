#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Locates images of simulated second sessions in the maps of first sessions that placement_sessions.sh made: 39 images of each
# place in its own map, with depth and without, and in those of all others. CSV to stdout.
set -euo pipefail

if [ $# -lt 3 ]; then
  echo "Usage: studies/image_location.sh BIN SESSIONS SEED...  (BIN has cairn and cairn_image_location_benchmark)" >&2
  exit 2
fi
source "$(dirname "${BASH_SOURCE[0]}")/second_session.sh"
bin=$1
sessions=$2
shift 2
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

places=()
for seed in "$@"; do
  for kind in desk office corridor warehouse room kitchen; do places+=("$kind-$seed"); done
done
locate() { "$bin/cairn_image_location_benchmark" "$@" | tail -n +2; }
echo "map,sequence,image,corners,proposals,visible,expected,matches,spread,located,probability,rotation_deg,translation_m,ms"
for place in "${places[@]}"; do
  kind=${place%-*}
  seed=${place#*-}
  "$bin/cairn" simulate "$folder/$place" --environment "$kind" --seed "$seed" \
    $(second_session "$kind" "$seed") --rate 3 --frames 39 --quiet >&2
  locate "$sessions/$place-0.cairn" "$folder/$place" 1 colour same
  locate "$sessions/$place-0.cairn" "$folder/$place" 3 depth same
  for other in "${places[@]}"; do
    if [ "$other" = "$place" ]; then continue; fi
    locate "$sessions/$other-0.cairn" "$folder/$place" 1 colour other
  done
  rm -rf "${folder:?}/$place"
done
