"""Systems that feel each other and therefore take every stage of a step together.

Begin with `group`, the step. `members` is who takes part, `methods` how a step is divided into
stages, `partners` which systems an interaction is about. Pushes come from `nearby` (laws of limited
reach over neighbour lists, which `lasting` keeps) and `swarm` (gathering laws over cells, without
lists); `constrain` holds laws of velocities (crowds), `capture` who catches whom.
"""

from motes.group.group import Group
from motes.group.members import Bodies, Movers, Occasion
from motes.group.partners import joined, linked

__all__ = ["Bodies", "Group", "Movers", "Occasion", "joined", "linked"]
