"""How the control loop as a process of its own compares with the loop within one process.

    python3 tests/serve/study.py HAMELIN [--per-family N] [--way WAY]... [-o OUT.json]

Runs problems of the benchmark (data/bench) with sampled torques and MuJoCo as the arm: with
`hamelin run`, and with `hamelin serve` and `hamelin plant` as two processes, once without faults
and once with 1 % of the measurements lost and 1 % late. Prints a table of successes and contacts.
"""

import argparse
import json
import pathlib
import subprocess
import sys
import tempfile
import time

SOURCE = pathlib.Path(__file__).resolve().parents[2]
ROBOT = SOURCE / "data/robots/arm7.urdf"
SPHERES = SOURCE / "data/robots/arm7.spheres.json"
# The server waits so long for a measurement, and stops the arm after so many lost ones in a row. The
# default of 10 would also stop it when the computer's other work holds up the simulated arm.
PATIENCE_S, LOST_MAX = 0.005, 100


def make_scenes(program, per_family, folder):
    subprocess.run([program, "--quiet", "bench", "make", "--per-family", str(per_family), "-o", folder / "problems"], check=True)
    subprocess.run(
        [program, "--quiet", "sweep", "plan", *sorted((folder / "problems").glob("*.json")), "--robot", ROBOT,
         "--spheres", SPHERES, "--tip", "flange", "--resolution", "0.01", "--duration", "20",
         "--set", "/actuation/type=sampled", "--set", "/actuation/control_period_s=0.001", "-o", folder / "sweep"],
        check=True,
    )  # fmt: skip
    return sorted((folder / "sweep/scenes").glob("*.json"))


def read_result(file):
    return json.loads(file.read_text()) if file.exists() else {"outcome": "none", "cause": "no result"}


def run_within(program, scene, folder):
    result = folder / "result.json"
    subprocess.run([program, "--quiet", "run", scene, "--plant", "mujoco", "--result", result], check=False)
    return read_result(result)


def run_apart(program, scene, folder, server_options, plant_options):
    socket, result = folder / "arm", folder / "result.json"
    server = subprocess.Popen(
        [program, "--quiet", "serve", scene, "--socket", socket, "--once", *server_options]
    )
    while not socket.exists() and server.poll() is None:
        time.sleep(0.01)
    subprocess.run(
        [program, "--quiet", "plant", scene, "--socket", socket, "--plant", "mujoco",
         "--result", result, *plant_options], check=False,
    )  # fmt: skip
    server.terminate()
    server.wait()
    return read_result(result)


def ways(program):
    faults = ["--lost", "0.01", "--late", "0.01"]
    return {
        "one process": lambda scene, folder: run_within(program, scene, folder),
        "two processes": lambda scene, folder: run_apart(program, scene, folder, ["--lockstep"], []),
        "two processes, 1 % lost, 1 % late": lambda scene, folder: run_apart(
            program, scene, folder, ["--patience", str(PATIENCE_S), "--lost-max", str(LOST_MAX)], faults
        ),
    }


def describe(results):
    reached = sum(r["outcome"] == "reached" for r in results)
    touched = sum((r.get("plant") or {}).get("contacts", 0) > 0 for r in results)
    judged = sum((r.get("plant") or {}).get("judge_contacts", 0) > 0 for r in results)
    links = [r["link"] for r in results if "link" in r]
    counts = [sum(link[key] for link in links) for key in ("periods", "lost", "late")]
    faults = "; {} periods, {} lost, {} late".format(*counts) if links else ""
    return f"{reached} of {len(results)} reached, {touched} touched ({judged} by the judge){faults}"


def print_equal(records):
    """Prints how many runs end at the same time in the same configuration as those of one process."""
    one, two = (records.get(way, {}) for way in ("one process", "two processes"))
    same = sum((one[name]["time_s"], one[name]["q"]) == (two[name]["time_s"], two[name]["q"]) for name in one if name in two)
    if one and two:
        print(f"{same} of {len(two)} runs end equal to the last bit in one and in two processes")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("--per-family", type=int, default=6)
    parser.add_argument("--way", action="append", choices=list(ways("")), help="only this one; may be repeated")
    parser.add_argument("-o", "--output", type=pathlib.Path)
    options = parser.parse_args()
    records = {}
    with tempfile.TemporaryDirectory(prefix="hamelin-serve-") as name:
        scenes = make_scenes(options.program.resolve(), options.per_family, pathlib.Path(name))
        for way, run in ways(options.program.resolve()).items():
            if options.way and way not in options.way:
                continue
            records[way] = {}
            for scene in scenes:
                with tempfile.TemporaryDirectory(prefix="hamelin-serve-") as folder:
                    result = records[way][scene.stem] = run(scene, pathlib.Path(folder))
                print(f"{way}: {scene.stem}: {result['outcome']}", file=sys.stderr, flush=True)
            print(f"{way}: {describe(list(records[way].values()))}", flush=True)
    print_equal(records)
    if options.output:
        options.output.write_text(json.dumps(records, indent=1) + "\n")


if __name__ == "__main__":
    main()
