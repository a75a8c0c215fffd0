"""People, or others, who come in parties."""

from motes.catalog import Integer, Number, Vector, component, quantity
from motes.kernel import floor, kernel


@component
class Parties:
    """Births in parties: `members` after one another side by side, the parties evenly over a box.

    Places of parties follow the additive sequence of the plastic number g, fractions of j / g and
    j / g^2, so that they keep apart from the beginning: Roberts, The unreasonable effectiveness of
    quasirandom sequences (2018). The interaction `party` keeps a party together.
    """

    members: Integer = quantity(3, at_least=1)
    """How many births are a party."""

    size: Vector = quantity((10.0, 10.0, 0.0), "m", at_least=0)
    """Edge lengths of the box."""

    spacing: Vector = quantity((0.6, 0.0, 0.0), "m")
    """From one member to the next."""

    scatter: Number = quantity(0.1, "m", at_least=0)
    """How far, at most, a member stands beside that place along each axis."""

    draws = 3

    @kernel
    def birth(p, u, t, k):
        party = floor((k - 0.5) / p.members)
        beside = k - p.members * party - 0.5 * (p.members + 1.0)
        one, two = 0.7548776662466927 * party, 0.5698402909980532 * party
        x = p.size[0] * (one - floor(one) - 0.5) + beside * p.spacing[0]
        y = p.size[1] * (two - floor(two) - 0.5) + beside * p.spacing[1]
        z = beside * p.spacing[2]
        away = 2.0 * p.scatter
        flat = 1.0 if p.size[2] > 0.0 else 0.0
        x += away * (u[0] - 0.5)
        y += away * (u[1] - 0.5)
        z += flat * (p.size[2] + away) * (u[2] - 0.5)
        return x, y, z, 0.0, 0.0, 0.0
