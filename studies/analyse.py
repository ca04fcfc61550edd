#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Analyses the runs of `cairn experiment sweep`: which approaches succeed, which differ, and what the score tells.

The pair of maps is the independent unit, because the starts of one pair tend to succeed or fail together. Intervals of
success and of differences resample pairs (BCa bootstrap). Those of basins, kinds of place and the score are Wilson's for
the effective number of trials: the design effect over pairs, corrected for few pairs by (z / t)² (Korn and Graubard,
Survey Methodology 24, 1998; Franco et al., Journal of Survey Statistics and Methodology 7, 2019). Tests compare the
success rates of pairs: Friedman's, Wilcoxon's signed ranks with Holm's correction, and two one-sided t tests (TOST).
"""
import argparse
import itertools
import json
import pathlib
import sys
import warnings

try:
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    import matplotlib.ticker
    import numpy as np
    import pandas as pd
    import scipy.stats
    from statsmodels.stats.multitest import multipletests
    from statsmodels.stats.proportion import proportion_confint, proportion_effectsize
    from statsmodels.stats.weightstats import DescrStatsW
except ImportError as missing:
    sys.exit(f"analyse.py: {missing}: please install python3-scipy, python3-statsmodels and python3-matplotlib")

PUBLISHED_RATIO = 0.0037 / 0.0034319  # the paper's threshold of the score over that of its good example
RESAMPLES = 100_000
BASIN_BINS = 8
COLUMN_WIDTH = 3.45  # inches, of a paper with two columns
COLORS = ["#7a7a7a", "#1b6ca8", "#c0561b", "#3f8f4f", "#8756a8", "#a88b1b", "#1ba89a", "#a81b5a"]


class Runs:
    """The rows of a runs.csv with what follows from each: its approach, its success and its success by score."""

    def __init__(self, table, options):
        self.options = options
        self.table = table = table.copy()
        k_matters = table.method.isin(["icp", "fast"]) & (table.strategy != "base")
        table["approach"] = [approach_name(m, s) for m, s in zip(table.method, table.strategy)]
        if table.k.nunique() > 1:
            table.loc[k_matters, "approach"] += " k=" + table.k[k_matters].astype(str)
        self.approaches = list(table.approach.unique())
        self.pairs = list(table.pair.unique())
        lowest = table.groupby("pair").score_m2.transform("min")
        table["relative_score"] = table.score_m2 / lowest
        threshold = options.success_score_m2 or PUBLISHED_RATIO * lowest
        table["by_score"] = table.score_m2 < threshold
        table["success"] = ((table.rotation_error_deg <= options.max_rotation_deg) &
                            (table.translation_error_m <= options.max_translation_m))
        # A run without a pose has no error. A pair without any pose is taken to have a truth.
        with_pose = table.tx.notna()
        knows = table.rotation_error_deg.notna() | ~with_pose
        self.pairs_with_truth = [pair for pair, known in knows.groupby(table.pair, sort=False) if known.all()]
        self.judged = table[table.pair.isin(self.pairs_with_truth)]
        self.group_of = {pair: kind_of_place(pair) for pair in self.pairs}
        #: success rates, a row a pair and a column an approach
        self.rates = (self.judged.groupby(["pair", "approach"]).success.mean().unstack()
                      .reindex(index=self.pairs_with_truth, columns=self.approaches))


def approach_name(method, strategy):
    if method == "icp":
        return strategy
    return method if strategy == "base" else f"{method} {strategy}"


def kind_of_place(pair):
    """The name of a pair without a trailing number: desk_101 is a desk."""
    stem, _, number = pair.rpartition("_")
    return stem if stem and number.isdigit() else pair


def clustered_interval(successes, trials, confidence):
    """Wilson's interval for trials in clusters, given as arrays with an entry a cluster; 0 to 1 for one cluster."""
    successes, trials = successes[trials > 0].astype(float), trials[trials > 0].astype(float)
    clusters = len(trials)
    if clusters < 2:
        return 0.0, 1.0
    n = trials.sum()
    p = successes.sum() / n
    variance = clusters / (clusters - 1) * np.square(successes - p * trials).sum() / n**2
    effective = min(n, p * (1 - p) / variance) if variance > 0 else clusters
    z = scipy.stats.norm.ppf(0.5 + confidence / 2)
    effective *= (z / scipy.stats.t.ppf(0.5 + confidence / 2, clusters - 1))**2
    return proportion_confint(p * effective, effective, 1 - confidence, "wilson")


