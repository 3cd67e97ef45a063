"""hamelin: move robot arms through cluttered 3D maps, and simulate them.

Units are SI, angles are in radians, arrays are float64 in C order. A joint vector has shape (n,),
N states have shape (N, n), a pose is a homogeneous matrix of shape (4, 4). Bad input raises
hamelin.Error, which is a ValueError; arguments of a wrong type raise TypeError.

    import hamelin
    arm = hamelin.load_robot("arm7.urdf")
    acceleration = arm.aba(q, v, tau)
    result = hamelin.run("shelf.json", log="shelf.jsonl")
    hamelin.read_log("shelf.jsonl").plot()
"""

from ._accuracy import AccuracyResult, accuracy
from ._data import data_path
from ._error import Error
from ._hamelin import (
    Answer,
    Channels,
    Command,
    Controller,
    Environment,
    EventFinder,
    Integrator,
    LogStream,
    Model,
    PlannerSetup,
    Scene,
    State,
    StepReport,
    Tick,
    World,
    Wrench,
    __version__,
    check_robot,
    instruction_set,
    integrator_names,
    load_robot,
    make_chain,
    plugin_path,
)
from ._logs import Log, read_log
from ._motions import (
    Explanation,
    Motion,
    PathMotion,
    PathPlan,
    explain,
    optimize,
    plan,
    postures,
    task,
)
from ._pages import Page, report
from ._robots import FitResult, fit_robot, robot_info
from ._runs import Result, Verification, full_config, integrate, load_scene, run, verify
from ._sweeps import Sweep, plan_sweep, sweep

__all__ = [
    "AccuracyResult",
    "Answer",
    "Channels",
    "Command",
    "Controller",
    "Environment",
    "Error",
    "EventFinder",
    "Explanation",
    "FitResult",
    "Integrator",
    "Log",
    "LogStream",
    "Model",
    "Motion",
    "Page",
    "PathMotion",
    "PathPlan",
    "PlannerSetup",
    "Result",
    "Scene",
    "State",
    "StepReport",
    "Sweep",
    "Tick",
    "Verification",
    "World",
    "Wrench",
    "__version__",
    "accuracy",
    "check_robot",
    "data_path",
    "explain",
    "fit_robot",
    "full_config",
    "instruction_set",
    "integrate",
    "integrator_names",
    "load_robot",
    "load_scene",
    "make_chain",
    "optimize",
    "plan",
    "plan_sweep",
    "postures",
    "plugin_path",
    "read_log",
    "report",
    "robot_info",
    "run",
    "sweep",
    "task",
    "verify",
]
