#!/usr/bin/env python3
"""executed_length.py HAMELIN TABLE SCENE...: runs each scene with the guide rrt-connect and prints
how long the executed joint motion is, beside OMPL's simplification of the guide's path.

TABLE is the output of `hamelin_guide_table --certified --list --only rrt-connect SCENE...`. Lengths
are Euclidean, in joint space [rad or m]. Further arguments that begin with -- go to `hamelin run`.
"""
import json
import math
import re
import statistics
import subprocess
import sys
import tempfile


def executed(program, scene, options, log):
    command = [program, "-q", "run", scene, "--guide", "rrt-connect", "--log", log, "--every", "10"]
    done = subprocess.run(command + options, stderr=subprocess.PIPE, text=True, check=False)
    if done.returncode not in (0, 1):
        sys.exit(f"{scene}: {done.stderr}")
    length, last, reached, time_s = 0.0, None, False, 0.0
    with open(log, encoding="utf-8") as lines:
        for line in map(json.loads, lines):
            if line["type"] == "tick":
                length += math.dist(line["q"], last) if last else 0.0
                last = line["q"]
            elif line["type"] == "result":
                reached, time_s = line["outcome"] == "reached", line["time_s"]
    return length, reached, time_s


def main():
    program, table = sys.argv[1:3]
    scenes = [a for a in sys.argv[3:] if not a.startswith("--")]
    options = [part for a in sys.argv[3:] if a.startswith("--") for part in a.split(" ", 1)]
    pattern = re.compile(r"^  (\S+) \S+: found .* length ([\d.]+), OMPL's ([\d.]+)")
    with open(table, encoding="utf-8") as lines:
        found = {m[1]: float(m[3]) for m in map(pattern.match, lines) if m}
    ratios, lengths, references, times = [], [], [], []
    with tempfile.TemporaryDirectory() as folder:
        for scene in scenes:
            length, reached, time_s = executed(program, scene, options, folder + "/run.jsonl")
            if not reached:
                print(f"{scene}: not reached")
                continue
            times.append(time_s)
            if scene in found:
                lengths.append(length)
                references.append(found[scene])
                ratios.append(length / found[scene])
    print(f"reached {len(times)} of {len(scenes)} in {statistics.median(times):.2f} s (median)")
    print(f"executed length {statistics.median(lengths):.3f}, OMPL's simplified path "
          f"{statistics.median(references):.3f}, ratio of each: median {statistics.median(ratios):.3f}, "
          f"90 % {sorted(ratios)[int(0.9 * len(ratios))]:.3f}")


if __name__ == "__main__":
    main()
