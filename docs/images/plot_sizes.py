#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Draws the time of one iteration over the size of the maps as SVG, for docs/performance.md.

    scripts/bench --csv docs/alignment_sizes.csv --benchmark_filter=size --benchmark_repetitions=3
    docs/images/plot_sizes.py docs/alignment_sizes.csv docs/images/alignment_sizes.svg
"""
import csv
import math
import re
import sys

# Library, threads, what it is called, colour (told apart by colour-blind eyes as well), dashes.
LINES = [("cairn", 2, "Cairn, 2 threads", "#0072b2", ""),
         ("cairn", 1, "Cairn", "#0072b2", "6 4"),
         ("nanoflann", 1, "nanoflann, one by one", "#009e73", ""),
         ("open3d", 2, "Open3D, 2 threads", "#cc79a7", ""),
         ("open3d", 1, "Open3D", "#cc79a7", "6 4"),
         ("pcl_native", 1, "PCL, native", "#e69f00", "")]
PANELS = [(1, "base (k = 1)"), (5, "weighted (k = 5)")]
LEFT, TOP, WIDTH, HEIGHT, GAP, RIGHT = 64, 84, 330, 300, 84, 36
INK, GRID = "#1d2125", "#e6e4df"
X_DECADES = (3, 6)  # 1,000 to a million landmarks


def read(path):
    """Milliseconds by library, k, threads and landmarks, of alignments of one iteration."""
    times = {}
    pattern = re.compile(r"size/(\w+)/landmarks:(\d+)/k:(\d+)/most:1/threads:(\d+)")
    with open(path, encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            if found := pattern.match(row["name"]):
                library, landmarks, k, threads = found.groups()
                times.setdefault((library, int(k), int(threads)), {})[int(landmarks)] = float(row["real_ms"])
    return times


def text(x, y, content, size=11.5, anchor="middle", extra=""):
    return f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size}" text-anchor="{anchor}" fill="{INK}"{extra}>{content}</text>'


def line(x1, y1, x2, y2, color, width=1.0, dashes=""):
    dashes = f' stroke-dasharray="{dashes}"' if dashes else ""
    return (f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke="{color}" '
            f'stroke-width="{width}"{dashes}/>')


def duration(decade):
    """Of 10^decade milliseconds."""
    return f"{10 ** decade:g} ms" if decade < 3 else f"{10 ** (decade - 3):g} s"


def main(source, output):
    times = read(source)
    every = [time for series in times.values() for time in series.values()]
    low, high = math.floor(math.log10(min(every))), math.ceil(math.log10(max(every)))

    def y_of(time):
        return TOP + HEIGHT * (high - math.log10(time)) / (high - low)

    title = "One iteration, tree and scores included, over the size of both maps"
    width, height = LEFT + 2 * WIDTH + GAP + RIGHT, TOP + HEIGHT + 50
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
             f'viewBox="0 0 {width} {height}" font-family="\'Source Sans 3\',\'Helvetica Neue\',Arial,'
             '\'Liberation Sans\',sans-serif" role="img">', f"<title>{title}</title>",
             f'<rect width="{width}" height="{height}" fill="#ffffff"/>',
             text(14, 26, title, 15, "start", ' font-weight="600"')]
    x = 14
    for _, _, name, color, dashes in LINES:
        parts += [line(x, 47, x + 22, 47, color, 2.2, dashes), text(x + 28, 51, name, 12, "start")]
        x += 46 + 6.9 * len(name)
    for number, (k, name) in enumerate(PANELS):
        left = LEFT + number * (WIDTH + GAP)

        def x_of(landmarks):
            return left + WIDTH * (math.log10(landmarks) - X_DECADES[0]) / (X_DECADES[1] - X_DECADES[0])

        parts.append(text(left, TOP - 10, name, 13, "start"))
        for decade in range(low, high + 1):
            y = y_of(10.0 ** decade)
            parts += [line(left, y, left + WIDTH, y, GRID), text(left - 6, y + 4, duration(decade), anchor="end")]
        for decade in range(X_DECADES[0], X_DECADES[1] + 1):
            x = x_of(10.0 ** decade)
            parts += [line(x, TOP, x, TOP + HEIGHT, GRID), text(x, TOP + HEIGHT + 17, f"{10 ** decade:,}")]
        parts.append(text(left + WIDTH / 2, TOP + HEIGHT + 38, "landmarks in each map"))
        for library, threads, _, color, dashes in LINES:
            points = sorted(times.get((library, k, threads), {}).items())
            if not points:
                continue
            path = " ".join(f"{x_of(n):.1f},{y_of(time):.1f}" for n, time in points)
            dashes = f' stroke-dasharray="{dashes}"' if dashes else ""
            parts.append(f'<polyline points="{path}" fill="none" stroke="{color}" stroke-width="2.2"{dashes}/>')
            parts += [f'<circle cx="{x_of(n):.1f}" cy="{y_of(time):.1f}" r="3.2" fill="{color}"/>'
                      for n, time in points]
    parts.append("</svg>")
    with open(output, "w", encoding="utf-8") as file:
        file.write("\n".join(parts) + "\n")


if __name__ == "__main__":
    main(*sys.argv[1:3])
