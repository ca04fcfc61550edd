# SPDX-License-Identifier: BSD-3-Clause
"""Progress of long calls."""


class _Bar:
    def __init__(self, name, tqdm):
        self._bar = tqdm(total=100, desc=name, unit="%", bar_format="{desc}: {percentage:3.0f}%|{bar}| {elapsed}")

    def __call__(self, share):
        if 100.0 * share != self._bar.n:
            self._bar.n = 100.0 * share
            self._bar.refresh()

    def close(self):
        self._bar.close()


def reporter(progress, name):
    """A callable that takes a share in [0, 1]; None if no progress is shown."""
    if progress is None or progress is False:
        return None
    if progress is True:
        try:
            from tqdm.auto import tqdm
        except ImportError:
            return None
        return _Bar(name, tqdm)
    if not callable(progress):
        raise TypeError(f"progress: {type(progress).__name__}; expected True, None or a callable")
    return progress
