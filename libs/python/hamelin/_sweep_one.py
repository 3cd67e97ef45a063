"""One run of a sweep: prints a line of JSON, or one line that says what is wrong (exit code 2)."""

from __future__ import annotations

import argparse
import signal
import sys

from . import Error, load_scene
from ._hamelin import _sweep_one


def main() -> int:
    """Reads the arguments that a sweep gives to a run."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    parser = argparse.ArgumentParser(prog="hamelin sweep one")
    parser.add_argument("scene")
    parser.add_argument("--planner")
    parser.add_argument("--set", action="append")
    parser.add_argument("--seed", type=int)
    parser.add_argument("--plugin-path", action="append")
    given = parser.parse_args()
    try:
        scene = load_scene(given.scene, planner=given.planner, set=given.set, seed=given.seed)
        print(_sweep_one(scene, given.plugin_path, sys.argv), flush=True)
    except Error as error:
        print(f"hamelin: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
