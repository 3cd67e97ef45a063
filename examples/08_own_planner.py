# A planner of your own, a class: springs and dampers at the joints. `hamelin run --planner
# python:examples/08_own_planner.py:Springs` runs it too.
import numpy as np

import hamelin


class Springs:
    params_schema = {
        "type": "object",
        "additionalProperties": False,
        "properties": {"k": {"type": "number", "minimum": 0, "default": 30.0}},
    }

    def __init__(self, k: float = 30.0) -> None:
        self.params = {"k": k}

    def start(self, setup: hamelin.PlannerSetup) -> None:
        self.arm = setup.model

    def tick(self, tick: hamelin.Tick, command: hamelin.Command) -> None:
        k = self.params["k"]
        command.held_torque = k * (tick.goal["q"] - tick.q) + self.arm.gravity_torque(tick.q)
        command.damping = np.full(self.arm.dof, 2.0 * np.sqrt(k))
