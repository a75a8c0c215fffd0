"""Processing's "Flocking": keep apart, fly alike, stay together. 20 of its pixels are 1 m."""

from motes import Camera, Film, Periodic, Scene, System, emit, film, force, interact, look

birth = {"burst": [{"count": 150}], "velocity": {"low": [-2, -2, 0], "high": [2, 2, 0]}}
boids = System(
    "boids",
    emit=[emit.Box(size=(32, 18, 0), **birth)],
    force=[force.Cruise(speed=3), force.Agility(top_speed=4, turn=180)],
    size=0.6,
    look=look.Fish(opacity=1.0),
)
rules = interact.Separation(radius=1.25), interact.Alignment(radius=2.5), interact.Cohesion()
motion = {"integrator": "semi_implicit_euler", "step": 0.04, "duration": 3}
space = Periodic(low=(-16, -9, -1), size=(32, 18, 0))
camera = Camera(position=(0, 0, 24), look_at=(0, 0, 0), up=(0, 1, 0))
small = Film(size=(640, 360), fps=12)
scene = Scene(systems=[boids], interact=rules, periodic=space, camera=camera, film=small, **motion)
print(film(scene, "flocking", form="webp").film)
