"""Kernels of a processor with AVX-512, on any: its two instructions are done by others here.

What such a processor would run is compiled for it as well, with its own instructions.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from both_ways import WITH_COMPILER
from llvmlite import binding

pytestmark = [
    *WITH_COMPILER,
    pytest.mark.skipif(
        not binding.get_process_triple().startswith("x86_64"), reason="AVX-512 is of x86"
    ),
]

PROCESSORS = ("skylake-avx512", "znver4")


def test_sums_of_gravity_in_sixteen_lanes(tmp_path: Path) -> None:
    run = [sys.executable, __file__]
    environment = os.environ | {"MOTES_CACHE": str(tmp_path)}
    done = subprocess.run(run, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "zmm" in done.stdout


ESTIMATE = """
define internal <16 x float> @rough(<16 x float> %x, <16 x float> %old, i16 %mask) {
  %root = call <16 x float> @llvm.sqrt.v16f32(<16 x float> %x)
  %y = fdiv <16 x float> splat (float 1.0), %root
  %whole = bitcast <16 x float> %y to <16 x i32>
  %rough = and <16 x i32> %whole, splat (i32 -512)
  %found = bitcast <16 x i32> %rough to <16 x float>
  ret <16 x float> %found
}
"""
"""1 / root with the 14 bits that the instruction vouches for."""

ROOT = "declare <16 x float> @llvm.sqrt.v16f32(<16 x float>)"

COMPRESSION = """
define internal <16 x i32> @compressed(<16 x i32> %x, <16 x i32> %old, <16 x i1> %mask) {
begin:
  br label %next
next:
  %k = phi i32 [0, %begin], [%more, %next]
  %count = phi i32 [0, %begin], [%new, %next]
  %sum = phi <16 x i32> [%old, %begin], [%kept, %next]
  %value = extractelement <16 x i32> %x, i32 %k
  %counts = extractelement <16 x i1> %mask, i32 %k
  %with = insertelement <16 x i32> %sum, i32 %value, i32 %count
  %kept = select i1 %counts, <16 x i32> %with, <16 x i32> %sum
  %step = zext i1 %counts to i32
  %new = add i32 %count, %step
  %more = add i32 %k, 1
  %ends = icmp eq i32 %more, 16
  br i1 %ends, label %done, label %next
done:
  ret <16 x i32> %kept
}
"""
"""The lanes that count, one after another; what follows them is of no account."""

INSTEAD = {
    "@llvm.x86.avx512.rsqrt14.ps.512": ("@rough", ESTIMATE),
    "@llvm.x86.avx512.mask.compress.v16i32": ("@compressed", COMPRESSION),
}


def without_its_instructions(text: str) -> str:
    """A module that does the same on this processor."""
    for name, (other, meaning) in INSTEAD.items():
        if name in text:
            lines = [x for x in text.splitlines() if not (x.startswith("declare") and name in x)]
            text = "\n".join(lines).replace(name, other) + meaning
    return text if ROOT in text or "@rough" not in text else text + ROOT


def compiled_for(processor: str, text: str) -> str:
    """Assembly of a module for another processor, after all optimisations."""
    machine = binding.Target.from_triple(binding.get_process_triple()).create_target_machine(
        cpu=processor, features="-prefer-256-bit", opt=3
    )
    module = binding.parse_assembly(text, binding.create_context())
    module.verify()
    builder = binding.create_pass_builder(machine, binding.create_pipeline_tuning_options(3))
    builder.getModulePassManager().run(module, builder)
    return str(machine.emit_assembly(module))


def main() -> None:
    """Sums by both methods against sums in lanes of one, and all kernels for AVX-512."""
    from motes.machine import target

    had, texts, compiles = target.has, [], target.object_code
    target.has = lambda name: name == "avx512f" or had(name)

    def object_code(text: str) -> bytes:
        texts.append(text)
        return compiles(without_its_instructions(text))

    target.object_code = object_code

    import numpy as np

    from motes import gravity
    from motes.interact.gravity.lanes import LANES

    assert LANES == 16
    rng = np.random.default_rng(0)
    x, m = rng.normal(size=(2000, 3)), rng.random(2000)
    d = x[None] - x[:, None]
    r2 = (d**2).sum(axis=2) + np.eye(len(x))
    exact = np.einsum("j,ijk->ik", m, d / r2[..., None] ** 1.5)
    multipole = {"tolerance": 1e-3, "method": "multipole"}
    rounding = {real: 32 * float(np.finfo(real).eps) for real in (np.float32, np.float64)}
    for real, options, most in (
        *((real, {}, most) for real, most in rounding.items()),
        (np.float32, multipole, 1e-3),
    ):
        a = gravity.acceleration(x.astype(real), m, **options)
        error = np.sqrt(((a - exact) ** 2).sum() / (exact**2).sum())
        assert error < most, (real, options, error)
    wide = [text for text in texts if any(name in text for name in INSTEAD)]
    for name in INSTEAD:
        assert any(name in text for text in wide), name
    for processor in PROCESSORS:
        for text in wide:
            assembly = compiled_for(processor, text)
            for name, instruction in zip(INSTEAD, ("vrsqrt14ps", "vpcompressd"), strict=True):
                assert name not in text or instruction in assembly, (processor, name)
    print(len(wide), "kernels with zmm registers" if "zmm" in assembly else "kernels")


if __name__ == "__main__":
    main()
