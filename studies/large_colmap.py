#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Writes a COLMAP model of a given size: cameras in a row before a wall of points, each seen by four of them.

Usage: studies/large_colmap.py FOLDER [GIGABYTES]
"""
import pathlib
import struct
import sys

import numpy

SEEN_BY = 4
IMAGES = 2000
POINT = numpy.dtype([("id", "<u8"), ("x", "<f8", 3), ("rgb", "u1", 3), ("error", "<f8"), ("length", "<u8"),
                     ("track", "<u4", (SEEN_BY, 2))])
KEYPOINT = numpy.dtype([("pixel", "<f8", 2), ("point", "<u8")])


def main():
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    folder = pathlib.Path(sys.argv[1])
    folder.mkdir(parents=True)
    size = float(sys.argv[2] if len(sys.argv) == 3 else 1.0) * 1e9
    each = POINT.itemsize + SEEN_BY * KEYPOINT.itemsize
    per_image = int(size / each) * SEEN_BY // IMAGES
    count = per_image * IMAGES // SEEN_BY
    random = numpy.random.default_rng(0)

    # Point i is seen by the four images that follow its own place in the row; images come round.
    first = numpy.arange(count) * IMAGES // count
    images = (first[:, None] + numpy.arange(SEEN_BY)) % IMAGES
    order = numpy.argsort(images, axis=None, kind="stable")
    slot = numpy.empty(count * SEEN_BY, dtype=numpy.uint32)
    per = numpy.bincount(images.ravel(), minlength=IMAGES)
    starts = numpy.concatenate(([0], numpy.cumsum(per)))
    slot[order] = numpy.arange(count * SEEN_BY) - numpy.repeat(starts[:-1], per)

    points = numpy.zeros(count, dtype=POINT)
    points["id"] = numpy.arange(1, count + 1)
    points["x"] = numpy.stack([first * 0.01 + 0.015, random.uniform(-1, 1, count), numpy.full(count, 4.0)], axis=1)
    points["rgb"] = random.integers(0, 256, (count, 3))
    points["error"] = 0.5
    points["length"] = SEEN_BY
    points["track"][:, :, 0] = images + 1
    points["track"][:, :, 1] = slot.reshape(count, SEEN_BY)
    with open(folder / "points3D.bin", "wb") as file:
        file.write(struct.pack("<Q", count))
        points.tofile(file)

    with open(folder / "cameras.bin", "wb") as file:
        file.write(struct.pack("<QIiQQ4d", 1, 1, 1, 4000, 3000, 2000.0, 2000.0, 2000.0, 1500.0))

    with open(folder / "images.bin", "wb") as file:
        file.write(struct.pack("<Q", IMAGES))
        for image in range(IMAGES):
            seen = order[starts[image]:starts[image + 1]] // SEEN_BY
            file.write(struct.pack("<I7dI", image + 1, 1.0, 0.0, 0.0, 0.0, -0.01 * image, 0.0, 0.0, 1))
            file.write(f"{image:06}.jpg".encode() + b"\0")
            keypoints = numpy.zeros(len(seen), dtype=KEYPOINT)
            at = points["x"][seen] - [0.01 * image, 0.0, 0.0]
            keypoints["pixel"] = 2000.0 * at[:, :2] / at[:, 2:] + [2000.0, 1500.0]
            keypoints["point"] = points["id"][seen]
            file.write(struct.pack("<Q", len(seen)))
            keypoints.tofile(file)
    print(f"{count} points, {count * SEEN_BY} observations, {IMAGES} images")


if __name__ == "__main__":
    main()
