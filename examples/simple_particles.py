"""Processing's "Simple Particle System": bubbles rise, fall and fade. 100 of its pixels are 1 m."""

import motes

balls = motes.System(
    "balls",
    emit=[motes.emit.Point(rate=60, velocity={"low": [-0.6, 0, 0], "high": [0.6, 0, 1.2]})],
    life=4.25,
    size=0.1,
    color={"over": "life", "stops": [[0, "#ffffff"], [1, "#ffffff00"]]},
    look=motes.look.Points(emission=0.6),
)
scene = motes.Scene(
    systems=[balls],
    force=[motes.force.Gravity(g=(0, 0, -1.8))],
    camera=motes.Camera(position=(0, -20, -1.3), look_at=(0, 0, -1.3), field_of_view=10.3),
    sky=motes.Sky(zenith="#000000", horizon="#000000", ground="#000000", sun_strength=0),
    film=motes.Film(size=(640, 360)),
)
print(motes.film(scene, "simple_particles", form="webp").film)
