"""The exception of hamelin."""

from __future__ import annotations

import re

# "file: place: text": a file has a dot or a slash; a place is a JSON pointer, a line or a frame.
_FILE = re.compile(r"^(?P<file>[^:\n]*[./][^:\n]*): (?P<rest>.*)$", re.DOTALL)
_PLACE = re.compile(
    r"^(?P<place>/[^:\n]*|line \d+(?:, column \d+)?|frame \d+ at byte \d+): (?P<text>.*)$", re.DOTALL
)


class Error(ValueError):
    """Bad input: one line that says file, place, what is wrong and what was expected.

    code: 'usage' (arguments of a call), 'io', 'parse', 'invalid' (content of a file) or 'plugin'.
    file: the file, or None. place: where in it, as a JSON pointer or line, or None. text: the rest.
    """

    def __init__(self, message: str = "", code: str = "usage") -> None:
        super().__init__(message, code)
        self.code: str = code
        rest = message
        self.file: str | None = None
        self.place: str | None = None
        match = _FILE.match(rest) if code != "usage" else None
        if match:
            self.file, rest = match["file"], match["rest"]
            match = _PLACE.match(rest)
            if match:
                self.place, rest = match["place"], match["text"]
        self.text: str = rest

    def __str__(self) -> str:
        return str(self.args[0])