def interval_of(rows, confidence):
    """Of the success rate of some runs, by pair."""
    by_pair = rows.groupby("pair", sort=False).success.agg(["sum", "count"])
    return clustered_interval(by_pair["sum"].to_numpy(), by_pair["count"].to_numpy(), confidence)


def resampled_interval(values, confidence, seed):
    """BCa interval of the mean of one value a pair, or the percentile interval if that does not exist; None for one."""
    values = np.asarray(values)
    if len(values) < 2:
        return None
    for method in ("BCa", "percentile"):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of BCa where all values are equal
            interval = scipy.stats.bootstrap((values,), np.mean, n_resamples=RESAMPLES, confidence_level=confidence,
                                             method=method, random_state=seed, batch=10_000).confidence_interval
        if np.isfinite(interval).all():
            return tuple(interval)
    return None


def signed_rank(differences):
    """Wilcoxon's p-value, exact without ties for up to 50 differences, and the matched-pairs rank-biserial."""
    used = np.round(differences, 12)
    used = used[used != 0]
    if not len(used):
        return 1.0, np.nan
    sizes = np.abs(used)
    exact = len(used) <= 50 and len(np.unique(sizes)) == len(used)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        p = scipy.stats.wilcoxon(used, correction=True, mode="exact" if exact else "approx").pvalue
    ranks = scipy.stats.rankdata(sizes)
    return p, (ranks[used > 0].sum() - ranks[used < 0].sum()) / ranks.sum()


def tost(differences, margin):
    """The p-value of two one-sided t tests that the mean lies within the margin; nan for one difference."""
    if len(differences) < 2:
        return np.nan
    if np.ptp(differences) < 1e-12:
        return 0.0 if abs(differences[0]) < margin else 1.0
    return DescrStatsW(differences).ttost_mean(-margin, margin)[0]


def mcnemar_mid_p(first_only, second_only):
    n, low = first_only + second_only, min(first_only, second_only)
    if n == 0 or first_only == second_only:
        return 1.0
    binomial = scipy.stats.binom(n, 0.5)
    return min(1.0, 2 * binomial.cdf(low) - binomial.pmf(low))


def area_under_roc(rows):
    """The probability that of a right and a wrong pose the right one has the lower score; None without both."""
    right, wrong = rows.score[rows.success], rows.score[~rows.success]
    if not len(right) or not len(wrong):
        return None
    return scipy.stats.mannwhitneyu(wrong, right).statistic / (len(right) * len(wrong))


def offsets_of(rows):
    """Rotation (degrees) and translation of the starts."""
    roll, pitch, yaw = (np.radians(rows[name].to_numpy()) for name in ("roll_deg", "pitch_deg", "yaw_deg"))
    # The real part of the quaternion of Rz(yaw)·Ry(pitch)·Rx(roll).
    real = (np.cos(roll / 2) * np.cos(pitch / 2) * np.cos(yaw / 2) + np.sin(roll / 2) * np.sin(pitch / 2) *
            np.sin(yaw / 2))
    return np.degrees(2 * np.arccos(np.clip(np.abs(real), 0, 1))), np.linalg.norm(rows[["x_m", "y_m", "z_m"]], axis=1)


def radius(offsets, success, edges):
    """The upper edge of the last bin up to which at least 90 % succeed in every bin; nan if there is none."""
    reached = np.nan
    bins = np.clip(np.digitize(offsets, edges) - 1, 0, len(edges) - 2)
    for i, edge in enumerate(edges[1:]):
        inside = success[bins == i]
        if not len(inside) or inside.mean() < 0.9:
            break
        reached = edge
    return reached


