"""Types of arguments."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, Callable, Iterator, Mapping, Protocol, Sequence, Union

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from ._hamelin import Command, Tick

PathLike = Union[str, "os.PathLike[str]"]
Paths = Union[PathLike, Sequence[PathLike], None]
Array = npt.NDArray[np.float64]
Numbers = npt.ArrayLike
Document = dict[str, Any]
#: False: none; True: a line on stderr; or a function of what is done and of all.
Progress = Union[bool, Callable[[float, float], Any]]


class Planner(Protocol):
    """A planner in Python."""

    def tick(self, tick: Tick, command: Command) -> None:
        """Answers a tick by writing to the command."""


class DocumentMapping(Mapping[str, Any]):
    """A document as a read-only mapping."""

    def __init__(self, document: Document) -> None:
        self._document = document

    def __getitem__(self, key: str) -> Any:
        return self._document[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._document)

    def __len__(self) -> int:
        return len(self._document)
