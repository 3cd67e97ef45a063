"""Optimised motions of scenes, followed by an arm under feedback: `run --trajectory`.

    python3 execution.py HAMELIN SCENE... [-- more options of optimize]

For each scene and each setting one line: the duration, the time that the arm took, its error.
"""
import json
import pathlib
import subprocess
import sys
import tempfile

E = """/actuation/type=sampled /actuation/coulomb_friction_share=0.05 /safety/friction_share=0.05
/actuation/planner_mass_scale=0.9 /safety/mass_error=0.1 /actuation/delay_s=0.001
/actuation/joint_noise_rad=1e-4 /safety/joint_noise_rad=1e-4 /actuation/joint_velocity=estimated"""
SETTINGS = {"ideal": [], "torques": ["/actuation/type=sampled"], "E": E.split()}


def main():
    program, *scenes = sys.argv[1:]
    options = []
    if "--" in scenes:
        at = scenes.index("--")
        scenes, options = scenes[:at], scenes[at + 1:]
    with tempfile.TemporaryDirectory() as folder:
        motion, result = pathlib.Path(folder) / "motion.json", pathlib.Path(folder) / "result.json"
        for scene in scenes:
            for minimize in ("time", "effort"):
                motion.unlink(missing_ok=True)
                command = [program, "optimize", scene, "--minimize", minimize, "--guide", "rrt-connect",
                           "-o", motion, *options]
                subprocess.run(command, capture_output=True, check=False)
                if not motion.exists():
                    print(f"{pathlib.Path(scene).stem:28} {minimize:6} no motion")
                    continue
                for name, values in SETTINGS.items():
                    sets = [x for value in values for x in ("--set", value)]
                    subprocess.run([program, "run", scene, "--trajectory", motion, "--result", result,
                                    *sets], capture_output=True, check=False)
                    r = json.loads(result.read_text())
                    t = r["trajectory"]
                    print(f"{pathlib.Path(scene).stem:28} {minimize:6} {name:8} {r['outcome']:10} "
                          f"{t['duration_s']:7.3f} s, took {t['time_s']:7.3f} s, error "
                          f"{t['error_rms']:.1e} rms {t['error_max']:.1e} max, refused "
                          f"{r['shield']['refused']}", flush=True)


main()
