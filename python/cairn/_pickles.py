# SPDX-License-Identifier: BSD-3-Clause
"""Functions that pickles name to restore objects, because functions of the extension cannot be pickled."""

from . import _cairn


def restored_map(state):
    return _cairn._restored_map(state)


def restored_alignment(state):
    return _cairn._restored_alignment(state)


def restored_camera(state):
    return _cairn._restored_camera(state)


def restored_trajectory(state):
    return _cairn._restored_trajectory(state)
