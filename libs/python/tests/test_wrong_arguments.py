"""Random wrong arguments raise exceptions and never crash. HAMELIN_WRONG_CALLS sets how many."""

import inspect
import os
import pickle
import random

import hamelin
import numpy as np
import pytest

CALLS = int(os.environ.get("HAMELIN_WRONG_CALLS", "20000"))


def wrong_values(random_, objects):
    """A value that may be wrong in type, shape, strides or content."""
    n = random_.choice([0, 1, 3, 6, 7, 7, 7, 8, 20])
    make = [
        lambda: None,
        lambda: random_.choice([0, 1, -1, 7, 2**31, -(2**63), 2**70]),
        lambda: random_.choice([0.0, -1.0, 1e-3, 1e308, float("nan"), float("inf"), -float("inf")]),
        lambda: random_.choice(["", "x", "rk4", "gauss:8", "a:b:c", "\0", "é" * 50, "\ud800"]),
        lambda: random_.choice([b"", b"\xff\0", True, 1j, object(), print, int, ...]),
        lambda: [random_.choice([0, 1.5, "a", None, []]) for _ in range(n)],
        lambda: {random_.choice(["q", "type", 5]): random_.choice([1, "x", [], {}])},
        lambda: np.zeros(n),
        lambda: np.full(n, random_.choice([np.nan, np.inf, 1e300, 0.1])),
        lambda: np.zeros((random_.choice([0, 1, 2, 40]), n)),
        lambda: np.zeros((2, 3, n)),
        lambda: np.arange(4.0 * n)[:: random_.choice([2, 3, -1, 4])],
        lambda: np.zeros((n, 40)).T,
        lambda: np.asfortranarray(np.ones((33, 7))),
        lambda: np.zeros(n, dtype=random_.choice(["f4", "i8", ">f8", "c16", "U3", "O", "?", "M8[s]"])),
        lambda: np.frombuffer(b"\1" * (8 * n + 1), dtype=np.uint8)[1:].view(np.float64),
        lambda: np.broadcast_to(1.0, (n,)),
        lambda: np.array(1.0),
        lambda: np.eye(4),
        lambda: random_.choice(objects),
    ]
    return random_.choice(make)()


def callables(objects):
    """All methods and functions that take arguments, with what they belong to."""
    found = []
    skipped = {"save", "sweep", "accuracy", "fit_robot", "plot", "to_pandas"}
    for name in hamelin.__all__:
        member = getattr(hamelin, name)
        if inspect.isclass(member):
            found.append((name, None, member))
        elif callable(member) and name not in skipped:
            found.append((name, None, member))
    for owner in objects:
        for name in dir(type(owner)):
            value = getattr(type(owner), name)
            if callable(value) and name not in skipped and (
                not name.startswith("_") or name in ("__deepcopy__", "__setstate__")
            ):
                found.append((f"{type(owner).__name__}.{name}", owner, value))
    return found


def arguments_of(function, random_, objects):
    names = []
    line = (function.__doc__ or "").split("\n", 1)[0]
    if "(" in line and ":" in line:
        inner = line[line.index("(") + 1 :]
        names = [part.split(":")[0].strip() for part in inner.split(",") if ":" in part]
        names = [name for name in names if name.isidentifier() and name != "self"]
    args = [wrong_values(random_, objects) for _ in range(random_.randint(0, 4))]
    kwargs = {
        name: wrong_values(random_, objects)
        for name in random_.sample(names, random_.randint(0, len(names)))
    }
    return args, kwargs


@pytest.fixture()
def objects(arm, scenes, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scene = hamelin.load_scene(scenes / "pillar.json", duration=0.002)
    integrator = hamelin.Integrator(arm)
    other = hamelin.Integrator(hamelin.make_chain(links=3), "rk4")
    log = tmp_path / "log.jsonl"
    hamelin.run(scene, log=log)
    stream = hamelin.LogStream(log)
    list(stream)
    return [
        arm,
        hamelin.make_chain(links=7),
        scene,
        scene.environment(),
        integrator,
        other,
        integrator.start(np.zeros(7)),
        other.start(np.zeros(3)),
        hamelin.Channels(damping=np.ones(3)),
        hamelin.Channels(held_torque=np.ones(7), gyroscopic=[(99, [0, 0, 0], [1, 1, 1])]),
        hamelin.Controller(scene),
        hamelin.Controller(scene).world,
        stream,
    ]


def call(name, owner, function, args, kwargs):
    # Simulations and chains of any length would take too long.
    if name == "make_chain" and any(isinstance(a, int) and a > 100 for a in kwargs.values()):
        return
    if name.endswith("simulate"):
        kwargs = {**kwargs, "step": 0.001, "duration": 0.002}
    try:
        result = function(*args, **kwargs) if owner is None else function(owner, *args, **kwargs)
        repr(result)
    except (Exception, KeyboardInterrupt) as error:
        expected = (ValueError, TypeError, KeyError, OSError, OverflowError, IndexError,
                    AttributeError, MemoryError, StopIteration, RecursionError, BufferError)  # fmt: skip
        assert isinstance(error, expected), f"{name}{args!r:.400}{kwargs!r:.400}: {error!r}"
        assert "SystemError" not in str(error)


def test_random_wrong_arguments(objects):
    random_ = random.Random(20)
    functions = callables(objects)
    assert len(functions) > 100
    for _ in range(CALLS):
        name, owner, function = random_.choice(functions)
        args, kwargs = arguments_of(function, random_, objects)
        call(name, owner, function, args, kwargs)


def test_objects_outlive_what_they_came_from(scenes, arm):
    scene = hamelin.load_scene(scenes / "pillar.json")
    environment, model = scene.environment(), scene.model
    integrator = hamelin.Integrator(hamelin.make_chain(links=3))
    state = integrator.start(np.zeros(3))
    del scene
    assert environment.clearance(np.zeros(7)) is not None
    assert model.aba(np.zeros(7), np.zeros(7), np.zeros(7)).shape == (7,)
    integrator.step(state, 0.001)
    wrong = hamelin.Integrator(arm, "rk4")
    with pytest.raises(hamelin.Error):
        wrong.step(state, 0.001)
    for type_ in (hamelin.Model, hamelin.Scene, hamelin.Integrator, hamelin.Controller):
        empty = type_.__new__(type_)  # not initialised
        for attribute in dir(type_):
            if attribute.startswith("_"):
                continue
            with pytest.raises((TypeError, ValueError, AttributeError)):
                value = getattr(empty, attribute)
                value(*[np.zeros(7)] * 3)


def test_pickles_of_others_are_refused(arm):
    for state in ((), (1,), ("{}", None, None), ("nonsense", np.eye(4), np.zeros(3)), ("{}", 1, 2)):
        empty = hamelin.Model.__new__(hamelin.Model)
        with pytest.raises((ValueError, TypeError, RuntimeError)):
            empty.__setstate__(state)
    assert pickle.loads(pickle.dumps(arm)).dof == 7
