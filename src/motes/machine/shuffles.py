"""What loops over single numbers cannot say: data that changes places between a vector's lanes.

Two functions that kernels call. In plain Python they are what their source says; to the compiler
they are LLVM's text, written here for eight lanes at a time. No instruction has a flag that lets
it round otherwise than IEEE 754 says.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

LANES = 8
"""Numbers that are moved at once."""


def taken_apart(records: Any, slots: Any, x: Any, y: Any, z: Any) -> None:
    """Columns of chosen records: x, y, z become their first three numbers.

    `records` is (n, 4) and packed, `slots` are of 32 bits and as many as a multiple of `LANES`.
    """
    for q in range(slots.size):
        k = slots[q]
        x[q], y[q], z[q] = records[k, 0], records[k, 1], records[k, 2]


def near_slots(
    x: Any, y: Any, z: Any, limit: Any, me: Any, xs: Any, ys: Any, zs: Any, slots: Any, out: Any
) -> int:
    """Write the slots of the points within a square of a distance from x, y, z, but `me`, in order.

    Returns how many there are. `slots` are of 32 bits and, with the points, as many as a multiple
    of `LANES`; up to `LANES` numbers of `out` after the last may change.
    """
    new = 0
    for q in range(slots.size):
        dx, dy, dz = x - xs[q], y - ys[q], z - zs[q]
        if dx * dx + dy * dy + dz * dz <= limit and slots[q] != me:
            out[new] = slots[q]
            new += 1
    return new


def taking(real: str) -> str:
    """LLVM's text of `taken_apart` for one precision."""
    wide = real == "double"
    step, line = (4, 2) if wide else (LANES, 4)
    text = _Text(
        f"define internal void @taken_apart.{real}(ptr %records, ptr %slots, i64 %n, ptr %x, "
        "ptr %y, ptr %z) alwaysinline nounwind {"
    )
    text.begin()
    text.add("%from = getelementptr inbounds i32, ptr %slots, i64 %q")
    parts = []
    for k in range(step):
        text.add(
            f"%p{k} = getelementptr inbounds i32, ptr %from, i64 {k}",
            f"%s{k} = load i32, ptr %p{k}",
            f"%w{k} = zext i32 %s{k} to i64",
            f"%a{k} = getelementptr inbounds <4 x {real}>, ptr %records, i64 %w{k}",
        )
    # Halves of 16 bytes go straight to where they are wanted; only a lane's neighbours change.
    for half in range(2 if wide else 1):
        for k in range(step):
            at = f"%a{k}"
            if half:
                at = text.do(f"getelementptr inbounds {real}, ptr {at}, i64 {line}")
            parts.append(text.do(f"load <{line} x {real}>, ptr {at}, align 16"))
    small, whole = f"<{line} x {real}>", f"<{step} x {real}>"
    both, pairs = tuple(range(2 * line)), step // 2

    def joined(half: int) -> list[str]:
        first = half * step
        if wide:
            order = [(0, 2), (1, 3)]
        else:
            order = [(k, k + 4) for k in range(pairs)]
        return [text.shuffle(small, (parts[first + a], parts[first + b]), both) for a, b in order]

    if wide:
        xy, zw = joined(0), joined(1)
        found = [
            text.shuffle(whole, xy, (0, 4, 2, 6)),
            text.shuffle(whole, xy, (1, 5, 3, 7)),
            text.shuffle(whole, zw, (0, 4, 2, 6)),
        ]
    else:
        a, b, c, d = joined(0)
        low, high = (0, 8, 1, 9, 4, 12, 5, 13), (2, 10, 3, 11, 6, 14, 7, 15)
        first, second = (0, 1, 8, 9, 4, 5, 12, 13), (2, 3, 10, 11, 6, 7, 14, 15)
        xy = [text.shuffle(whole, (a, b), low), text.shuffle(whole, (c, d), low)]
        zw = [text.shuffle(whole, (a, b), high), text.shuffle(whole, (c, d), high)]
        found = [
            text.shuffle(whole, xy, first),
            text.shuffle(whole, xy, second),
            text.shuffle(whole, zw, first),
        ]
    for axis, value in zip("xyz", found, strict=True):
        at = text.do(f"getelementptr inbounds {real}, ptr %{axis}, i64 %q")
        text.add(f"store {whole} {value}, ptr {at}, align {8 if wide else 4}")
    text.end(step)
    return text.whole("ret void")


