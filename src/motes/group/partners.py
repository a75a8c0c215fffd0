"""Which systems an interaction is about, and its numbers at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from types import SimpleNamespace
from typing import Any

from motes.catalog import Component
from motes.errors import SceneError, likely

Interactions = tuple[tuple[str, Component], ...]
"""Components with their addresses."""


def having(interactions: Interactions, kernel: str) -> Interactions:
    """The interactions that define a kernel."""
    return tuple(pair for pair in interactions if type(pair[1]).kernel(kernel) is not None)


def named_systems(interaction: Component) -> set[str]:
    """All systems that an interaction links; none where it names nobody, which means all."""
    named = set(interaction.values["systems"].document())
    others = (interaction.values[key].document() for key in ("sources", "hunters")
              if key in interaction.values)  # fmt: skip
    return named.union(*others) if named else named


def linked(interactions: Sequence[Component], names: Sequence[str]) -> list[set[str]]:
    """The systems that each interaction links, out of all that there are.

    Raises SceneError for one that there is not.
    """
    links = [named_systems(part) or set(names) for part in interactions]
    for part, link in zip(interactions, links, strict=True):
        for name in sorted(link - set(names)):
            raise SceneError(
                f'interaction "{part.name}": no system "{name}".'
                f"{likely(name, names)} There are: {', '.join(names)}."
            )
    return links


def joined(links: Sequence[set[str]]) -> list[set[str]]:
    """Groups of all that links join, directly or through others."""
    groups: list[set[str]] = []
    for link in links:
        touching = [group for group in groups if group & link]
        groups = [group for group in groups if not group & link]
        groups.append(link.union(*touching))
    return groups


def kernel(interaction: Component, name: str) -> Callable[..., Any]:
    """A kernel that an interaction is known to define."""
    function = type(interaction).kernel(name)
    assert function is not None
    return function


def named(
    part: Component, key: str, known: Iterable[str], otherwise: Iterable[str] = ()
) -> tuple[str, ...]:
    """The systems that an interaction names, or others, or all that it could."""
    given = part.values[key].document()
    for name in given:
        if name not in known:
            raise SceneError(
                f'interaction "{part.name}": {key} names "{name}", which does not take part in it.'
                f"{likely(name, known)} There are: {', '.join(known)}."
            )
    return tuple(sorted(given or otherwise or known))


def partners(interaction: Component, bodies: list[Any]) -> list[Any]:
    """The bodies that take part in an interaction."""
    named = interaction.values["systems"].document()
    return [body for body in bodies if not named or body.name in named]


def values(interaction: Component, time: float) -> SimpleNamespace:
    """An interaction's parameters at a time."""
    return SimpleNamespace(
        **{key: _plain(interaction, key, time) for key in interaction.parameters}
    )


def _plain(component: Component, key: str, time: float) -> Any:
    control = component.values[key]
    if control.scope == "fixed":
        return control.document()
    value = control.at(time)
    return float(value[0]) if value.size == 1 else value
