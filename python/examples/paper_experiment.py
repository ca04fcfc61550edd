# SPDX-License-Identifier: BSD-3-Clause
"""The paper's experiment on two maps, and its plot: scores by strategy, one violin each.

    python3 paper_experiment.py SOURCE TARGET PLOT.png

Without arguments it takes two synthetic maps and keeps the plot in memory.
"""

import io
import sys
from typing import IO, Union

import numpy as np

import cairn

STRATEGIES = ("base", "covariance", "observations", "distance")


def plot(results: cairn.PaperResults, to: Union[str, IO[bytes]]) -> None:
    import matplotlib.pyplot as plt  # type: ignore[import]

    strategies = np.array(results.runs["strategy"])
    scores = np.asarray(results.runs["score"])
    known = ~np.isnan(scores)
    figure, axes = plt.subplots()
    axes.violinplot([scores[(strategies == name) & known] for name in STRATEGIES], showmedians=True)
    axes.set_xticks(range(1, len(STRATEGIES) + 1), STRATEGIES)
    axes.axhline(results.success_score, linestyle="--", label="success")
    axes.set_ylabel("score in m²")
    axes.set_yscale("log")
    axes.legend()
    figure.savefig(to)
    plt.close(figure)


def main() -> None:
    if len(sys.argv) == 4:
        source, target, to = cairn.read_map(sys.argv[1]), cairn.read_map(sys.argv[2]), sys.argv[3]
        results = cairn.paper_experiment(source, target, progress=True)
        plot(results, to)
    else:
        pair = cairn.synthetic_pair(landmarks=200)
        results = cairn.paper_experiment(pair.source, pair.target, pair.target_from_source)
        plot(results, io.BytesIO())
    success = np.array(results.runs["success"])
    strategies = np.array(results.runs["strategy"])
    for name in STRATEGIES:
        print(f"{name}: {success[strategies == name].sum()} of 45 below {results.success_score:.4g} m²")


if __name__ == "__main__":
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        print("SKIPPED: matplotlib is not installed")
        sys.exit(0)
    main()
