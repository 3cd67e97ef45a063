# How near an arm is to the boards of a shelf, and where.
import hamelin

scene = hamelin.load_scene("data/scenes/shelf.json")
environment = scene.environment(influence=0.5)
for step in range(5):
    q = scene.start_q + 0.1 * step
    near = min(environment.contacts(q, influence=0.5), key=lambda contact: contact["distance_m"])
    height = near["obstacle_point_m"][2]
    print(f"{0.1 * step:.1f} rad: {near['distance_m']:.6f} m, at height {height:.3f} m")
