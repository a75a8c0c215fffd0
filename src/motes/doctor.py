"""What motes finds on this machine: versions, processor, memory, folders, encoders, extras."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import platform
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from motes.errors import OutputError

EXTRAS = {"scipy": "test", "taichi": "peers", "warp": "peers"}
"""Optional packages that something in motes uses, and the extra that brings each."""


@dataclass(frozen=True)
class Finding:
    """One fact about the machine, and what to do where it is a fault."""

    name: str
    value: str
    fix: str = ""
    """Empty when all is well."""


def examine() -> Iterator[Finding]:
    """Look at the machine, one finding after the other; nothing on it is changed."""
    for part in (_versions, _processor, _memory, _cache, _encoder, _extras):
        yield from _guarded(part)


def _guarded(part: Callable[[], Iterator[Finding]]) -> Iterator[Finding]:
    """The findings of one examination; what it cannot find out is a finding too."""
    try:
        yield from part()
    except Exception as error:
        name = part.__name__.strip("_")
        yield Finding(name, f"{type(error).__name__}: {error}", "Install motes again.")


def _versions() -> Iterator[Finding]:
    yield Finding("motes", importlib.metadata.version("motes"))
    old = sys.version_info < (3, 11)
    yield Finding("Python", platform.python_version(), "Install Python 3.11 or newer." * old)
    for package in ("numpy", "numba", "pydantic", "pillow", "av"):
        try:
            yield Finding(package, importlib.metadata.version(package))
        except importlib.metadata.PackageNotFoundError:
            yield Finding(package, "missing", f"python3 -m pip install {package}")


def _processor() -> Iterator[Finding]:
    from llvmlite import binding

    from motes.jit import available_processors, threads

    yield Finding("platform", f"{platform.system()} {platform.machine()}")
    yield Finding("processor", binding.get_host_cpu_name())
    yield Finding("threads", f"{threads()} of {available_processors()}")
    features = binding.get_host_cpu_features()
    widths = {"avx512f": 512, "avx2": 256, "avx": 256, "neon": 128, "sse2": 128}
    width = max((bits for name, bits in widths.items() if features.get(name)), default=128)
    yield Finding("SIMD", f"{width} bits, {width // 32} single-precision numbers at once")


def _memory() -> Iterator[Finding]:
    import psutil

    from motes.memory import budget

    total = psutil.virtual_memory().total
    yield Finding("memory", f"{total / 2**30:.1f} GiB, of which motes uses {budget() / 2**30:.1f}")


def _cache() -> Iterator[Finding]:
    from motes.files import written_whole
    from motes.jit import cache_folder

    folder = cache_folder()
    size = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
    probe = folder / ".probe"
    try:
        with written_whole(probe) as file:
            file.write(b"motes")
        probe.unlink()
    except (OSError, OutputError):
        fix = "Set MOTES_CACHE to a folder that can be written, or every start compiles anew."
        yield Finding("kernel cache", f"{folder} cannot be written", fix)
    else:
        yield Finding("kernel cache", f"{folder}, {size / 1e6:.1f} MB")


def _encoder() -> Iterator[Finding]:
    import av
    from PIL import features

    install = "python3 -m pip install --force-reinstall"
    for name, codec in (("MP4", "libx264"), ("WebP film", "libwebp_anim")):
        there = codec in av.codecs_available
        yield Finding(name, codec if there else f"no {codec}", f"{install} av" * (not there))
    webp = features.check("webp")
    yield Finding("WebP", "pillow" if webp else "missing", f"{install} pillow" * (not webp))


def _extras() -> Iterator[Finding]:
    for module, extra in EXTRAS.items():
        there = importlib.util.find_spec(module) is not None
        how = f"not installed (python3 -m pip install 'motes[{extra}]')"
        yield Finding(f"extra {module}", "installed" if there else how)
