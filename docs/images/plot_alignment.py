#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Draws two maps before and after alignment as SVG, for the README.

    cairn demo --save desk
    cairn align desk/source.map desk/target.map --initial-matrix desk/initial.txt \
        --method icp --confidence observations --json desk/result.json
    docs/images/plot_alignment.py desk docs/images/alignment.svg
"""
import json
import math
import sys

TARGET, SOURCE = "#0b3c5d", "#e07a1f"  # told apart by colour-blind eyes as well
PANEL, GAP, HEIGHT = 460, 24, 400


def positions(path):
    with open(path, encoding="utf-8") as lines:
        for line in lines:
            fields = line.split()
            if fields and fields[0] == "LANDMARK":
                yield [float(x) for x in fields[2:5]]


def moved(points, m):
    return [[sum(m[r][c] * p[c] for c in range(3)) + m[r][3] for r in range(3)] for p in points]


def seen(point, azimuth=math.radians(-28), tilt=math.radians(58)):
    """The point from above and one side, x to the right and y up."""
    x, y, z = point
    x, y = x * math.cos(azimuth) - y * math.sin(azimuth), x * math.sin(azimuth) + y * math.cos(azimuth)
    return x, y * math.cos(tilt) + z * math.sin(tilt)


def main(folder, output):
    source = list(positions(f"{folder}/source.map"))
    target = list(positions(f"{folder}/target.map"))
    initial = [[float(x) for x in row.split()] for row in open(f"{folder}/initial.txt", encoding="utf-8")]
    result = json.load(open(f"{folder}/result.json", encoding="utf-8"))["results"][0]
    final = result["target_from_source"]
    clouds = [[seen(p) for p in cloud] for cloud in (target, moved(source, initial), moved(source, final))]
    desk = sorted(x for x, _ in clouds[0]), sorted(y for _, y in clouds[0])
    trim = len(desk[0]) // 40  # a few strays must not shrink the picture
    x0, x1, y0, y1 = desk[0][trim], desk[0][-trim - 1], desk[1][trim], desk[1][-trim - 1]
    scale = 0.8 * min(PANEL / (x1 - x0), (HEIGHT - 40) / (y1 - y0))

    def panel(left, cloud, title):
        def dots(points, color):
            path = []
            for x, y in points:
                u = PANEL / 2 + scale * (x - (x0 + x1) / 2)
                v = 40 + (HEIGHT - 40) / 2 - scale * (y - (y0 + y1) / 2)
                if 0 < u < PANEL and 40 < v < HEIGHT:
                    path.append(f"M{u:.1f} {v:.1f}h0")
            return (f'<path d="{"".join(path)}" stroke="{color}" stroke-width="2.2" '
                    'stroke-linecap="round" stroke-opacity="0.62"/>')
        return (f'<g transform="translate({left} 0)"><rect width="{PANEL}" height="{HEIGHT}" rx="10" '
                f'fill="#ffffff" stroke="#d6dbe0"/><text x="16" y="27" font-size="15" fill="#20262c">'
                f'{title}</text>{dots(clouds[0], TARGET)}{dots(cloud, SOURCE)}</g>')

    width = 2 * PANEL + GAP
    with open(output, "w", encoding="utf-8") as svg:
        svg.write(f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="-1 -1 {width + 2} {HEIGHT + 2}" '
                  'font-family="system-ui, sans-serif">')
        svg.write(panel(0, clouds[1], f'before: score {result["initial_score"]:.4f} m²'))
        svg.write(panel(PANEL + GAP, clouds[2], f'after {result["iterations"]} iterations: '
                                                f'score {result["score"]:.4f} m²'))
        svg.write("</svg>\n")


if __name__ == "__main__":
    main(*sys.argv[1:3])
