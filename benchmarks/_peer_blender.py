"""Blender's own particle system, run by a Python with the wheel bpy: prints {"M/s": figure}.

Newtonian particles under gravity, drag and a vortex field, RK4, one substep a frame.
"""

import json
import sys
import time

import bpy

FRAMES = 10


def main(n: int) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_cube_add(size=10)
    emitter = bpy.context.object
    emitter.modifiers.new("dust", "PARTICLE_SYSTEM")
    settings = emitter.particle_systems[0].settings
    settings.count, settings.frame_start, settings.frame_end = n, 1, 1
    settings.lifetime, settings.physics_type, settings.integrator = 1000, "NEWTON", "RK4"
    settings.drag_factor, settings.subframes = 0.1, 0
    bpy.ops.object.effector_add(type="VORTEX")
    scene = bpy.context.scene
    scene.frame_set(1)
    scene.frame_set(2)
    start = time.perf_counter()
    for frame in range(3, 3 + FRAMES):
        scene.frame_set(frame)
    seconds = time.perf_counter() - start
    print(json.dumps({"M/s": n * FRAMES / seconds / 1e6}))


main(int(sys.argv[1]))