# ---------------------------------------------------------------------------------------------------------------------
# Tables; rates are shares


def strategies_table(runs):
    options, rows = runs.options, []
    for approach in runs.approaches:
        own, judged = (t[t.approach == approach] for t in (runs.table, runs.judged))
        rates = runs.rates[approach]
        interval = resampled_interval(rates, options.confidence_level, options.seed)
        # Pairs that are all alike show too little, not certainty.
        if interval is None or interval[0] == interval[1]:
            interval = interval_of(judged, options.confidence_level)
        rotation, translation = offsets_of(judged)
        success = judged.success.to_numpy()
        right = judged[judged.success]
        rows.append({"strategy": approach, "runs": len(own), "success": judged.success.mean(), "low": interval[0],
                     "high": interval[1], "by_score": own.by_score.mean(),
                     "median_iterations": own.iterations.median(),
                     "at_limit": (own.stop_reason == "iteration_limit").mean(),
                     "median_rotation_deg": right.rotation_error_deg.median(),
                     "median_translation_mm": 1e3 * right.translation_error_m.median(),
                     "radius_deg": radius(rotation, success, basin_edges(runs)[0]),
                     "radius_m": radius(translation, success, basin_edges(runs)[1])})
    return pd.DataFrame(rows)


def places_table(runs):
    place = runs.judged.pair.map(runs.group_of).rename("place")
    groups = runs.judged.groupby([place, "approach"], sort=False)
    rows = []
    for (name, approach), rows_of in groups:
        low, high = interval_of(rows_of, runs.options.confidence_level)
        rows.append({"place": name, "strategy": approach, "runs": len(rows_of), "success": rows_of.success.mean(),
                     "low": low, "high": high})
    return pd.DataFrame(rows)


def comparisons_table(runs):
    """Of each two approaches, first and second; differences are second - first."""
    options, rows = runs.options, []
    keys = ["pair", "number"]
    success = {a: runs.judged[runs.judged.approach == a].set_index(keys).success for a in runs.approaches}
    for first, second in itertools.combinations(runs.approaches, 2):
        differences = (runs.rates[second] - runs.rates[first]).to_numpy()
        interval = resampled_interval(differences, options.confidence_level, options.seed) or (np.nan, np.nan)
        p, rank_biserial = signed_rank(differences)
        a, b = success[first], success[second].reindex(success[first].index)
        first_only, second_only = int((a & ~b).sum()), int((b & ~a).sum())
        rows.append({"first": first, "second": second, "first_success": a.mean(), "second_success": b.mean(),
                     "difference": differences.mean(), "low": interval[0], "high": interval[1],
                     "cohens_h": proportion_effectsize(b.mean(), a.mean()), "rank_biserial": rank_biserial,
                     "p_by_pairs": p, "first_only": first_only, "second_only": second_only,
                     "mcnemar_p": mcnemar_mid_p(first_only, second_only),
                     "tost_p": tost(differences, options.equivalence_margin)})
    table = pd.DataFrame(rows)
    if len(table):
        table.insert(10, "p_adjusted", multipletests(table.p_by_pairs, method="holm")[1])
    return table


def basin_edges(runs):
    ends = [values.max() or 1.0 for values in offsets_of(runs.table)]
    return [np.linspace(0, end, BASIN_BINS + 1) for end in ends]


