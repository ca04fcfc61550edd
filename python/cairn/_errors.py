# SPDX-License-Identifier: BSD-3-Clause
"""The exceptions of the library."""

import os
import re
from typing import Optional

_PLACE = re.compile(r"(?P<file>[^\n]*?):(?: (?:byte|offset) (?P<byte>\d+)|(?P<line>\d+))(?::|;|$|,)")
_EXPECTED = "; expected "


def _path_before(message: str) -> Optional[str]:
    """The path at the start of a message about a whole file or folder."""
    head, separator, _ = message.partition(": ")
    is_path = os.sep in head or os.path.splitext(head)[1] != "" and " " not in head
    return head if separator and is_path else None


class Error(Exception):
    """Base class of the library's errors. The message states the place, the problem and what was expected."""

    def __init__(self, message: str) -> None:
        super().__init__(message)
        place = _PLACE.match(message)
        self.file: Optional[str] = place["file"] if place else _path_before(message)
        self.line: Optional[int] = int(place["line"]) if place and place["line"] else None
        head, separator, expected = message.rpartition(_EXPECTED)
        self.expected: Optional[str] = expected if separator and head else None

    def __reduce__(self):
        return type(self), (str(self),)


class MisuseError(Error, ValueError):
    """An argument or option violates the function's constraints."""

    def __init__(self, message: str) -> None:
        super().__init__(message)
        self.file = self.line = None  # "IcpOptions.k" is not a path


class InputError(Error, ValueError):
    """Data that cannot be read, or lacks what the function needs."""


class StorageError(Error, OSError):
    """The operating system refused to write."""

    def __str__(self) -> str:
        return str(self.args[0])


class CancelledError(Error):
    """The work was stopped."""


_KINDS = {
    "misuse": MisuseError,
    "input": InputError,
    "storage": StorageError,
    "cancelled": CancelledError,
}


def made(kind: str, message: str) -> Error:
    return _KINDS[kind](message)
