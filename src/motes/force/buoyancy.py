"""Buoyancy of hot gas, less as it cools."""

from motes.catalog import Number, component, quantity
from motes.kernel import exp, kernel


@component
class Buoyancy:
    """Lift of a parcel that starts hot and cools: a = lift exp(-age / cooling) up."""

    lift: Number = quantity(3.0, "m/s2")
    """Acceleration at birth; g (T/T_air - 1) for a gas of temperature T."""

    cooling: Number = quantity(2.0, "s", above=0)
    """Time in which the excess temperature falls to 37 %."""

    needs = ("age",)

    @kernel
    def acceleration(p, q, t):
        return 0.0, 0.0, p.lift * exp(-q.age / p.cooling)