def seeking(real: str) -> str:
    """LLVM's text of `near_slots`, for a processor that moves lanes by a vector (AVX2)."""
    wide = real == "double"
    step = 4 if wide else LANES
    kind = f"<{step} x {real}>"
    text = _Text(
        f"define internal i64 @near_slots.{real}({real} %x, {real} %y, {real} %z, "
        f"{real} %limit, i32 %me, ptr %xs, ptr %ys, ptr %zs, ptr %slots, i64 %n, ptr %out) "
        "alwaysinline nounwind {"
    )
    own = {name: text.spread(kind, real, f"%{name}", step) for name in ("x", "y", "z", "limit")}
    me = text.spread("<8 x i32>", "i32", "%me", LANES)
    text.begin(carried=("%new", "%sum"))
    near = []
    for begin in range(0, LANES, step):
        squares = []
        for axis in "xyz":
            at = text.do(f"getelementptr inbounds {real}, ptr %{axis}s, i64 %q")
            if begin:
                at = text.do(f"getelementptr inbounds {real}, ptr {at}, i64 {begin}")
            other = text.do(f"load {kind}, ptr {at}, align {8 if wide else 4}")
            away = text.do(f"fsub {kind} {own[axis]}, {other}")
            squares.append(text.do(f"fmul {kind} {away}, {away}"))
        total = text.do(f"fadd {kind} {squares[0]}, {squares[1]}")
        total = text.do(f"fadd {kind} {total}, {squares[2]}")
        near.append(text.do(f"fcmp ole {kind} {total}, {own['limit']}"))
    inside = near[0] if not wide else text.shuffle("<4 x i1>", near, tuple(range(LANES)))
    at = text.do("getelementptr inbounds i32, ptr %slots, i64 %q")
    slot = text.do(f"load <8 x i32>, ptr {at}, align 4")
    others = text.do(f"icmp ne <8 x i32> {slot}, {me}")
    chosen_ = text.do(f"and <8 x i1> {inside}, {others}")
    bits = text.do(f"bitcast <8 x i1> {chosen_} to i8")
    place = text.do(f"zext i8 {bits} to i64")
    at = text.do(f"getelementptr inbounds <8 x i32>, ptr {ORDERS}, i64 {place}")
    order = text.do(f"load <8 x i32>, ptr {at}, align 32")
    kept = text.do(f"call <8 x i32> @llvm.x86.avx2.permd(<8 x i32> {slot}, <8 x i32> {order})")
    at = text.do("getelementptr inbounds i32, ptr %out, i64 %new")
    few = text.do(f"call i8 @llvm.ctpop.i8(i8 {bits})")
    many = text.do(f"zext i8 {few} to i64")
    text.add(f"store <8 x i32> {kept}, ptr {at}, align 4", f"%sum = add nsw i64 %new, {many}")
    text.end(LANES)
    return text.whole("ret i64 %new")


SEEKING_NEEDS = (
    "declare <8 x i32> @llvm.x86.avx2.permd(<8 x i32>, <8 x i32>)",
    "declare i8 @llvm.ctpop.i8(i8)",
)
"""What `seeking` calls."""


ORDERS = "@orders"


def order_table(writer: Any) -> str:
    """Name of a table: for each set of eight lanes, the order that begins with those of the set."""
    rows = []
    for mark in range(256):
        chosen = [k for k in range(LANES) if mark >> k & 1]
        rows.append(f"<8 x i32> <{', '.join(f'i32 {k}' for k in (chosen + [0] * LANES)[:LANES])}>")
    content = ", ".join(rows)
    writer.declare(f"{ORDERS} = internal constant [256 x <8 x i32>] [{content}], align 32")
    return ORDERS


class _Text:
    """Lines of one function that loops over %q up to %n."""

    def __init__(self, head: str) -> None:
        self.lines, self._number = [head, "head:"], 0

    def add(self, *lines: str) -> None:
        self.lines += lines

    def do(self, text: str) -> str:
        self._number += 1
        self.add(f"%t{self._number} = {text}")
        return f"%t{self._number}"

    def shuffle(self, kind: str, pair: Sequence[str], order: Sequence[int]) -> str:
        a, b = pair
        mask = ", ".join(f"i32 {k}" for k in order)
        return self.do(f"shufflevector {kind} {a}, {kind} {b}, <{len(order)} x i32> <{mask}>")

    def spread(self, kind: str, item: str, value: str, lanes: int) -> str:
        one = self.do(f"insertelement {kind} poison, {item} {value}, i64 0")
        return self.shuffle(kind, (one, "poison"), [0] * lanes)

    def begin(self, carried: tuple[str, str] | None = None) -> None:
        self.add("br label %top", "top:", "%q = phi i64 [ 0, %head ], [ %next, %body ]")
        if carried:
            self.add(f"{carried[0]} = phi i64 [ 0, %head ], [ {carried[1]}, %body ]")
        self.add("%more = icmp slt i64 %q, %n", "br i1 %more, label %body, label %done", "body:")

    def end(self, step: int) -> None:
        self.add(f"%next = add nsw i64 %q, {step}", "br label %top")

    def whole(self, last: str) -> str:
        return "\n".join([*self.lines, "done:", last, "}"])
