"""Death of old age."""

from motes.catalog import component
from motes.kernel import kernel


@component
class Lifetime:
    """Dies when its age reaches its life. Every system that states a life has it."""

    needs = ("age", "life")

    @kernel
    def dies(p, q, t):
        return q.age >= q.life
