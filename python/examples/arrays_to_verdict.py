# SPDX-License-Identifier: BSD-3-Clause
"""From NumPy arrays to a verdict: what a SLAM system holds of its landmarks is enough."""

import numpy as np

import cairn

# Stands in for your own arrays: 1500 points on the walls of a room, and what a second session has of them.
random = np.random.default_rng(1)
walls = random.uniform([0, 0, 0], [4, 3, 2.5], size=(1500, 3))
walls[np.arange(1500), random.integers(0, 3, 1500)] = 0.0
turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
later = walls[300:] @ turn.T + [2.0, 0.5, 0.1] + random.normal(scale=0.005, size=(1200, 3))

source = cairn.LandmarkMap.from_arrays(later)
target = cairn.LandmarkMap.from_arrays(walls)
result = cairn.align(source, target)
print(result.verdict, result.probability)
print(result.reason)
print(result.target_from_source)
