#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""What Python costs beside C++: calls of align(), columns of a large map to NumPy, and arrays to a map.

    cmake --preset release -D CAIRN_BUILD_BENCHMARKS=ON
    cmake --build build/release --target cairn_python cairn_align_calls
    PYTHONPATH=build/release/python benchmarks/python_overheads.py build/release/bin/cairn_align_calls
"""

import argparse
import pathlib
import statistics
import subprocess
import tempfile
import time

import numpy as np

import cairn


def align_times(program, landmarks, threads, calls):
    """(wall, processor) seconds of each call, in Python and in C++, by turns, so that the machine's load meets both."""
    pair = cairn.synthetic_pair(landmarks=landmarks)
    python, native = [], []
    with tempfile.TemporaryDirectory() as name:
        paths = [pathlib.Path(name, "source.cairn"), pathlib.Path(name, "target.cairn")]
        pair.source.write(paths[0])
        pair.target.write(paths[1])
        source, target = (cairn.read_map(path) for path in paths)
        with subprocess.Popen([program, *paths, str(threads)], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                              text=True) as peer:
            for _ in range(calls + 1):
                peer.stdin.write("\n")
                peer.stdin.flush()
                wall, work, verdict = peer.stdout.readline().split(maxsplit=2)
                native.append((float(wall), float(work)))
                start, start_work = time.perf_counter(), time.process_time()
                result = cairn.align(source, target, threads=threads)
                python.append((time.perf_counter() - start, time.process_time() - start_work))
                if (result.verdict == "aligned") != (verdict.strip() == "aligned"):
                    raise SystemExit("C++ and Python do not agree")
            peer.stdin.close()
    return python[1:], native[1:]  # the first fills caches


def fastest(work, repeats):
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        result = work()
        times.append(time.perf_counter() - start)
        del result
    return min(times)


def print_align(program, landmarks, threads, calls):
    python, native = align_times(program, landmarks, threads, calls)
    print(f"align(), {landmarks} landmarks, {threads} thread(s), {calls} calls each by turns:")
    for what, i in (("wall time", 0), ("processor time", 1)):
        ours, theirs = [t[i] for t in python], [t[i] for t in native]
        for name, take in (("fastest", min), ("median", statistics.median)):
            a, b = take(ours), take(theirs)
            print(f"  {what}, {name}: Python {1e3 * a:.2f} ms, C++ {1e3 * b:.2f} ms: {100 * (a / b - 1):+.1f} %")


def print_arrays(count, repeats):
    chance = np.random.default_rng(1)
    positions = chance.normal(size=(count, 3))
    covariances = np.tile(1e-4 * np.eye(3), (count, 1, 1))
    for name, columns in (("positions", {}), ("positions and covariances", {"covariances": covariances})):
        arrays = [positions, *columns.values()]
        size = sum(array.nbytes for array in arrays)
        make = fastest(lambda: cairn.LandmarkMap.from_arrays(positions, **columns), repeats)
        copy = fastest(lambda: [array.copy() for array in arrays], repeats)
        print(f"from_arrays({name}), {count} landmarks: {make:.3f} s, {1e-9 * size / make:.2f} GB/s; "
              f"numpy's copy: {copy:.3f} s, {1e-9 * size / copy:.2f} GB/s")
    m = cairn.LandmarkMap.from_arrays(positions, covariances=covariances)
    for name in ("positions", "covariances", "ids"):
        view = getattr(m, name)
        if view.flags.owndata or view.flags.writeable or len(view) != count:
            raise SystemExit(f"{name} is no read-only view")
        print(f"map.{name}, {count} landmarks: {1e6 * fastest(lambda: getattr(m, name), 1000):.1f} us")


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("program", help="the benchmark cairn_align_calls of the same build")
    parser.add_argument("--landmarks", type=int, default=3000)
    parser.add_argument("--calls", type=int, default=30)
    parser.add_argument("--large", type=int, default=10_000_000)
    arguments = parser.parse_args()
    for threads in (1, 2):
        print_align(arguments.program, arguments.landmarks, threads, arguments.calls)
    print_arrays(arguments.large, 5)


if __name__ == "__main__":
    main()
