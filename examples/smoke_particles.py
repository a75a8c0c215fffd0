"""Processing's "Smoke Particle System": soft puffs in a wind that turns. 100 pixels are 1 m."""

import motes

wind = {"over": "time", "interpolation": "smooth", "keys": [[0, [-2, 0, 0]], [3, [3, 0, 0]]]}
smoke = motes.System(
    "smoke",
    emit=[motes.emit.Point(rate=120, velocity={"normal": [[0, 0, 1.2], 0.18]})],
    force=[motes.force.Gravity(g={**wind, "after": "pingpong"})],
    life=1.5,
    size=0.4,
    color={"over": "life", "stops": [[0, "#ffffff60"], [1, "#ffffff00"]]},
    look=motes.look.Sprites(emission=0.12),
)
camera = motes.Camera(position=(0, -20, 1.2), look_at=(0, 0, 1.2), field_of_view=10.3)
sky = motes.Sky(zenith="#000000", horizon="#000000", ground="#000000", sun_strength=0)
film = motes.Film(size=(640, 360))
scene = motes.Scene(systems=[smoke], camera=camera, sky=sky, film=film)
print(motes.film(scene, "smoke_particles", form="webp").film)
