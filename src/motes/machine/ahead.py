"""Fetching ahead: loops over long arrays tell the processor what they will read soon.

A processor guesses what comes next in each array, but no further than to the end of a page of
4 KiB, and begins anew on the next: six arrays at a time stop it often. LLVM has no such step for
x86, and a hint in the loop itself would keep it from becoming a SIMD loop; so hints are put into
the loop that LLVM has made.
"""

from __future__ import annotations

import re

MARK = "; streams"
"""Line of a module's text that asks for it: a kernel that calls `lanes.streams()` has it."""

AHEAD = 512
"""Bytes from what is read to what is fetched; 256 to 1024 were equally good on a Zen 3."""

_WIDE = re.compile(r" +%\S+ = load <\d+ x (?:float|double)>, ptr (%\S+),")
_PART = re.compile(r" +(%\S+) = getelementptr [^%]*ptr (%[^\s,]+),", re.MULTILINE)
_OWN = re.compile(r" +(%\S+) = alloca ", re.MULTILINE)
_HINT = """  %ahead.{k} = getelementptr i8, ptr {address}, i64 {bytes}
  call void @llvm.prefetch.p0(ptr %ahead.{k}, i32 1, i32 3, i32 1)"""
"""For an address that will be written, too, and stays in all caches; it may lie in no array."""


def fetching_ahead(optimised: str) -> str:
    """Text of an optimised module, with a hint before each load of several numbers.

    A function's own small arrays get none: they are in the first cache as it is.
    """
    functions = "\ndefine ".join(map(_hinted, optimised.split("\ndefine ")))
    return functions + "\ndeclare void @llvm.prefetch.p0(ptr, i32, i32, i32)\n"


def _hinted(function: str) -> str:
    wholes, own = dict(_PART.findall(function)), set(_OWN.findall(function))
    lines: list[str] = []
    for k, line in enumerate(function.split("\n")):
        if found := _WIDE.match(line):
            whole = found[1]
            while whole in wholes:
                whole = wholes[whole]
            if whole not in own:
                lines.append(_HINT.format(k=k, address=found[1], bytes=AHEAD))
        lines.append(line)
    return "\n".join(lines)
