# SPDX-License-Identifier: BSD-3-Clause
"""Aligns landmark maps of visual SLAM and judges whether the pose can be trusted.

    import cairn
    source, target = cairn.read_map("source.map"), cairn.read_map("target.map")
    result = cairn.align(source, target)
    print(result.verdict, result.probability, result.target_from_source)

Poses are 4x4 NumPy arrays that include the scale: x_in_target = target_from_source @ x_in_source.
Lengths are in metres, or in the map's own unit if its scale is unknown; angles are in radians.
"""

from . import _cairn
from ._cairn import *  # noqa: F401,F403
from ._cairn import __version__
from ._errors import CancelledError, Error, InputError, MisuseError, StorageError
from ._tables import to_pandas as _to_pandas

LandmarkMap.to_pandas = _to_pandas  # noqa: F405

# Optional names and the libraries that they need.
_OPTIONAL = {
    "Atlas": "Ceres and SQLite",
    "merge": "Ceres",
    "simulate": "Embree and OpenCV",
    "ImageLocator": "Ceres and OpenCV",
    "Odometry": "Ceres and OpenCV",
    "map_sequence": "Ceres and OpenCV",
    "with_frames": "Ceres and OpenCV",
    "with_image_descriptors": "Ceres and OpenCV",
}


def __getattr__(name):
    missing = f"; this build is without {_OPTIONAL[name]}" if name in _OPTIONAL else ""
    raise AttributeError(f"module 'cairn' has no attribute '{name}'{missing}")


__all__ = sorted(
    [name for name in vars(_cairn) if not name.startswith("_")]
    + ["CancelledError", "Error", "InputError", "MisuseError", "StorageError"]
)
