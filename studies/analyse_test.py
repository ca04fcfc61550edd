#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Tests of analyse.py on runs whose answers follow from their design."""
import argparse
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

try:
    import numpy as np
    import pandas as pd
    import scipy.stats
    import statsmodels  # noqa: F401
    import matplotlib  # noqa: F401
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(0)

sys.path.insert(0, str(pathlib.Path(__file__).parent))
sys.dont_write_bytecode = True
import analyse  # noqa: E402

PAIRS = ["desk_1", "desk_2", "desk_3", "office_1", "office_2", "office_3"]
STARTS = 10
# Of ten starts of each pair, so many succeed: those with the least yaw.
SUCCESSES = {"base": [5, 5, 5, 5, 5, 5], "observations": [5, 5, 5, 5, 5, 5], "distance": [4, 3, 2, 1, 0, 5],
             "robust": [10, 10, 10, 10, 10, 10]}
KEYS = {"base": ("icp", "base"), "observations": ("icp", "observations"), "distance": ("icp", "distance"),
        "robust": ("robust", "base")}


def table():
    """A right pose has a lower score than a wrong one, but in office_3 a higher one."""
    rows = []
    for pair_index, pair in enumerate(PAIRS):
        for start in range(STARTS):
            for approach, successes in SUCCESSES.items():
                method, strategy = KEYS[approach]
                right = start < successes[pair_index]
                score = 0.001 if right == (pair != "office_3") else 0.002
                rows.append({"pair": pair, "experiment": "designed", "number": start + 1, "method": method,
                             "strategy": strategy, "k": 5, "x_m": 0.1 * (start + 1), "y_m": 0.0, "z_m": 0.0,
                             "roll_deg": 0.0, "pitch_deg": 0.0, "yaw_deg": -4.0 * (start + 1), "status": "converged",
                             "stop_reason": "mse_change" if right else "iteration_limit",
                             "iterations": 20 if right else 150, "score_m2": score, "tx": 0.0,
                             "rotation_error_deg": 1.0 if right else 30.0,
                             "translation_error_m": 0.01 if right else 1.0})
    return pd.DataFrame(rows)


def options(**changes):
    values = {"max_rotation_deg": 5.0, "max_translation_m": 0.05, "success_score_m2": None, "confidence_level": 0.95,
              "equivalence_margin": 0.05, "seed": 1}
    return argparse.Namespace(**{**values, **changes})


