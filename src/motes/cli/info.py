"""`motes info`: what the kept frames of a film are."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from motes.cli.options import json_option
from motes.cli.progress import rounded

if TYPE_CHECKING:
    from motes.record.energy import Measures


@click.command(short_help="Show what kept frames hold.")
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--check", is_flag=True, help="Read every frame whole, to find damaged ones.")
@json_option
@click.pass_context
def command(ctx: click.Context, folder: Path, check: bool, as_json: bool) -> None:
    """Show which frames FOLDER keeps, of which scene, and what is in them.

    Ends with exit code 74 if a frame is damaged.
    """
    from motes.errors import OutputError
    from motes.production import open_frames
    from motes.record.energy import to_json

    store = open_frames(folder)
    manifest, numbers = store.manifest, store.numbers()
    facts: dict[str, Any] = {
        "folder": str(store.folder),
        "name": manifest.name,
        "title": manifest.scene.get("title", ""),
        "version": manifest.version,
        "digest": manifest.digest,
        "fps": manifest.fps,
        "frames": ranges(numbers),
        "count": len(numbers),
        "bytes": store.size(),
        "systems": {},
        "scripts": dict(manifest.scripts),
    }
    facts["faults"] = faults = {str(n): text for n, text in store.faults(whole=check).items()}
    sound = [number for number in numbers if str(number) not in faults]
    if sound:
        last = store.read(sound[-1])
        facts["time"] = last.time
        facts["systems"] = {
            name: {key: {"dtype": str(a.dtype), "shape": a.shape} for key, a in columns.items()}
            for name, columns in last.systems.items()
        }
    measures = store.measures()
    if measures:
        facts["measures"] = {
            str(number): {**to_json(m), "energy": m.energy, "virial_ratio": m.virial_ratio}
            for number, m in measures.items()
        }
    facts["captures"] = captures = store.captures()
    if as_json:
        click.echo(json.dumps({**facts, "scene": manifest.scene}, indent=2, ensure_ascii=False))
        ctx.exit(OutputError.exit_code if faults else 0)
    rows = [
        ("scene", f"{facts['title'] or manifest.name}"),
        ("version", f"motes {manifest.version}"),
        ("digest", manifest.digest),
        ("frames", f"{facts['frames'] or 'none'} at {manifest.fps:g} a second"),
        ("size", f"{rounded(facts['bytes'])}B"),
    ]
    if measures:
        rows += _kept(list(measures.values()))
    if captures:
        begin, end = (f"{captures[k]['time']:.3g} s" for k in (0, -1))
        rows.append(("captures", f"{len(captures)}, the first at {begin}, the last at {end}"))
    for name, columns in facts["systems"].items():
        rows.append((name, f"{_columns(columns)} in frame {sound[-1]}"))
    text = click.HelpFormatter()
    text.write_dl(rows)
    click.echo(text.getvalue().rstrip())
    for part, script in sorted(manifest.scripts.items()):
        click.echo(f"{part} was declared in {script or 'a notebook or at a prompt'}")
    for fault in faults.values():
        click.echo(fault, err=True)
    ctx.exit(OutputError.exit_code if faults else 0)


def _kept(measures: list[Measures]) -> list[tuple[str, str]]:
    """What a closed system keeps, from the first frame with mass to the last."""
    first = next((m for m in measures if m.mass), measures[0])
    last = measures[-1]
    change = abs(last.energy / first.energy - 1) if first.energy else 0.0
    size = [float(sum(c * c for c in m.momentum) ** 0.5) for m in (first, last)]
    return [
        ("energy", f"{first.energy:.6g} J, then {last.energy:.6g} J: a change of {change:.1e}"),
        ("momentum", f"{size[0]:.3g} kg m/s, then {size[1]:.3g} kg m/s"),
        ("2 T / |U|", f"{first.virial_ratio:.4g}, then {last.virial_ratio:.4g}"),
    ]


def ranges(numbers: list[int]) -> str:
    """Whole numbers in order as ranges: `1-48, 60`."""
    if not numbers:
        return ""
    breaks = [(a, b) for a, b in pairwise(numbers) if b != a + 1]
    firsts = [numbers[0], *(b for _, b in breaks)]
    lasts = [*(a for a, _ in breaks), numbers[-1]]
    spans = zip(firsts, lasts, strict=True)
    return ", ".join(str(a) if a == b else f"{a}-{b}" for a, b in spans)


def _columns(columns: dict[str, dict[str, Any]]) -> str:
    """`8120 particles with position, velocity, ...`."""
    count = next((column["shape"][0] for column in columns.values() if column["shape"]), 0)
    return f"{count} particles with {', '.join(columns)}"
