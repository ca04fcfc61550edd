#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Fits the weights of src/cairn/placement/probability.cpp and tells how reliable they are.

  benchmarks/fit_placement_model.py FIT.csv TEST.csv [DIAGRAM.svg]

The tables are those of cairn_placement_sessions_benchmark, of parts fit and test. Needs NumPy. A
conditional logit by Newton's method, with a slight penalty on the weights; with and without the lines
of sight, with and without the likeness of descriptors. Each set is judged as if all maps knew just what
it needs; last, as shipped: each candidate by what is known of it. The diagram shows how often poses of a
stated probability were right in the test, as shipped.
"""
import csv
import itertools
import math
import sys

import numpy as np

TOLERANCE = (5.0, 0.05)  # degrees, metres: what counts as the right pose
BEYOND_DOUBT = 0.995     # what the verdict accepts; verdict.cpp has the same
PENALTY = 0.02
MATCHES_MORE = 20.0      # so that a few matches say little
CLOSE_MORE = 3.0
MOST_LEAD = 1.0          # more of it says no more: rooms are alike
NAMES = ["constant", "evidence", "lead", "contradicted"]
BINS = [0.0, 0.01, 0.05, 0.2, 0.5, 0.8, 0.95, 0.99, 0.999, 1.0]


def read_pairs(path):
    """Lists of candidate rows, one a pair of maps."""
    pairs = {}
    with open(path, newline="") as file:
        for row in csv.DictReader(file):
            candidates = pairs.setdefault(row["pair"], [])
            if int(row["rank"]) >= 0:
                candidates.append(row)
    without = sum(not rows for rows in pairs.values())
    if without > 0:
        print(f"{path}: {without} pairs without any candidate are left out")
    return [rows for rows in pairs.values() if rows]


def right_of(rows):
    """Which candidate is right, or -1."""
    right = [i for i, row in enumerate(rows)
             if float(row["rotation_deg"]) <= TOLERANCE[0]
             and float(row["translation_m"]) <= TOLERANCE[1]]
    if len(right) > 1:
        # Candidates are farther apart than that in maps of rooms; the model knows one right pose.
        sys.exit(f"pair {rows[0]['pair']}: more than one candidate is right")
    return right[0] if right else -1


def features(rows, i, with_sight, with_likeness):
    """What probabilities() is linear in, of candidate i, in the order of NAMES; 0 for what has no say."""
    close = [int(row["close_matches"]) for row in rows]
    others = close[:i] + close[i + 1:]
    middle = float(np.median(others)) if others else 0.5 * close[i]
    row = rows[i]
    # As if positions and looks were independent of each other.
    evidence = float(row["spread_evidence"])
    if with_likeness:
        evidence += max(float(row["spread_likeness"]), 0.0)
    line = [1.0, math.sqrt(evidence / (int(row["matches"]) + MATCHES_MORE)),
            min(math.log((close[i] + CLOSE_MORE) / (middle + CLOSE_MORE)), MOST_LEAD), 0.0]
    if with_sight:
        # Where too few lines of sight were looked at: a share that says little.
        share = float(row["contradicted"]) if float(row["contradicted"]) >= 0.0 else 0.05
        line[3] = math.log((share + 0.002) / (1.002 - share))
    return line


def data_of(pairs, with_sight, with_likeness):
    """(features of all candidates, the right one) of each pair."""
    return [(np.array([features(rows, i, with_sight, with_likeness) for i in range(len(rows))]),
             right_of(rows)) for rows in pairs]


def softmax(values):
    """Of values beside 0, which stands for none."""
    values = np.exp(np.append(values, 0.0) - max(values.max(), 0.0))
    return (values / values.sum())[:-1]


def known_of(row):
    """Whether lines of sight and descriptors have a say in a candidate."""
    return float(row["contradicted"]) >= 0.0, float(row["spread_likeness"]) >= 0.0


def fit(data):
    size = data[0][0].shape[1]
    penalty = PENALTY * np.append(1e-6, np.ones(size - 1))
    weights = np.zeros(size)
    for _ in range(200):
        gradient = penalty * weights
        hessian = np.diag(penalty)
        for lines, right in data:
            likely = softmax(lines @ weights)
            mean = lines.T @ likely
            gradient = gradient + mean - (lines[right] if right >= 0 else 0.0)
            hessian = hessian + (lines.T * likely) @ lines - np.outer(mean, mean)
        step = np.linalg.solve(hessian, gradient)
        weights = weights - step * min(1.0, 2.0 / np.linalg.norm(step))
        if np.abs(step).max() < 1e-9:
            break
    return weights


def judge(pairs, values_of):
    """Rows of (probability of the likeliest, is it right, of one place, overlap)."""
    result = []
    for rows in pairs:
        likely = softmax(values_of(rows))
        best = int(np.argmax(likely))
        result.append((likely[best], best == right_of(rows), rows[0]["same"] == "1",
                       float(rows[0]["overlap"])))
    return result


def wilson(successes, trials, z=1.96):
    if trials == 0:
        return 0.0, 1.0
    share = successes / trials
    middle = (share + z * z / (2 * trials)) / (1 + z * z / trials)
    half = z / (1 + z * z / trials) * math.sqrt(share * (1 - share) / trials
                                                + z * z / (4 * trials * trials))
    return max(middle - half, 0.0), min(middle + half, 1.0)


def reliability(judged):
    """Rows of (mean probability, share right, Wilson interval, trials) by bin of probability."""
    rows = []
    for low, high in zip(BINS, BINS[1:]):
        inside = [j for j in judged if low <= j[0] < high or (high == 1.0 and j[0] == 1.0)]
        if not inside:
            continue
        right = sum(j[1] for j in inside)
        rows.append((float(np.mean([j[0] for j in inside])), right / len(inside),
                     wilson(right, len(inside)), len(inside)))
    return rows


def share(successes, trials):
    low, high = wilson(successes, trials)
    return f"{successes} of {trials} ({100 * low:.1f} to {100 * high:.1f} %)"


def report(name, judged):
    print(f"{name}: {len(judged)} pairs, likeliest pose right in {sum(j[1] for j in judged)}")
    for least in (0.5, 0.9, 0.95, 0.99, BEYOND_DOUBT):
        accepted = [j for j in judged if j[0] >= least]
        wrong = [j for j in accepted if not j[1]]
        print(f"  probability {least} and more: {len(accepted) - len(wrong)} right, "
              f"{len(wrong)} wrong, {sum(not j[2] for j in wrong)} of them of different places")
    bins = [("overlap 0.6 and more", 0.6, 1.01), ("0.4 to 0.6", 0.4, 0.6),
            ("0.25 to 0.4", 0.25, 0.4), ("0.1 to 0.25", 0.1, 0.25), ("below 0.1", 0.0, 0.1)]
    groups = [(title, [j for j in judged if j[2] and low <= j[3] < high])
              for title, low, high in bins]
    groups.append(("different places", [j for j in judged if not j[2]]))
    for title, inside in groups:
        accepted = [j for j in inside if j[0] >= BEYOND_DOUBT]
        right = sum(j[1] for j in accepted)
        print(f"  {title}: likeliest right {share(sum(j[1] for j in inside), len(inside))}, "
              f"accepted right {share(right, len(inside))}, wrong {len(accepted) - right}")
    for mean, part, (low, high), trials in reliability(judged):
        print(f"  said {mean:.4f}: right {part:.3f} ({low:.3f} to {high:.3f}) of {trials}")


def diagram(judged, path):
    size, margin = 320, 44
    at = lambda x, y: (margin + size * x, margin + size * (1.0 - y))
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {size + 2 * margin} '
           f'{size + 2 * margin}" font-family="sans-serif" font-size="12">',
           '<rect width="100%" height="100%" fill="#fff"/>',
           f'<rect x="{margin}" y="{margin}" width="{size}" height="{size}" fill="none" '
           'stroke="#999"/>',
           '<line x1="{}" y1="{}" x2="{}" y2="{}" stroke="#999" stroke-dasharray="4"/>'.format(
               *at(0, 0), *at(1, 1))]
    for mean, part, (low, high), trials in reliability(judged):
        x, y = at(mean, part)
        out.append('<line x1="{0:.1f}" y1="{1:.1f}" x2="{0:.1f}" y2="{2:.1f}" stroke="#0072b2"/>'
                   .format(x, at(0, low)[1], at(0, high)[1]))
        out.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="#0072b2"><title>{trials} pairs'
                   '</title></circle>')
    for tick in (0.0, 0.5, 1.0):
        x, y = at(tick, tick)
        out.append(f'<text x="{x:.0f}" y="{margin + size + 16}" text-anchor="middle">{tick}</text>')
        out.append(f'<text x="{margin - 6}" y="{y + 4:.0f}" text-anchor="end">{tick}</text>')
    out.append(f'<text x="{margin + size / 2}" y="{margin + size + 34}" text-anchor="middle">'
               'probability said</text>')
    out.append(f'<text x="14" y="{margin + size / 2}" text-anchor="middle" '
               f'transform="rotate(-90 14 {margin + size / 2})">share right</text></svg>')
    with open(path, "w") as file:
        file.write("\n".join(out) + "\n")


def main():
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    tables = [("fit", read_pairs(sys.argv[1])), ("test", read_pairs(sys.argv[2]))]
    weights = {}
    for known in itertools.product((True, False), repeat=2):
        weights[known] = fit(data_of(tables[0][1], *known))
        print("lines of sight {}, likeness {}:".format(*("yes" if k else "no" for k in known)),
              ", ".join(f"{name} {value:.3f}" for name, value in zip(NAMES, weights[known])))

        def values(rows):
            return np.array([features(rows, i, *known) @ weights[known] for i in range(len(rows))])

        for name, pairs in tables:
            report(name, judge(pairs, values))

    def shipped(rows):
        return np.array([features(rows, i, *known_of(row)) @ weights[known_of(row)]
                         for i, row in enumerate(rows)])

    print("as shipped:")
    for name, pairs in tables:
        judged = judge(pairs, shipped)
        report(name, judged)
        if name == "test" and len(sys.argv) == 4:
            diagram(judged, sys.argv[3])


if __name__ == "__main__":
    main()
