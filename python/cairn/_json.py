# SPDX-License-Identifier: BSD-3-Clause
"""Options as JSON."""

import json
import math


def _plain(value):
    """The value in JSON's types. A number that is not finite becomes None: JSON has none, and None is unlimited."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, dict):
        return {str(name): _plain(part) for name, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(part) for part in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if value is None or isinstance(value, (bool, int, float, str)) else str(value)


def text(options):
    return json.dumps(_plain(options), allow_nan=False)
