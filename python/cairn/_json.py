# SPDX-License-Identifier: BSD-3-Clause
"""Options as JSON."""

import json


def _plain(value):
    return value.tolist() if hasattr(value, "tolist") else str(value)


def text(options):
    return json.dumps(options, default=_plain)
