#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Fits the weights of src/cairn/alignment/detail/evidence/verdict.cpp and reports how reliable they are.

  studies/fit_placement_model.py FIT.csv[,REAL.csv] CHOOSE.csv [TEST.csv [DIAGRAM.svg]]

The tables are those of cairn_placement_sessions_benchmark, of parts fit, choose and test, with the
variants descriptors and searched, or undescribed and bare, or all four (TEST may have the variant shipped alone);
REAL.csv is that of studies/mini_map_pairs.py. Needs NumPy. A conditional logit by Newton's method, with and without descriptors,
with and without lines of sight. What departs from PRIOR, the weights of an earlier fit to other places, is penalised. CHOOSE is where the penalty
and the threshold of the verdict are chosen; TEST is only reported. The diagram shows how often poses of a
stated probability were right in the test.
"""
import collections
import csv
import math
import sys

import numpy as np

TOLERANCE = (5.0, 0.05)  # degrees, metres: what counts as the right pose
BEYOND_DOUBT = 0.99      # what the verdict accepts; verdict.cpp has the same
# Fitted to 474 pairs of places of one layout, by described and with lines of sight; without a weight of the lead where
# it is defined differently today.
PRIOR = {(True, True): [-12.293, 12.076, 0.740, 0.0, -0.786, 0.0],
         (True, False): [-9.095, 11.304, 0.775, 0.0, 0.0, 0.0],
         (False, True): [-10.824, 5.706, 1.267, 0.0, -0.829, 0.0],
         (False, False): [-8.095, 6.358, 1.281, 0.0, 0.0, 0.0]}
PENALTIES = [0.1, 0.3, 1.0, 3.0]  # of which the likeliest of CHOOSE is taken
MATCHES_MORE = 20.0      # so that a few matches say little
CLOSE_MORE = 3.0
MOST_INDEPENDENT = 160.0  # fine matches of two poses
FINE = "within_2"        # matches within a quarter of the radius
LEAST_EXPECTED = 0.25    # as in descriptor_agreement.cpp
NAMES = ["constant", "evidence", "proximity", "lead", "contradicted", "agreement"]
BINS = [0.0, 0.01, 0.05, 0.2, 0.5, 0.8, 0.95, 0.99, 0.999, 1.0]


def read_pairs(paths):
    """Variants, each with a list of pairs; a pair is a list of candidate rows, empty if there is none."""
    variants = collections.defaultdict(dict)
    for path in paths.split(","):
        with open(path, newline="") as file:
            for row in csv.DictReader(file):
                for key, value in row.items():
                    if key not in ("variant", "source", "target", "verdict"):
                        row[key] = float(value)
                variants[row["variant"]].setdefault((path, row["pair"]), []).append(row)
    return {name: list(pairs.values()) for name, pairs in variants.items()}


def candidates_of(rows):
    return [row for row in rows if row["rank"] >= 0]


def is_right(row):
    return (row["rank"] >= 0 and row["rotation_deg"] <= TOLERANCE[0]
            and row["translation_m"] <= TOLERANCE[1])


def right_of(rows):
    """Which candidate is right, or -1."""
    right = [i for i, row in enumerate(rows) if is_right(row)]
    # Candidates are farther apart than the tolerance in maps of rooms; the model knows one right pose.
    return right[0] if right else -1


def agreement_evidence(row):
    mean = max(row["expected_agreeing"], LEAST_EXPECTED)
    count = row["spread_agreeing"]
    return count * math.log(count / mean) - (count - mean) if count > mean else 0.0


def evidence_of_difference(count, other):
    """That two counts have different means: about the log-likelihood ratio; negative if the first is smaller."""
    share = min(1.0, MOST_INDEPENDENT / max(count + other, 1.0))
    more = share * (count - other)
    return more * abs(more) / (2.0 * (share * (count + other) + CLOSE_MORE))


def features(rows, i, described, seen):
    """What probabilities() is linear in, of candidate i, in the order of NAMES; 0 for what is unknown."""
    row = rows[i]
    leading = "spread_agreeing" if described else FINE
    others = [other[leading] for j, other in enumerate(rows) if j != i]
    best_other = max(others) if others else 0.5 * row[leading]
    evidence = row["spread_evidence"] + row["spread_proximity"]
    if described:
        evidence += max(row["spread_likeness"], 0.0) + agreement_evidence(row)
    lead = (math.log((row[leading] + CLOSE_MORE) / (best_other + CLOSE_MORE)) if described
            else evidence_of_difference(row[leading], best_other))
    line = [1.0, math.sqrt(evidence / (row["within_0"] + MATCHES_MORE)),
            math.log1p(row["spread_proximity"]), lead, 0.0,
            math.log1p(agreement_evidence(row)) if described else 0.0]
    if seen:
        # Where too few lines of sight were looked at: a share that says little.
        share = row["contradicted"] if row["contradicted"] >= 0.0 else 0.05
        line[4] = math.log((share + 0.002) / (1.002 - share))
    return line


def softmax(values):
    """Of values beside 0, which stands for none."""
    values = np.exp(np.append(values, 0.0) - max(values.max(), 0.0))
    return (values / values.sum())[:-1]


def lines_of(pairs, described, seen):
    """Of each pair the features of its candidates, and which is right."""
    return [(np.array([features(rows, i, described, seen) for i in range(len(rows))]), right_of(rows))
            for rows in map(candidates_of, pairs) if rows]


def likelihood(pairs, weights, described, seen):
    result = 0.0
    for lines, right in lines_of(pairs, described, seen):
        likely = softmax(lines @ weights)
        result += math.log(max(likely[right] if right >= 0 else 1.0 - likely.sum(), 1e-12))
    return result


def fit(pairs, described, seen, penalty):
    prior = np.array(PRIOR[described, seen])
    data = lines_of(pairs, described, seen)
    weights = prior
    for _ in range(200):
        gradient = penalty * (weights - prior)
        hessian = penalty * np.eye(len(NAMES))
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


def judge(pairs, weights, described):
    """Rows of (probability of the likeliest, is it right, first row), by the weights."""
    result = []
    for pair in pairs:
        rows = candidates_of(pair)
        if not rows:
            result.append((0.0, False, pair[0]))
            continue
        values = [float(np.dot(features(rows, i, described, rows[i]["contradicted"] >= 0.0),
                               weights[described, rows[i]["contradicted"] >= 0.0]))
                  for i in range(len(rows))]
        likely = softmax(np.array(values))
        best = int(np.argmax(likely))
        result.append((float(likely[best]), best == right_of(rows), pair[0]))
    return result


def judge_as_stated(pairs):
    """The same, by the probabilities and the order that are in the table."""
    return [(pair[0]["probability"], is_right(pair[0]), pair[0]) for pair in pairs]


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


def kind_of(name):
    return name.split("-")[0]


def report(name, judged, accepted=lambda j: j[0] >= BEYOND_DOUBT):
    print(f"{name}: {len(judged)} pairs, likeliest pose right in {sum(j[1] for j in judged)}")
    wrong = sorted((j for j in judged if not j[1]), key=lambda j: -j[0])[:5]
    print("  likeliest wrong poses:", ", ".join(
        f"{j[0]:.3f} ({j[2]['source']} to {j[2]['target']})" for j in wrong))
    for least in (0.9, 0.95, 0.98, 0.99, 0.995, 0.999):
        inside = [j for j in judged if j[0] >= least]
        print(f"  probability {least} and more: {sum(j[1] for j in inside)} right, "
              f"{sum(not j[1] for j in inside)} wrong")
    bins = [("overlap 0.6 and more", 0.6, 1.01), ("0.4 to 0.6", 0.4, 0.6),
            ("0.25 to 0.4", 0.25, 0.4), ("0.1 to 0.25", 0.1, 0.25), ("below 0.1", 0.0, 0.1)]
    groups = [(title, [j for j in judged if j[2]["same"] and low <= j[2]["overlap"] < high])
              for title, low, high in bins]
    strangers = [j for j in judged if not j[2]["same"]]
    groups.append(("places of one kind", [j for j in strangers
                                          if kind_of(j[2]["source"]) == kind_of(j[2]["target"])]))
    groups.append(("places of two kinds", [j for j in strangers
                                           if kind_of(j[2]["source"]) != kind_of(j[2]["target"])]))
    for title, inside in groups:
        inside_accepted = [j for j in inside if accepted(j)]
        right = sum(j[1] for j in inside_accepted)
        known = [j[2]["mahalanobis"] for j in inside_accepted if j[1] and j[2]["mahalanobis"] >= 0.0]
        held = f", in the ellipsoid {share(sum(m < 12.592 for m in known), len(known))}" if known else ""
        print(f"  {title}: likeliest right {share(sum(j[1] for j in inside), len(inside))}, "
              f"accepted right {share(right, len(inside))}, wrong {len(inside_accepted) - right}{held}")
    times = [j[2]["wall_s"] for j in judged]
    print(f"  median time {np.median(times):.3f} s, of accepted ones "
          f"{np.median([j[2]['wall_s'] for j in judged if accepted(j)] or [0.0]):.3f} s")
    for mean, part, (low, high), trials in reliability(judged):
        print(f"  stated {mean:.4f}: right {part:.3f} ({low:.3f} to {high:.3f}) of {trials}")


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
               'stated probability</text>')
    out.append(f'<text x="14" y="{margin + size / 2}" text-anchor="middle" '
               f'transform="rotate(-90 14 {margin + size / 2})">share right</text></svg>')
    with open(path, "w") as file:
        file.write("\n".join(out) + "\n")


def main():
    if len(sys.argv) not in (3, 4, 5):
        sys.exit(__doc__)
    fitted, chosen = read_pairs(sys.argv[1]), read_pairs(sys.argv[2])
    weights = {}
    for described in (True, False):
        for seen in (True, False):
            name = "searched" if described else "undescribed" if seen else "bare"
            if name not in fitted:
                continue
            by_penalty = {penalty: fit(fitted[name], described, seen, penalty) for penalty in PENALTIES}
            best = max(PENALTIES,
                       key=lambda k: likelihood(chosen[name], by_penalty[k], described, seen))
            weights[described, seen] = by_penalty[best]
            print("descriptors {}, lines of sight {}, penalty {}:".format(
                *("yes" if k else "no" for k in (described, seen)), best),
                  ", ".join(f"{name} {value:.3f}"
                            for name, value in zip(NAMES, weights[described, seen])))
    for name, described in (("searched", True), ("descriptors", True), ("undescribed", False),
                            ("bare", False)):
        for part, pairs in (("fit", fitted), ("choose", chosen)):
            if name not in pairs:
                continue
            report(f"{part}, {name}", judge(pairs[name], weights, described))
    if len(sys.argv) > 3:
        for name, pairs in read_pairs(sys.argv[3]).items():
            judged = judge_as_stated(pairs)
            report(f"test, {name}", judged, lambda j: j[2]["verdict"] == "aligned")
            if len(sys.argv) == 5:
                diagram(judged, sys.argv[4])


if __name__ == "__main__":
    main()
