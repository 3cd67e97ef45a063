"""Logs as arrays."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, Iterator, Mapping

import numpy as np

from ._hamelin import LogStream
from ._types import Array, Document, PathLike

if TYPE_CHECKING:
    import pandas


class Log(Mapping[str, Array]):
    """A log as a mapping from the fields of its ticks to arrays, which are also attributes.

    A field has shape (N,) or (N, m) for N ticks; keys of nested objects are joined by dots, as
    log["energy.kinetic_J"]. NaN where a tick does not have the field. header, result: dicts;
    events: a list of dicts; cut: whether the file ends in the middle of a line.
    """

    def __init__(
        self,
        file: str,
        header: Document,
        columns: dict[str, Array],
        events: list[Document],
        result: Document | None,
        cut: bool,
    ) -> None:
        self.file = file
        self.header = header
        self.events = events
        self.result = result
        self.cut = cut
        self._columns = columns

    def __getitem__(self, key: str) -> Array:
        return self._columns[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        try:
            return self._columns[name]
        except KeyError:
            raise AttributeError(f"the log has no field {name!r}") from None

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *(key for key in self._columns if key.isidentifier())]

    @property
    def ticks(self) -> int:
        """Number of ticks."""
        return len(self._columns["k"]) if "k" in self._columns else 0

    @property
    def joint_names(self) -> list[str]:
        """Names of the joints, or q0, q1, ... if the header does not have them."""
        joints = self.header.get("joints")
        if isinstance(joints, list) and all(isinstance(name, str) for name in joints):
            return list(joints)
        return [f"q{i}" for i in range(self._columns["q"].shape[1] if "q" in self else 0)]

    def to_pandas(self) -> pandas.DataFrame:
        """A table with one row per tick, indexed by time_s; lists give columns q[0], q[1], ..."""
        import pandas

        flat: dict[str, Array] = {}
        for key, values in self._columns.items():
            if values.ndim == 1:
                flat[key] = values
            else:
                for i in range(values.shape[1]):
                    flat[f"{key}[{i}]"] = values[:, i]
        table = pandas.DataFrame(flat)
        return table.set_index("time_s") if "time_s" in flat else table

    def plot(self, *fields: str, figure: Any = None) -> Any:
        """Plots fields over time with matplotlib, one below the other; returns the figure.

        Without fields: positions, velocities, torques and clearance, those that the log has.
        """
        names = list(fields) or [
            name for name in ("q", "v", "tau", "clearance_m") if name in self._columns
        ]
        for name in names:
            if name not in self._columns:
                raise KeyError(f"the log has no field {name!r}, expected one of {list(self)}")
        if figure is None:
            import matplotlib.pyplot as plt

            figure = plt.figure(figsize=(8, 2.2 * len(names)), layout="constrained")
        axes = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
        labels = {
            "q": "q [rad, m]",
            "v": "v [rad/s, m/s]",
            "tau": "torque [Nm, N]",
            "clearance_m": "clearance [m]",
        }
        joints = self.joint_names
        for axis, name in zip(axes, names):
            values = self._columns[name]
            lines = axis.plot(self._columns["time_s"], values, linewidth=0.9)
            axis.set_ylabel(labels.get(name, name))
            axis.grid(True, alpha=0.3)
            if values.ndim == 2 and values.shape[1] == len(joints):
                for line, joint in zip(lines, joints):
                    line.set_label(joint)
        if axes[0].get_legend_handles_labels()[0]:
            axes[0].legend(loc="upper right", fontsize="x-small", ncols=2)
        axes[-1].set_xlabel("time [s]")
        return figure

    def __repr__(self) -> str:
        outcome = self.result["outcome"] if self.result else "unfinished"
        seconds = float(self._columns["time_s"][-1]) if self.ticks else 0.0
        return f"<hamelin.Log '{self.file}': {self.ticks} ticks, {seconds:.6g} s, {outcome}>"


def read_log(file: PathLike) -> Log:
    """Reads a log, plain or zstd, into arrays. LogStream reads one in chunks."""
    stream = LogStream(file)
    columns = stream.read() or {"k": np.empty(0), "time_s": np.empty(0)}
    for name in ("k", "goal_index"):
        values = columns.get(name)
        if values is not None and np.isfinite(values).all():
            columns[name] = values.astype(np.int64)
    return Log(os.fspath(file), stream.header, columns, stream.events, stream.result, stream.cut)
