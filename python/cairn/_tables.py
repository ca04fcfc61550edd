# SPDX-License-Identifier: BSD-3-Clause
"""Maps as pandas tables."""


def to_pandas(self):
    """The landmarks as a pandas.DataFrame by id: position, standard deviations, observation count, colour, columns."""
    try:
        import pandas
    except ImportError as error:
        raise ImportError("to_pandas() needs pandas (Debian: python3-pandas)") from error
    import numpy

    table = {axis: self.positions[:, i] for i, axis in enumerate("xyz")}
    if self.covariances is not None:
        for i, axis in enumerate("xyz"):
            table[f"sigma_{axis}"] = numpy.sqrt(self.covariances[:, i, i])
    if self.observation_counts is not None:
        table["observations"] = self.observation_counts
    if self.colors is not None:
        for i, color in enumerate(("red", "green", "blue")):
            table[color] = pandas.array(self.colors[:, i].filled(0), dtype="UInt8")
            table[color][self.colors.mask[:, i]] = pandas.NA
    table.update(self.columns)
    return pandas.DataFrame(table, index=pandas.Index(self.ids, name="id"))
