# Your own loop: measure, ask for a torque, send it. A ball appears on the way.
import sys

import hamelin

scene = hamelin.load_scene("data/scenes/clutter.json")
# searches in this thread: the same result in each run
controller = hamelin.Controller(scene, guide_thread=False)

# A simulated arm, in place of the driver of your robot.
robot = hamelin.Integrator(scene.model, "rk4")
measured = robot.start(scene.start_q)

ball = {"type": "sphere", "name": "ball", "radius_m": 0.1, "position_m": [1.5, 0.0, 0.5]}

clearance_m = 1.0
for k in range(20000):
    if k == 100:
        controller.world.set_obstacle(ball)  # any thread may do this
    time_s = k * controller.period_s
    answer = controller.tick(time_s, measured.q, robot.velocity(measured))
    controller.run_guide()
    clearance_m = min(clearance_m, controller.clearance_m)
    if answer.state == "reached":
        print(f"reached after {time_s:.3f} s, clearance {clearance_m:.6f} m at least")
        sys.exit(0)
    torque = hamelin.Channels(held_torque=answer.torque)
    if not robot.step(measured, controller.period_s, torque).converged:
        sys.exit(1)
sys.exit(1)