def basins_table(runs):
    edges = basin_edges(runs)
    judged = runs.judged.copy()
    judged["row"], judged["column"] = (np.clip(np.digitize(values, e) - 1, 0, BASIN_BINS - 1)
                                       for values, e in zip(offsets_of(judged), edges))
    rows = []
    for (approach, row, column), cell in judged.groupby(["approach", "row", "column"], sort=False):
        low, high = interval_of(cell, runs.options.confidence_level)
        rows.append({"strategy": approach, "rotation_from_deg": edges[0][row], "rotation_to_deg": edges[0][row + 1],
                     "translation_from_m": edges[1][column], "translation_to_m": edges[1][column + 1],
                     "runs": len(cell), "success": cell.success.mean(), "low": low, "high": high})
    table = pd.DataFrame(rows)
    order = table.strategy.map({a: i for i, a in enumerate(runs.approaches)})
    return table.assign(order=order).sort_values(["order", "rotation_from_deg", "translation_from_m"]).drop(
        columns="order")


def score_table(runs):
    """Whether a lower score is a better pose, of the runs that found one."""
    confidence = runs.options.confidence_level
    found = runs.judged[runs.judged.score_m2.notna() & runs.judged.tx.notna()]
    by_pair = [rows.assign(score=rows.score_m2) for _, rows in found.groupby("pair", sort=False)]
    areas = [area for area in map(area_under_roc, by_pair) if area is not None]
    wrong_lowest = np.array([not rows.loc[rows.score.idxmin(), "success"] for rows in by_pair])
    rows = []

    def add(what, value, low=np.nan, high=np.nan):
        rows.append({"what": what, "value": value, "low": low, "high": high})

    def add_share(what, chosen, passes):
        counts = passes[chosen].groupby(found.pair[chosen], sort=False).agg(["sum", "count"])
        if len(counts):
            add(what, passes[chosen].mean(), *clustered_interval(counts["sum"].to_numpy(), counts["count"].to_numpy(),
                                                                 confidence))

    add("pairs with right and wrong poses", len(areas))
    if areas:
        add("median AUC within a pair", np.median(areas))
        add("lowest AUC within a pair", min(areas))
    pooled = area_under_roc(found.assign(score=found.relative_score))
    if pooled is not None:
        add("AUC of all runs, scores relative to the pair's lowest", pooled)
        hits, alarms, thresholds = roc_curve(found.relative_score, found.success)
        add("best threshold, times the pair's lowest score", thresholds[np.argmax(hits - alarms)])
    add_share("wrong poses that pass by the score", ~found.success, found.by_score)
    add_share("right poses that fail by the score", found.success, ~found.by_score)
    if len(wrong_lowest):
        add("pairs whose lowest score is of a wrong pose", wrong_lowest.mean(),
            *proportion_confint(wrong_lowest.sum(), len(wrong_lowest), 1 - confidence, "wilson"))
    return pd.DataFrame(rows)


def roc_curve(scores, success):
    """Shares of right and wrong poses with at most each score, and the scores."""
    thresholds = np.unique(scores)
    right, wrong = np.sort(scores[success]), np.sort(scores[~success])
    return (np.searchsorted(right, thresholds, "right") / max(len(right), 1),
            np.searchsorted(wrong, thresholds, "right") / max(len(wrong), 1), thresholds)


# ---------------------------------------------------------------------------------------------------------------------
# Sentences


def p_text(p):
    return "p < 0.001" if p < 0.001 else f"p = {p:.3f}"


def points(share):
    text = f"{100 * share:+.1f}"
    return "0.0" if text in ("-0.0", "+0.0") else text


