"""Ways to die: conditions, each a file, that are asked of every particle after every step."""

from __future__ import annotations

from motes.catalog import Kind, attribute

KIND = Kind("retire", "retirement", "particle", ("dies",))
__getattr__ = attribute("retire")
