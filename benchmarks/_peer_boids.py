"""Blender's boids, run by a Python with the wheel bpy: prints {"M/s": figure}.

Rules separate and flock, flying, no obstacles, one step a frame.
"""

import json
import sys
import time

import bpy

FRAMES = 5


def main(n: int) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_cube_add(size=n ** (1 / 3))
    emitter = bpy.context.object
    emitter.modifiers.new("flock", "PARTICLE_SYSTEM")
    settings = emitter.particle_systems[0].settings
    settings.count, settings.frame_start, settings.frame_end = n, 1, 1
    settings.emit_from, settings.lifetime, settings.physics_type = "VOLUME", 1000, "BOIDS"
    scene = bpy.context.scene
    scene.frame_set(1)
    scene.frame_set(2)
    start = time.perf_counter()
    for frame in range(3, 3 + FRAMES):
        scene.frame_set(frame)
    seconds = time.perf_counter() - start
    print(json.dumps({"M/s": n * FRAMES / seconds / 1e6}))


main(int(sys.argv[1]))
