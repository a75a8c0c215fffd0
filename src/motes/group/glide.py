"""Several steps of a group in one pass, while lists hold and particles do nothing but move.

A step of ten thousand particles lasts a millisecond, and has some ten kernels; here those of a few
steps are a relay, with nothing between them. Where lists of clusters do not hold any more it stops,
and the step is finished kernel by kernel: results are those of single steps, to the last bit.
"""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from motes.group.lasting import Lasting
from motes.group.members import Member
from motes.group.methods import split, turns
from motes.jit import BRIEF, even_blocks, jit
from motes.pool import AT_ONCE
from motes.repeat import Relay, Repeat, Repeats
from motes.state import Particles
from motes.step import Interval
from motes.tableau import Splitting

if TYPE_CHECKING:
    from motes.group.group import Group

TOGETHER = 32
"""Most steps of a relay: lists of clusters last about as long."""

LOOK = 1 << 22
"""Particles divided by calls of a relay after which a thread looks whether it was interrupted."""


@jit
def clear(push: Any, begin: Any, end: Any) -> None:
    """Take accelerations (3, n) to 0."""
    for axis in range(3):
        push[axis][begin:end] = 0


class Glide:
    """Takes one group through steps."""

    def __init__(self, group: Group) -> None:
        self.group, self._calls = group, Repeats()
        self._stopped = np.zeros(1, np.int64)
        nearby = group.nearby
        more = (group.interactions, group.exchanges, group.constraints.laws, group.captures.laws)
        self.possible = (
            isinstance(group.method, Splitting)
            and bool(nearby.classes)
            and not (any(more) or nearby.depends_on_velocity)
            and all(s.system.surfaces is None for s in group.steppers.values())
        )
        """Whether forces within reach are all that happens to particles besides their motion."""

    def __call__(
        self, systems: dict[str, Particles], times: Sequence[float], memory: Lasting,
        closing: Sequence[Repeat],
    ) -> int:  # fmt: skip
        """Take undisturbed systems through some of the steps between these times, with calls that
        close each.

        Returns through how many, 0 where a step has to be taken by itself, as after births.
        """
        if not all(lists is not None and lists.settled for lists in memory.lists):
            return 0
        steps = len(times) - 1
        method, kept = self.group.method, {}
        assert isinstance(method, Splitting)
        for name in self.group.steppers:
            kept[name] = systems[name].count, systems[name].deaths
        known = memory.push is not None and memory.time == times[0]
        sums, lasts = _sums(method, known)
        if memory.kept != kept or known != lasts or not memory.pushes.keys() >= kept.keys():
            return 0
        members = {n: self.group.member(n, systems[n], systems[n].count, memory) for n in kept}
        relay = self._relay(members, method, sums, times, memory, closing)
        if relay is None:
            return 0
        self._stopped.fill(0)
        memory.push = None  # Whoever interrupts it finds no push of other places.
        relay.run()
        self.group.nearby.relayed(memory, bool(self._stopped[0]))
        if not self._stopped[0]:
            memory.steps += steps
            if lasts:
                memory.push = {name: memory.pushes[name] for name in kept}
                memory.time = times[-1]
            return steps
        step, turn = divmod(int(self._stopped[0]) - 1, len(turns(method)))
        memory.steps += step + 1
        interval = Interval(times[step], times[step + 1])
        split(self.group, members, interval, method, memory, turn)
        for calls in closing:
            calls()
        return step + 1

    def _relay(
        self, members: dict[str, Member], method: Splitting, sums: Sequence[bool],
        times: Sequence[float], memory: Lasting, closing: Sequence[Repeat],
    ) -> Relay | None:  # fmt: skip
        """All calls of a step, with the numbers of several, or None where lists must be built."""
        pushes = {name: memory.pushes[name] for name in members}
        bodies = {name: member.body(times[0]) for name, member in members.items()}
        plans = self.group.nearby.plans(bodies, pushes, memory)
        if plans is None:
            return None
        at_once = max(AT_ONCE, LOOK // max(m.alive for m in members.values()))
        relay, each = Relay(len(times) - 1, self._stopped, at_once), len(turns(method))
        begin, end = np.array(times[:-1]), np.array(times[1:])
        length = end - begin
        for name, member in members.items():
            member.push = pushes[name]
        for turn, (kick, drift, place) in enumerate(turns(method)):
            if sums[turn]:
                for name, member in members.items():
                    parts, brief = even_blocks(member.alive), member.alive <= BRIEF
                    relay.add(self._calls(("clear", name), clear, (member.push,), parts, brief))
                numbers = 1 + turn + each * np.arange(length.size)
                for plan in plans:
                    plan(relay, numbers[:, None])
            for name, share in (("kick", kick), ("drift", drift)):
                if share:
                    time = end if place == 1.0 else begin + place * length
                    numbers = np.stack((time, share * length), axis=1)
                    for member in members.values():
                        relay.add(member.calls(name, member.K), numbers)
        for calls in closing:
            relay.add(calls)
        self.possible = relay.possible
        return relay if relay.possible else None


def _sums(method: Splitting, known: bool) -> tuple[list[bool], bool]:
    """In which turns of a step forces are summed up, and whether the next step can use the last.

    `known` says whether those at the begin are known from the step before.
    """
    last, found = 0.0 if known else None, []
    for kick, drift, place in turns(method):
        found.append(bool(kick) and last != place)
        last = None if drift else place if kick else last
    return found, last == 1.0