def answers(runs, tables):
    options = runs.options
    sentences = [f"{len(runs.pairs)} {'pair' if len(runs.pairs) == 1 else 'pairs'} of maps "
                 f"({len(runs.pairs_with_truth)} with a known truth); a success is within "
                 f"{options.max_rotation_deg:g} degrees and {options.max_translation_m:g} m of the true pose."]
    if not runs.pairs_with_truth:
        return sentences + ["Without a truth only the score can tell success from failure, and it may be wrong."]
    for row in tables["strategies"].itertuples():
        sentences.append(f"{row.strategy}: {100 * row.success:.1f} % ({100 * row.low:.1f} to {100 * row.high:.1f}).")
    if len(runs.approaches) > 2 and len(runs.rates) > 1:
        statistic, p = scipy.stats.friedmanchisquare(*(runs.rates[a].round(12) for a in runs.approaches))
        sentences.append("Do strategies differ at all? Friedman's test over the pairs' success rates: chi-squared "
                         f"{statistic:.1f}, {p_text(p)}.")
    for row in tables["comparisons"].itertuples():
        sentence = (f"{row.second} against {row.first}: {100 * row.second_success:.1f} % of the starts succeed instead of "
                    f"{100 * row.first_success:.1f} %, {points(row.difference)} points")
        if np.isnan(row.tost_p):  # one pair
            sentences.append(f"{sentence}. One pair of maps allows no interval and no test.")
            continue
        sentences.append(
            f"{sentence} ({100 * options.confidence_level:g} % interval over pairs {points(row.low)} to "
            f"{points(row.high)}; Wilcoxon by pairs, Holm: {p_text(row.p_adjusted)}); "
            f"{'equivalent' if row.tost_p < 0.05 else 'not shown equivalent'} within "
            f"{100 * options.equivalence_margin:g} points (TOST {p_text(row.tost_p)}).")
    score = tables["score"].set_index("what").value
    if "median AUC within a pair" in score:
        share = score["pairs whose lowest score is of a wrong pose"]
        sentences.append(
            "The score as a judge: within a pair a right pose has a lower score than a wrong one with probability "
            f"{score['median AUC within a pair']:.2f} (median of {score['pairs with right and wrong poses']:.0f} pairs, "
            f"lowest {score['lowest AUC within a pair']:.2f}); in {100 * share:.0f} % of the pairs the lowest score of "
            "all belongs to a wrong pose.")
    return sentences


# ---------------------------------------------------------------------------------------------------------------------
# Figures


def color_of(runs, approach):
    return COLORS[runs.approaches.index(approach) % len(COLORS)]


def violins(runs, column, label, threshold=None):
    """As in the paper: density, quartiles, median (solid), mean (dashed) and single runs, on a logarithmic axis."""
    positive = runs.table[runs.table[column] > 0]
    shown = [(a, positive[column][positive.approach == a].to_numpy()) for a in runs.approaches]
    shown = [(a, values) for a, values in shown if len(values)]
    if not shown:
        return None
    figure, axes = plt.subplots(figsize=(COLUMN_WIDTH * max(1, len(shown) / 4), 2.6), layout="constrained")
    rng = np.random.default_rng(0)
    for place, (approach, values) in enumerate(shown):
        color, logs = color_of(runs, approach), np.log10(values)
        if np.ptp(logs) > 0:
            for body in axes.violinplot(logs, [place], widths=0.8, showextrema=False)["bodies"]:
                body.set(facecolor=color, alpha=0.35)
        axes.boxplot(logs, positions=[place], widths=0.12, showfliers=False, medianprops={"color": "black"})
        axes.hlines(np.log10(values.mean()), place - 0.2, place + 0.2, color="black", ls="--", lw=1)
        some = logs if len(logs) <= 500 else rng.choice(logs, 500, replace=False)
        axes.plot(place + rng.uniform(-0.15, 0.15, len(some)), some, ".", ms=2 if len(some) > 100 else 4, color=color,
                  rasterized=True)
    axes.set_xticks(range(len(shown)), [a for a, _ in shown], rotation=20)
    if threshold and threshold > 0:
        axes.axhline(np.log10(threshold), color="#a3450a", ls="--", lw=1)
    low, high = axes.get_ylim()
    steps = [1] if high - low > 2.5 else [1, 2, 5]
    ticks = [np.log10(step) + decade for decade in range(int(low) - 1, int(high) + 1) for step in steps]
    if high - low < 0.8:  # too narrow for such steps
        ticks = np.log10(matplotlib.ticker.MaxNLocator(5).tick_values(10**low, 10**high).clip(min=1e-300))
    axes.set_yticks([t for t in ticks if low <= t <= high])
    axes.yaxis.set_major_formatter(lambda y, _: f"{10**y:.3g}")
    axes.set_ylabel(label)
    return figure


