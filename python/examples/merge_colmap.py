# SPDX-License-Identifier: BSD-3-Clause
"""Two COLMAP models of one place become one.

    python3 merge_colmap.py MODEL_A MODEL_B MERGED

Without arguments it makes two models itself.
"""

import pathlib
import sys
import tempfile
import warnings
from typing import Sequence

import cairn


def merge(models: Sequence[pathlib.Path], merged: pathlib.Path) -> None:
    result = cairn.merge([cairn.read_map(model) for model in models], names=[model.name for model in models])
    for part in result.maps:
        print(part, part.reason)
    if result.map is None:
        sys.exit("no two models could be placed with certainty: nothing is written")
    result.map.write(merged, format="colmap")
    print(f"{merged.name}: {result.map}")


def example_models(folder: pathlib.Path) -> Sequence[pathlib.Path]:
    pair = cairn.synthetic_pair(landmarks=1200)
    models = [folder / "monday", folder / "friday"]
    for session, model in zip((pair.source, pair.target), models):
        session.with_camera(cairn.Camera.tum("fr1")).write(model, format="colmap")
    return models


if __name__ == "__main__":
    warnings.simplefilter("ignore")  # of what COLMAP's format does not hold
    if len(sys.argv) == 4:
        merge([pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])], pathlib.Path(sys.argv[3]))
    elif len(sys.argv) == 1:
        with tempfile.TemporaryDirectory() as name:
            merge(example_models(pathlib.Path(name)), pathlib.Path(name, "both"))
    else:
        sys.exit(__doc__)
