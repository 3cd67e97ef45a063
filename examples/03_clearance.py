# How near an arm is to the boards of a shelf and to itself, and which parts are the nearest.
import hamelin

scene = hamelin.load_scene("data/scenes/shelf.json")
environment = scene.environment(influence=0.5)  # contacts up to 0.5 m
for step in range(5):
    q = scene.start_q + 0.1 * step
    near = min(environment.contacts(q), key=lambda contact: contact["distance_m"])
    print(f"{0.1 * step:.1f} rad: {near['distance_m']:.6f} m to the shelf", end="")
    height = near["obstacle_point_m"][2]
    print(f" at height {height:.3f} m, {environment.self_clearance(q):.6f} m to itself")