def intervals(items, label, colors):
    """Dots with intervals: items are (name, value, low, high), shares."""
    figure, axes = plt.subplots(figsize=(6, 0.8 + 0.28 * len(items)))
    for row, ((name, value, low, high), color) in enumerate(zip(items, colors)):
        axes.plot([100 * low, 100 * high], [-row, -row], color=color)
        axes.plot(100 * value, -row, "o", color=color, ms=5)
    axes.set_yticks([-row for row in range(len(items))], [item[0] for item in items])
    axes.set_xlabel(label)
    axes.grid(axis="x", color="#e6e4df")
    return figure


def basins_figure(runs, basins):
    figure, panels = plt.subplots(1, len(runs.approaches), figsize=(2.4 * len(runs.approaches) + 0.8, 2.6),
                                  sharex=True, sharey=True, squeeze=False)
    rotation, translation = basin_edges(runs)
    for axes, approach in zip(panels[0], runs.approaches):
        own = basins[basins.strategy == approach]
        grid = np.full((BASIN_BINS, BASIN_BINS), np.nan)
        rows, columns = (np.searchsorted(e, own[c]) for e, c in ((rotation, "rotation_from_deg"),
                                                                 (translation, "translation_from_m")))
        grid[rows, columns] = 100 * own.success
        image = axes.pcolormesh(translation, rotation, grid, vmin=0, vmax=100, cmap="viridis")
        axes.set_title(approach, fontsize=10)
        axes.set_xlabel("translation of the start (m)", fontsize=8)
    panels[0][0].set_ylabel("rotation of the start (deg)", fontsize=8)
    figure.colorbar(image, ax=panels[0], label="success (%)")
    return figure


def score_figure(runs):
    figure, axes = plt.subplots(figsize=(6.4, 4))
    found = runs.judged[runs.judged.score_m2.notna() & runs.judged.tx.notna()].sample(frac=1, random_state=0)
    for approach in runs.approaches:
        own = found[found.approach == approach]
        axes.loglog(own.translation_error_m.clip(lower=1e-6), own.relative_score, ".", ms=2, alpha=0.4,
                    color=color_of(runs, approach), label=approach, rasterized=True)
    axes.axvline(runs.options.max_translation_m, color="#a3450a", ls="--", lw=1)
    axes.set(xlabel="translation error (m)", ylabel="score, times the pair's lowest")
    axes.legend(markerscale=4, fontsize=8)
    return figure


def roc_figure(runs):
    figure, axes = plt.subplots(figsize=(4, 4))
    found = runs.judged[runs.judged.score_m2.notna() & runs.judged.tx.notna()]
    for approach in runs.approaches:
        own = found[found.approach == approach]
        if own.success.nunique() == 2:
            hits, alarms, _ = roc_curve(own.relative_score, own.success)
            axes.plot(np.append(0, alarms), np.append(0, hits), color=color_of(runs, approach), label=approach)
    axes.plot([0, 1], [0, 1], ":", color="#7a7a7a")
    axes.set(xlabel="wrong poses that pass", ylabel="right poses that pass")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=8)
    return figure


def figures(runs, tables):
    yield "scores", violins(runs, "relative_score", "score, times the pair's lowest")
    if not runs.pairs_with_truth:
        return
    yield "translation_errors", violins(runs, "translation_error_m", "translation error (m)",
                                        runs.options.max_translation_m)
    rows = tables["strategies"]
    yield "success", intervals(list(rows[["strategy", "success", "low", "high"]].itertuples(index=False)),
                               "success by the true pose (%)", [color_of(runs, a) for a in rows.strategy])
    rows = tables["comparisons"]
    if len(rows):
        names = rows.second + " − " + rows["first"]
        yield "differences", intervals(list(zip(names, rows.difference, rows.low, rows.high)),
                                       "difference of success (points)", ["#1b6ca8"] * len(rows))
    yield "basins", basins_figure(runs, tables["basins"])
    yield "score_against_error", score_figure(runs)
    yield "roc", roc_figure(runs)


