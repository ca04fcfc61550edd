#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Joins what Google Benchmark wrote as JSON into one CSV on standard output.

    benchmarks/results_to_csv.py RESULT.json...

A row a benchmark: of its repetitions the one with the least real time, which other work on the machine
disturbed least; where only aggregates were kept, their minimum or median. Times are milliseconds.
"""
import csv
import json
import sys

MILLISECONDS = {"ns": 1e-6, "us": 1e-3, "ms": 1.0, "s": 1e3}
COLUMNS = ["name", "repetitions", "real_ms", "cpu_ms", "iterations_made", "score", "items_per_second",
           "bytes_per_second"]


def chosen(runs):
    repetitions = [run for run in runs if run["run_type"] == "iteration"]
    if repetitions:
        return min(repetitions, key=lambda run: run["real_time"])
    named = {run["aggregate_name"]: run for run in runs}
    return named.get("min") or named.get("median")


def row(run):
    unit = MILLISECONDS[run["time_unit"]]
    result = {column: f"{run[column]:.8g}" for column in COLUMNS[4:] if column in run}
    return result | {"name": run["run_name"], "repetitions": run.get("repetitions", 1),
                     "real_ms": f"{run['real_time'] * unit:.4g}", "cpu_ms": f"{run['cpu_time'] * unit:.4g}"}


def main(paths):
    runs = {}
    for path in paths:
        with open(path, encoding="utf-8") as file:
            for run in json.load(file)["benchmarks"]:
                if not run.get("error_occurred"):
                    runs.setdefault(run["run_name"], []).append(run)
    out = csv.DictWriter(sys.stdout, COLUMNS, restval="", lineterminator="\n")
    out.writeheader()
    for same in runs.values():
        if run := chosen(same):
            out.writerow(row(run))


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(sys.argv[1:])
