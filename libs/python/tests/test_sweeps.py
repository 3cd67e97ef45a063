"""Plans of many runs, as the program makes them."""

import json
import subprocess

import hamelin
import pytest


def plan_by_program(program, folder, *arguments):
    done = subprocess.run(
        [program, "sweep", "plan", *map(str, arguments), "-o", folder, "--json"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_clutter_is_planned_as_by_the_program(program, scenes, tmp_path):
    plan = hamelin.plan_sweep(
        tmp_path / "python", base=scenes / "clutter.json", clutter=2, pairs=2, primitives=12,
        keep_out=[[0, 0, 0.2, 0.4], [0, 0, 0.6, 0.2]], draw_seed=7, seeds=[1, 2], planner="hybrid",
        sizes=(0.05, 0.15),
    )  # fmt: skip
    expected = plan_by_program(
        program, tmp_path / "program", "--base", scenes / "clutter.json", "--clutter", 2,
        "--pairs", 2, "--primitives", 12, "--keep-out", "0,0,0.2,0.4", "--keep-out", "0,0,0.6,0.2",
        "--draw-seed", 7, "--seeds", "1,2", "--planner", "hybrid", "--sizes", "0.05,0.15",
    )  # fmt: skip
    for key in ("scenes", "feasible", "runs", "sha256"):
        assert plan[key] == expected[key]
    assert plan["runs"] == 8


def test_gain_sets(program, scenes, tmp_path):
    plan = hamelin.plan_sweep(
        tmp_path / "gains", base=scenes / "paper_52_apf.json", gain_sets=2, duration=0.04
    )
    expected = plan_by_program(
        program, tmp_path / "other", "--base", scenes / "paper_52_apf.json", "--gain-sets", 2,
        "--duration", 0.04,
    )  # fmt: skip
    assert plan["sha256"] == expected["sha256"]
    swept = hamelin.sweep(tmp_path / "gains", limit=2)
    assert swept.run["run"] == 2


def test_a_planner_of_python_in_a_sweep(program, scenes, tmp_path, monkeypatch):
    (tmp_path / "mine.py").write_text(
        "class Mine:\n"
        "    def __init__(self, k=1.0):\n        self.params = {'k': k}\n"
        "    def tick(self, tick, command):\n"
        "        command.held_torque = self.params['k'] * tick.v\n"
    )
    monkeypatch.chdir(tmp_path)
    plan = hamelin.plan_sweep(
        "tries", scenes / "pillar.json", planner=["python:mine.py:Mine", "apf"], duration=0.02,
        vary="/seed=1",
    )  # fmt: skip
    assert plan["runs"] == 2
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")  # the plan knows where the planner is
    swept = hamelin.sweep("../tries")
    assert swept.run["run"] == 2 and swept.run["crashed"] == 0
    assert {record["outcome"] for record in swept.records()} == {"timeout"}
    (tmp_path / "mine.py").write_text("class Mine:\n    pass\n")
    with pytest.raises(hamelin.Error, match="mine.py: has changed since the sweep was planned"):
        hamelin.sweep("../tries", fresh=True)


@pytest.mark.parametrize(
    "wrong, text",
    [
        ({"goal": "far"}, "goal: 'far', expected one of joint, position, pose"),
        ({"pairs": 0}, "pairs: 0, expected 1"),
        ({"sizes": [1.0]}, "sizes"),
        ({"keep_out": [1.0, 2.0]}, "keep_out"),
        ({"mark": "all"}, "mark|all"),
        ({"planner": "python:mine.py"}, "expected python:FILE:CLASS"),
        ({"sphere_on_path": 0.05, "swing": [0.1, -1.0]}, "swing"),
        ({"sphere_on_path": 0.05, "prediction": "magic"}, "prediction: 'magic'"),
    ],
)
def test_wrong_plans(scenes, tmp_path, wrong, text):
    with pytest.raises(hamelin.Error, match=text):
        hamelin.plan_sweep(tmp_path / "tries", scenes / "pillar.json", **wrong)
    with pytest.raises(TypeError):
        hamelin.plan_sweep(tmp_path / "tries", scenes / "pillar.json", clutter="many")


def test_the_data_that_ships():
    assert hamelin.load_scene(hamelin.data_path("scenes/shelf.json")).model.dof == 7
    with pytest.raises(hamelin.Error, match="does not exist, expected one of"):
        hamelin.data_path("scenes/missing.json")


def test_planners_are_compared_and_runs_are_a_table(program, scenes, tmp_path):
    for folder in ("tries", "again"):
        hamelin.plan_sweep(
            tmp_path / folder, scenes / "pillar.json", planner=["apf", "hybrid"], duration=0.04,
            seeds=[1, 2],
        )  # fmt: skip
    swept = hamelin.sweep(tmp_path / "tries")
    again = hamelin.sweep(tmp_path / "again")

    def of_program(*arguments):
        done = subprocess.run([program, "sweep", *arguments], stdout=subprocess.PIPE, check=True)
        return done.stdout.decode()

    compared = json.loads(of_program("compare", tmp_path / "tries", "--json"))
    assert swept.compare() == compared
    assert compared["comparisons"][0]["pairs"] == 2
    both = json.loads(of_program("compare", tmp_path / "tries", tmp_path / "again", "--json"))
    assert swept.compare(again) == swept.compare(tmp_path / "again") == both
    assert both["comparisons"][0]["pairs"] == 4
    by_seed = swept.compare(label="seed", ignore="goal")["comparisons"]
    assert [(one["a"], one["b"]) for one in by_seed] == [("1", "2")]
    with pytest.raises(hamelin.Error, match="--label colour: no run has that label"):
        swept.compare(label="colour")

    pandas = pytest.importorskip("pandas")
    table = swept.to_pandas()
    of_program("merge", tmp_path / "tries", "--csv", tmp_path / "tries.csv")
    pandas.testing.assert_frame_equal(table, pandas.read_csv(tmp_path / "tries.csv"))
    assert sorted(table.planner) == ["apf", "apf", "hybrid", "hybrid"]
    assert (table.outcome == "timeout").all()


def test_shards_give_the_records_of_the_whole(scenes, tmp_path):
    arguments = {"scenes": scenes / "pillar.json", "planner": ["hybrid", "apf"], "duration": 0.05}
    whole = hamelin.sweep(tmp_path / "whole", seeds=range(1, 4), jobs=1, **arguments)
    for index in (2, 1):
        parts = hamelin.sweep(tmp_path / "parts", seeds=range(1, 4), shard=f"{index}/2", **arguments)
    assert len(list((tmp_path / "parts").glob("records-*-of-2.jsonl"))) == 2
    names = [[record["id"] for record in sweep.records()] for sweep in (whole, parts)]
    assert len(names[0]) == 6 and names[0] == names[1]
    with pytest.raises(hamelin.Error, match="'3/2' is not a shard"):
        hamelin.sweep(tmp_path / "parts", shard="3/2")
