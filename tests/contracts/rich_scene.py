"""A scene that uses every part of the document and every form of TOML that is hard to scan."""

from __future__ import annotations

RICH = '''\
# A comment with [brackets], "quotes" and = signs.
title = "Brackets [ ] { } # and \\" in a text"
about = """
Several lines,
[not] = a "header" """
seed = 18446744073709551615
duration = 2.5
step = 0.02  # s
prewarm = 0.5
integrator = "leapfrog"
precision = "double"
mode = "strict"
film.fps = 25
film.size = [
  640,  # width
  360,
]
film.exposure = { over = "time", keys = [[0, 0], [1, 1]], interpolation = "smooth", after = "loop" }

[camera]
position = { over = "time", keys = [
    [0.0, [3, -6, 2]],
    [2.0, [4, -5, 2]],
] }
'look_at' = [0, 0, 1]
"up" = [0, 0, 1]
field_of_view = 35.0

[sky]
zenith = "#102040"
horizon = [0.1, 0.2, 0.3]
stars = 500

[[force]]
type = "gravity"
g = [0, 0, -1.62]

[[force]]
type = "wind"
name = "breeze"
velocity = { low = [0, 0, 0], high = [1, 1, 0] }
seed = 3

[[flow]]
type = "curl_noise"
octaves = 3

[[solid]]
type = "plane"
restitution = { over = "time", keys = [[0, 0.1], [1, 0.9]] }
visible = false

[[solid]]
type = "sphere"
name = "ball"
radius = 0.5
color = "#ff0000"

[[system]]
name = "water"
life = { normal = [2.0, 0.1] }
mass = { choice = [0.5, 1.0] }
size = { over = "life", interpolation = "bezier", keys = [
  [0, 0.01, [0, 0], [0.2, 0]],
  [1, 0.02, [-0.2, 0], [0, 0]],
] }
color = { over = "life", stops = [[0, "#4fa3ff"], [1, "#4fa3ff00"]] }
look = { type = "streaks", emission = 0.2 }
capacity = 100000

[[system.emit]]
type = "cone"
rate = 200
burst = [{ at = 1, count = 5 }, { at = 2, count = 5, every = 0.5, times = 3 }]
delay = 0.25
speed = { mean = 6, spread = 0.4 }

[[system.emit]]
type = "cone"
name = "second"
rate = { over = "time", keys = [[0, 0], [1, 20]] }

[[system.force]]
type = "drag"
rate = { over = "life", keys = [[0, 0.1], [1, 0.4]] }

[[system.retire]]
type = "leaves_box"
low = [-5, -5, -1]

[[system]]
name = "sparks"
integrator = "rk4"

[system.look]
type = "points"
opacity = 0.5

[[system.emit]]
type = "point"
[system.emit.rate]
over = "time"
keys = [[0, 0], [1, 20]]
'''