def save(figure, folder, name):
    if figure is None:
        return
    (folder / "figures").mkdir(parents=True, exist_ok=True)
    for kind in ("pdf", "svg"):
        figure.savefig(folder / "figures" / f"{name}.{kind}", bbox_inches="tight", pad_inches=0.02, dpi=150,
                       metadata={"Date" if kind == "svg" else "CreationDate": None})
    plt.close(figure)


# ---------------------------------------------------------------------------------------------------------------------


def analyse(table, options):
    """All tables of one experiment by name, and the answers."""
    runs = Runs(table, options)
    if not runs.pairs_with_truth:
        return runs, {}, answers(runs, {})
    tables = {"strategies": strategies_table(runs), "places": places_table(runs),
              "comparisons": comparisons_table(runs), "basins": basins_table(runs),
              "pairs": runs.rates.reset_index(), "score": score_table(runs)}
    return runs, tables, answers(runs, tables)


def read_options(results, given):
    """What the command line gives; else what experiment.json beside the runs says; else the defaults of a study."""
    document = results.with_name("experiment.json")
    saved = json.loads(document.read_text()) if document.exists() else {}
    defaults = {"max_rotation_deg": 5.0, "max_translation_m": 0.05, "success_score_m2": None, "confidence_level": 0.95,
                "equivalence_margin": 0.05, "seed": saved.get("seed") or 0}
    for name, default in defaults.items():
        if getattr(given, name) is None:
            setattr(given, name, saved.get("options", {}).get(name, default))
    return given


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0], epilog="Example: studies/analyse.py results")
    parser.add_argument("results", type=pathlib.Path, help="folder of `cairn experiment`, or a runs.csv")
    parser.add_argument("-o", "--output", type=pathlib.Path, help="folder (default: analysis beside the runs)")
    parser.add_argument("--max-rotation-deg", type=float, help="largest rotation error of a success (5)")
    parser.add_argument("--max-translation-m", type=float, help="largest translation error of a success (0.05)")
    parser.add_argument("--success-score-m2", type=float,
                        help="largest score of a success by score (1.078 times the pair's lowest)")
    parser.add_argument("--confidence-level", type=float, help="of intervals (0.95)")
    parser.add_argument("--equivalence-margin", type=float, help="of success rates, for TOST (0.05)")
    parser.add_argument("--seed", type=int, help="of the resampling (the study's)")
    options = parser.parse_args()
    path = options.results / "runs.csv" if options.results.is_dir() else options.results
    if not path.exists():
        sys.exit(f"analyse.py: {path} does not exist")
    table = pd.read_csv(path, float_precision="round_trip")
    read_options(path, options)
    output = options.output or path.parent / "analysis"
    matplotlib.rcParams.update({"svg.hashsalt": "cairn", "svg.fonttype": "none", "font.size": 9})
    experiments = table.experiment.unique()
    if len(experiments) > 1:  # the paper's: one pair of maps, a figure an experiment, but for k, which is a table
        experiments = [name for name, rows in table.groupby("experiment", sort=False) if rows.k.nunique() == 1]
        for name in experiments:
            runs = Runs(table[table.experiment == name], options)
            save(violins(runs, "score_m2", "score (m²)", options.success_score_m2), output, f"scores_{name}")
        print(f"{output}: figures of {len(experiments)} experiments")
        return
    runs, tables, sentences = analyse(table, options)
    (output / "tables").mkdir(parents=True, exist_ok=True)
    for name, content in tables.items():
        content.to_csv(output / "tables" / f"{name}.csv", index=False, float_format="%.15g")
    for name, figure in figures(runs, tables):
        save(figure, output, name)
    (output / "summary.md").write_text(f"# {experiments[0]}\n\n" + "".join(f"- {s}\n" for s in sentences))
    print("\n".join(sentences))


if __name__ == "__main__":
    main()