class Designed(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.runs, cls.tables, cls.answers = analyse.analyse(table(), options())

    def row(self, name, **keys):
        found = self.tables[name]
        for key, value in keys.items():
            found = found[found[key] == value]
        self.assertEqual(len(found), 1)
        return found.iloc[0]

    def test_names_approaches_and_places(self):
        self.assertEqual(self.runs.approaches, ["base", "observations", "distance", "robust"])
        self.assertEqual(list(self.tables["places"].place.unique()), ["desk", "office"])

    def test_success_rates(self):
        for approach, successes in SUCCESSES.items():
            self.assertAlmostEqual(self.row("strategies", strategy=approach).success, sum(successes) / 60)
        self.assertAlmostEqual(self.row("places", place="desk", strategy="distance").success, 0.3)
        self.assertAlmostEqual(self.row("strategies", strategy="base").at_limit, 0.5)

    def test_pairs_that_are_all_alike_count_as_one_trial_each(self):
        # Wilson's interval for 0.5 of n trials is symmetric, with half width z / (2 sqrt(n + z²)).
        z, t = scipy.stats.norm.ppf(0.975), scipy.stats.t.ppf(0.975, 5)
        effective = 6 * (z / t)**2
        row = self.row("strategies", strategy="base")
        self.assertAlmostEqual(row.high - 0.5, z / (2 * np.sqrt(effective + z**2)))
        self.assertAlmostEqual(row.low, 1 - row.high)

    def test_the_interval_resamples_pairs(self):
        row = self.row("strategies", strategy="distance")
        self.assertTrue(0.05 < row.low < 0.25 < row.high < 0.45)

    def test_equal_approaches_are_equivalent(self):
        row = self.row("comparisons", first="base", second="observations")
        self.assertEqual((row.difference, row.p_by_pairs, row.tost_p, row.mcnemar_p), (0, 1, 0, 1))
        self.assertIn("equivalent within 5 points (TOST p < 0.001)", " ".join(self.answers))

    def test_differences(self):
        # Five pairs differ, all in one direction and by different amounts: two of 2^5 assignments of signs.
        row = self.row("comparisons", first="base", second="distance")
        self.assertAlmostEqual(row.difference, -0.25)
        self.assertAlmostEqual(row.p_by_pairs, 2 / 2**5)
        self.assertAlmostEqual(row.rank_biserial, -1)
        self.assertEqual((row.first_only, row.second_only), (15, 0))
        self.assertAlmostEqual(row.mcnemar_p, 2**-15)
        self.assertAlmostEqual(row.cohens_h, 2 * np.arcsin(np.sqrt(0.25)) - np.pi / 2)
        self.assertTrue(row.low < -0.25 < row.high < 0)
        self.assertGreater(row.tost_p, 0.5)

    def test_holm_multiplies_the_smallest_by_their_number(self):
        rows = self.tables["comparisons"].sort_values("p_by_pairs")
        self.assertAlmostEqual(rows.p_adjusted.iloc[0], min(1, 6 * rows.p_by_pairs.iloc[0]))

    def test_friedman(self):
        # Ranks of base and observations 2.5, distance 1, robust 4; in office_3 the first three share 2.
        sums = np.array([5 * 2.5 + 2, 5 * 2.5 + 2, 5 * 1 + 2, 6 * 4.0])
        ties = 1 - (5 * (2**3 - 2) + (3**3 - 3)) / (6 * 4 * (4**2 - 1))
        statistic = (12 / (6 * 4 * 5) * np.square(sums).sum() - 3 * 6 * 5) / ties
        self.assertIn(f"chi-squared {statistic:.1f}", " ".join(self.answers))

    def test_score_as_a_judge(self):
        value = self.tables["score"].set_index("what").value
        self.assertEqual(value["pairs with right and wrong poses"], 6)
        self.assertEqual(value["median AUC within a pair"], 1)
        self.assertEqual(value["lowest AUC within a pair"], 0)
        self.assertAlmostEqual(value["pairs whose lowest score is of a wrong pose"], 1 / 6)
        # The wrong poses of office_3, 15 of 105, have its lowest score.
        self.assertAlmostEqual(value["wrong poses that pass by the score"], 15 / 105)
        self.assertAlmostEqual(value["right poses that fail by the score"], 25 / 135)

    def test_basins(self):
        rotation, translation = analyse.offsets_of(self.runs.judged)
        self.assertAlmostEqual(rotation.max(), 40)
        self.assertAlmostEqual(translation.max(), 1)
        basins = self.tables["basins"]
        base = basins[basins.strategy == "base"]
        self.assertTrue((base.success[base.rotation_to_deg <= 20] == 1).all())
        self.assertTrue((base.success[base.rotation_from_deg >= 24] == 0).all())
        self.assertEqual(base.runs.sum(), 60)
        self.assertAlmostEqual(self.row("strategies", strategy="base").radius_deg, 20)
        self.assertAlmostEqual(self.row("strategies", strategy="robust").radius_m, 1)


class Special(unittest.TestCase):
    def test_offsets_compose_the_three_angles(self):
        row = pd.DataFrame([{"roll_deg": 10.0, "pitch_deg": -20.0, "yaw_deg": 50.0, "x_m": 3.0, "y_m": 4.0, "z_m": 0.0}])
        rotation = scipy.spatial.transform.Rotation.from_euler("ZYX", [50, -20, 10], degrees=True)
        offsets = analyse.offsets_of(row)
        self.assertAlmostEqual(offsets[0][0], np.degrees(rotation.magnitude()))
        self.assertAlmostEqual(offsets[1][0], 5)

    def test_no_truth_no_verdict(self):
        runs = table().assign(rotation_error_deg=np.nan, translation_error_m=np.nan)
        _, tables, answers = analyse.analyse(runs, options())
        self.assertFalse(tables)
        self.assertIn("Without a truth", answers[-1])

    def test_a_pair_without_any_pose_counts_as_failed(self):
        runs = table()
        lost = runs.pair == "desk_1"
        runs.loc[lost, ["tx", "score_m2", "rotation_error_deg", "translation_error_m"]] = np.nan
        _, tables, _ = analyse.analyse(runs, options())
        success = tables["strategies"].set_index("strategy").success
        self.assertAlmostEqual(success["robust"], 50 / 60)

    def test_one_pair_allows_no_test(self):
        runs = table()
        _, _, answers = analyse.analyse(runs[runs.pair == "desk_1"], options())
        self.assertIn("observations against base: 50.0 % of the starts succeed instead of 50.0 %, 0.0 points. One pair of "
                      "maps allows no interval and no test.", answers)

    def test_several_k_are_told_apart_where_k_matters(self):
        runs = table()
        runs.loc[runs.number > 5, "k"] = 9
        self.assertEqual(analyse.Runs(runs, options()).approaches,
                         ["base", "observations k=5", "distance k=5", "robust", "observations k=9", "distance k=9"])

    def test_the_program_writes_tables_and_figures(self):
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            table().to_csv(folder / "runs.csv", index=False)
            (folder / "experiment.json").write_text('{"seed": 3, "options": {"max_rotation_deg": 90}}')
            script = pathlib.Path(__file__).with_name("analyse.py")
            run = subprocess.run([sys.executable, script, folder, "--max-translation-m", "2"], check=True,
                                 capture_output=True, text=True)
            self.assertIn("within 90 degrees and 2 m", run.stdout)
            self.assertIn("distance: 100.0 %", run.stdout)
            written = {p.relative_to(folder / "analysis").as_posix() for p in (folder / "analysis").rglob("*.*")}
            self.assertLessEqual({"summary.md", "tables/comparisons.csv", "figures/scores.pdf", "figures/scores.svg",
                                  "figures/basins.svg", "figures/success.pdf"}, written)

    def test_the_papers_experiments_get_figures_of_a_columns_width(self):
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            parts = [table().assign(experiment=name) for name in ("yaw", "xy", "k")]
            parts[2].loc[parts[2].number > 5, "k"] = 9
            pd.concat([part[part.method == "icp"] for part in parts]).to_csv(folder / "runs.csv", index=False)
            script = pathlib.Path(__file__).with_name("analyse.py")
            subprocess.run([sys.executable, script, folder], check=True, capture_output=True)
            figures = sorted((folder / "analysis/figures").glob("*.svg"))
            self.assertEqual([f.stem for f in figures], ["scores_xy", "scores_yaw"])
            width = float(re.search(r'width="([\d.]+)pt"', figures[0].read_text())[1])
            self.assertAlmostEqual(width / 72, analyse.COLUMN_WIDTH, delta=0.1)


if __name__ == "__main__":
    unittest.main()
