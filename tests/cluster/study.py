"""A small study, its execution as a whole, and the bytes that any other execution must give."""

import os
import pathlib
import random
import signal
import subprocess
import sys
import tempfile
import time

SKIPPED = 77  # exit code of a skipped test


def skip(reason):
    print(f"skipped: {reason}")
    sys.exit(SKIPPED)


def call(*command, **options):
    """Runs a command and returns its standard output; ends the test if it fails."""
    done = subprocess.run([str(word) for word in command], stdout=subprocess.PIPE, text=True, **options)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}: exit code {done.returncode}")
    return done.stdout


class Study:
    """The sweep: one scene of the shelf with two planners and varied gains, 48 short runs."""

    def __init__(self, program, source):
        self.program = pathlib.Path(program).resolve()
        self.source = pathlib.Path(source).resolve()
        self.folder = tempfile.TemporaryDirectory(prefix="hamelin-cluster-")
        self.root = pathlib.Path(self.folder.name)
        self.expected = None

    def plan(self, name):
        directory = self.root / name
        call(
            self.program, "sweep", "plan", self.source / "data/scenes/pillar.json",
            "--planner", "hybrid", "--planner", "apf", "--duration", "1.5",
            "--vary", "/step_s=0.001,0.002", "--seeds", ",".join(map(str, range(1, 13))),
            "-o", directory,
        )  # fmt: skip
        return directory

    def merge(self, *directories):
        """Records, summary and table without timing, as one text."""
        records, summary = self.root / "records.jsonl", self.root / "summary.json"
        table = call(
            self.program, "sweep", "merge", *directories, "--by", "planner,values",
            "--without-timing", "--records", records, "-o", summary, stderr=subprocess.STDOUT,
        )  # fmt: skip
        return records.read_text() + summary.read_text() + table

    def run_whole(self):
        directory = self.plan("whole")
        call(self.program, "--quiet", "sweep", "run", directory)
        self.expected = self.merge(directory)
        if self.expected.count("hamelin.record/1") != 48:
            sys.exit("the whole sweep has not recorded its 48 runs")

    def compare(self, name, *directories):
        """Ends the test if the merged bytes differ from those of the whole sweep."""
        found = self.merge(*directories)
        if found != self.expected:
            for number, (a, b) in enumerate(zip(self.expected.split("\n"), found.split("\n")), 1):
                if a != b:
                    sys.exit(f"{name}: line {number} differs:\n{a[:1000]}\n{b[:1000]}")
            sys.exit(f"{name}: {len(found)} bytes, expected {len(self.expected)}")
        print(f"{name}: {len(found)} bytes, equal to those of the whole sweep")


def processes_with(text):
    """Ids of other processes whose command line has this text."""
    found = []
    for folder in pathlib.Path("/proc").iterdir():
        try:
            if folder.name.isdigit() and int(folder.name) != os.getpid():
                if text.encode() in (folder / "cmdline").read_bytes():
                    found.append(int(folder.name))
        except OSError:
            pass  # it has ended
    return found


def kill_some(text, seed, seconds, pause, goes_on):
    """Kills processes of a study at random while goes_on(); returns how many."""
    chosen, killed, end = random.Random(seed), 0, time.monotonic() + seconds
    while time.monotonic() < end and goes_on():
        time.sleep(pause)
        victims = processes_with(text)
        if victims:
            try:
                os.kill(chosen.choice(sorted(victims)), chosen.choice([signal.SIGKILL, signal.SIGTERM]))
                killed += 1
            except ProcessLookupError:
                pass
    return killed
