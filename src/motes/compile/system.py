"""One system, compiled: its arrays of numbers and its kernels.

Two modules are generated for a system, one in the scene's precision for the SIMD loops and one in
double precision for rows that need care (newborns and impacts), and one for each emitter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.catalog import Component
from motes.compile.advance import write_motion
from motes.compile.births import Channels, births_kernel, write_draws, write_emitter
from motes.compile.impacts import (
    currents_kernel,
    exceptions_kernel,
    rebounds_kernel,
    write_flight,
)
from motes.compile.motion import KEPT, Motion
from motes.compile.staged import write_staged, write_threats
from motes.compile.straight import write_potentials, write_straight
from motes.compile.surfaces import Surfaces, write_surfaces
from motes.compile.text import Text
from motes.compile.threat import write_threat
from motes.compile.values import Column
from motes.state import Particles

Addressed = Sequence[tuple[str, Component]]


@dataclass(frozen=True)
class CompiledEmitter:
    """An emitter's kernel and what it reads."""

    kernel: Any
    K: tuple[Any, ...]
    channels: np.ndarray[Any, Any]


class CompiledSystem:
    """Everything that steps one system; machine code is made (or loaded) at the first call."""

    def __init__(
        self, motion: Motion, solids: Addressed, emitters: Addressed, precision: str, strict: bool
    ) -> None:
        self.motion = motion
        hard = self._hard = [(a, s) for a, s in solids if s.values["collides"].document()]
        self.fast = Text(precision, strict)
        write_motion(self.fast, motion)
        self.surfaces = self._solid(self.fast, hard)
        write_straight(self.fast, motion, self.surfaces)
        self.fast.add(self.fast.values.scene_text())
        self.exact = Text("double", strict)
        write_motion(self.exact, motion)
        write_flight(self.exact, motion)
        self.exact.add(self.exact.values.scene_text())
        # Apart from the motion, so that a change of forces leaves its machine code as it is.
        self.solid = Text("double", strict)
        self._solid(self.solid, hard)
        self.solid.add(self.solid.values.scene_text())
        self.columns = self._columns()
        self._emitters, self._strict = emitters, strict
        self.K = self.fast.values.arrays(self.fast.real)
        self.K_exact = self.exact.values.arrays(np.float64)
        self.K_solid = self.solid.values.arrays(np.float64)

    def _solid(self, text: Text, solids: Addressed) -> Surfaces | None:
        if not solids:
            return None
        surfaces = write_surfaces(text, solids)
        write_threat(text, self.motion, surfaces)
        return surfaces

    def _columns(self) -> list[Column]:
        """Columns of the kernels first, then traits that only drawing reads."""
        columns = list(self.fast.values.columns)
        known = {c.address for c in columns}
        for name, (address, control) in self.motion.traits.items():
            drawn = control.scope == "birth" or (name in KEPT and hasattr(control, "spline"))
            if drawn and address not in known:
                columns.append(Column(address, control, name))
        return columns

    @cached_property
    def _fast_module(self) -> dict[str, Any]:
        return self.fast.module()

    @property
    def straight(self) -> Any:
        """Kernel: a step of every row in a range; rows that might meet a solid are only flagged."""
        return self._fast_module["straight"]

    @property
    def young(self) -> Any:
        """Kernel: newborns from their births to the step's end; None where values vary in time."""
        return self._fast_module.get("young")

    @property
    def retire(self) -> Any:
        """Kernel: flags the dead among rows that took no straight path."""
        return self._fast_module["retire"]

    @cached_property
    def _staged_module(self) -> tuple[dict[str, Any], Any]:
        text = Text(self.fast.precision, self._strict)
        write_motion(text, self.motion)
        write_staged(text, self.motion)
        surfaces = self._solid(text, self._hard)
        if surfaces is not None:
            write_threats(text, surfaces)
        text.add(text.values.scene_text())
        return text.module(), text.values.arrays(text.real)

    def staged(self, name: str) -> Any:
        """Kernel `slope`, `kick`, `drift` or `threats`, for systems that are part of a group."""
        return self._staged_module[0][name]

    @property
    def K_staged(self) -> Any:
        """What the staged kernels read."""
        return self._staged_module[1]

    @cached_property
    def _exact_module(self) -> dict[str, Any]:
        return self.exact.module()

    @cached_property
    def exceptions(self) -> Any:
        """Kernel: given rows through the step, from their birth, through impacts."""
        return exceptions_kernel(
            self._exact_module, self.solid.module(), self.motion, self.surfaces
        )

    @cached_property
    def rebounds(self) -> Any:
        """Kernel: given rows of a group through their impacts."""
        assert self.surfaces is not None
        return rebounds_kernel(self._exact_module, self.solid.module(), self.motion, self.surfaces)

    def potential(self, particles: Particles, time: float) -> NDArray[np.float64]:
        """Potential (n,) [m2/s2] of the forces that have one, at each particle."""
        result = np.zeros(particles.count)
        if any(force.kernel("potential") for _, force in self.motion.forces):
            kernel, numbers = self._potentials
            kernel(
                particles.position, particles.velocity, particles.birth, particles.columns,
                numbers, time, result, 0, particles.count,
            )  # fmt: skip
        return result

    @cached_property
    def _potentials(self) -> tuple[Any, Any]:
        """The kernel of potentials, and the numbers that it reads."""
        text = Text("double", self._strict)
        write_potentials(text, self.motion)
        text.add(text.values.scene_text())
        return text.module()["potentials"], text.values.arrays(np.float64)

    def carried(self, particles: Particles, time: float) -> NDArray[np.float64]:
        """Velocity (n, 3) [m/s] that the flows give to particles that have none of their own."""
        result = np.empty((particles.count, 3))
        currents = currents_kernel(self._exact_module)
        currents(particles.position, particles.birth, particles.columns, self.K_exact, time, result)
        return result

    @cached_property
    def emitters(self) -> dict[str, CompiledEmitter]:
        """Kernels and numbers of the emitters, by address."""
        traits = Text("double", self._strict)
        self._trait_channels = Channels()
        write_draws(traits, self.columns, self._trait_channels)
        traits.add(traits.values.scene_text())
        self.K_traits = traits.values.arrays(np.float64)
        from motes.compile.births import normals, uniforms

        extra = {"uniforms": uniforms, "normals": normals}
        trait_module = traits.module(extra)
        width = sum(c.width for c in self.columns)
        result = {}
        for address, emitter in self._emitters:
            text, channels = Text("double", self._strict), Channels()
            write_emitter(text, emitter, address, channels)
            text.add(text.values.scene_text())
            steady = not (text.values.varies_in_time or traits.values.varies_in_time)
            kernel = births_kernel(
                text.module(extra), trait_module, width, self.motion.inertial, steady
            )
            result[address] = CompiledEmitter(
                kernel, text.values.arrays(np.float64), channels.array()
            )
        return result

    @property
    def trait_channels(self) -> Any:
        """Channels of the system's columns."""
        return self._trait_channels.array()
