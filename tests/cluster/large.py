"""Time and memory of plan, shard start, merge and page for studies of growing size.

large.py PROGRAM SOURCE_DIR [RUNS...] [--execute]: prints a table. RUNS is a multiple of 500. With --execute,
all runs are executed in four shards, with the simplest planner and without the shield; else one run is, and its
record is repeated for all ids, because the times of merge and page do not depend on who made the records.
"""

import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time

from study import call


def measured(*command):
    """Wall time [s] and largest memory [MB] of a command."""
    before = time.monotonic()
    process = subprocess.Popen([str(word) for word in command], stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        sys.exit(f"{' '.join(map(str, command))}: status {status}")
    return time.monotonic() - before, usage.ru_maxrss / 1024


def repeat_record(directory, runs):
    """Records of all runs, from that of the first."""
    record = json.loads((directory / "records.jsonl").read_text())
    plan = json.loads((directory / "plan.json").read_text())
    with open(directory / "records.jsonl", "w", encoding="utf-8") as out:
        for number, run in enumerate(plan["runs"]):
            record["id"], record["labels"] = run["id"], run["labels"]
            record["outcome"] = record["result"]["outcome"] = "stalled" if number % 7 == 0 else "reached"
            record["cause"] = f"force balance at {0.001 * number:.3f} s" if number % 7 == 0 else None
            record["result"]["time_s"] = 1.0 + 1e-5 * number
            out.write(json.dumps(record, separators=(",", ":")) + "\n")


def study(program, source, runs, execute, folder):
    directory = folder / f"study-{runs}"
    scene = source / "data/scenes/pillar.json"
    # 500 seeds, and as many lengths of the runs as needed; a plain list of seeds would be too long
    # for a command line.
    lengths = ",".join(f"{0.02 + 0.001 * i:.3f}" for i in range(runs // 500))
    planner = ("template", "--set", "/safety/type=none") if execute else ("hybrid",)
    rows = [("plan", measured(
        program, "sweep", "plan", scene, "--planner", *planner, "--vary", f"/duration_s={lengths}",
        "--seeds", ",".join(map(str, range(1, 501))), "-o", directory,
    ))]  # fmt: skip
    if execute:
        for shard in range(1, 5):
            rows.append((f"shard {shard}/4", measured(program, "--quiet", "sweep", "run", directory,
                                                       "--shard", f"{shard}/4")))  # fmt: skip
    else:
        call(program, "--quiet", "sweep", "run", directory, "--limit", "1")
        repeat_record(directory, runs)
    rows.append(("a shard with nothing to do",
                 measured(program, "--quiet", "sweep", "run", directory, "--shard", "1/40")))  # fmt: skip
    rows.append(("merge", measured(program, "sweep", "merge", directory)))
    page = folder / "page.html"
    rows.append(("merge with page and CSV", measured(
        program, "sweep", "merge", directory, "--page", page, "--csv", folder / "runs.csv")))  # fmt: skip
    rows.append(("merge with records", measured(
        program, "sweep", "merge", directory, "--without-timing", "--records",
        folder / "records.jsonl")))  # fmt: skip
    sizes = {
        "plan": (directory / "plan.json").stat().st_size,
        "records": sum(file.stat().st_size for file in directory.glob("records*.jsonl")),
        "page": page.stat().st_size,
    }
    print(f"{runs} runs: " + ", ".join(f"{name} {size / 1e6:.1f} MB" for name, size in sizes.items()))
    for name, (seconds, megabytes) in rows:
        print(f"  {name:<28} {seconds:8.2f} s {megabytes:8.0f} MB")


def main():
    words = [word for word in sys.argv[1:] if word != "--execute"]
    program, source = (pathlib.Path(word).resolve() for word in words[:2])
    with tempfile.TemporaryDirectory(prefix="hamelin-large-") as folder:
        for runs in map(int, words[2:] or ("1000", "10000", "100000")):
            study(program, source, runs, "--execute" in sys.argv, pathlib.Path(folder))


if __name__ == "__main__":
    main()
