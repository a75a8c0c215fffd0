"""What loops over single numbers cannot say: data that changes places between a vector's lanes.

Two functions that kernels call. In plain Python they are what their source says; to the compiler
they are LLVM's text, written here for eight lanes at a time.
"""

from __future__ import annotations

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


def pressed(values: Any, marks: Any, out: Any) -> int:
    """Write the values whose mark is not 0, in order, and return how many there are.

    Both are of 32 bits and as many as a multiple of `LANES`; up to `LANES` - 1 numbers of `out`
    after the last may change.
    """
    new = 0
    for q in range(values.size):
        if marks[q] != 0:
            out[new] = values[q]
            new += 1
    return new


def taking(real: str) -> str:
    """LLVM's text of `taken_apart` for one precision."""
    wide = real == "double"
    step = 4 if wide else LANES
    four, all_ = f"<4 x {real}>", f"<{step} x {real}>"
    lines = [
        f"define internal void @taken_apart.{real}(ptr %records, ptr %slots, i64 %n, ptr %x, "
        "ptr %y, ptr %z) alwaysinline nounwind {",
        "head:\n  br label %top",
        "top:\n  %q = phi i64 [ 0, %head ], [ %next, %body ]",
        "  %more = icmp slt i64 %q, %n\n  br i1 %more, label %body, label %done",
        "body:\n  %from = getelementptr inbounds i32, ptr %slots, i64 %q",
    ]
    for k in range(step):
        lines += [
            f"  %p{k} = getelementptr inbounds i32, ptr %from, i64 {k}",
            f"  %s{k} = load i32, ptr %p{k}",
            f"  %w{k} = zext i32 %s{k} to i64",
            f"  %a{k} = getelementptr inbounds {four}, ptr %records, i64 %w{k}",
            f"  %r{k} = load {four}, ptr %a{k}, align 16",
        ]

    def shuffle(to: str, kind: str, a: str, b: str, order: tuple[int, ...]) -> None:
        mask = ", ".join(f"i32 {i}" for i in order)
        lines.append(
            f"  {to} = shufflevector {kind} {a}, {kind} {b}, <{len(order)} x i32> <{mask}>"
        )

    rows = [f"%r{k}" for k in range(4)]
    if not wide:
        rows = [f"%b{k}" for k in range(4)]
        for k in range(4):
            shuffle(rows[k], four, f"%r{k}", f"%r{k + 4}", tuple(range(8)))

    def halves(*order: int) -> tuple[int, ...]:
        """Places in a vector, and in its other half the same; of the second vector from 4 on."""
        if wide:
            return order
        first = tuple(i if i < 4 else i + 4 for i in order)
        return (*first, *(i + 4 for i in first))

    for to, a, b, order in (
        ("%xy0", 0, 1, (0, 4, 1, 5)), ("%xy1", 2, 3, (0, 4, 1, 5)),
        ("%zw0", 0, 1, (2, 6, 3, 7)), ("%zw1", 2, 3, (2, 6, 3, 7)),
    ):  # fmt: skip
        shuffle(to, all_, rows[a], rows[b], halves(*order))
    shuffle("%vx", all_, "%xy0", "%xy1", halves(0, 1, 4, 5))
    shuffle("%vy", all_, "%xy0", "%xy1", halves(2, 3, 6, 7))
    shuffle("%vz", all_, "%zw0", "%zw1", halves(0, 1, 4, 5))
    for axis in "xyz":
        lines.append(f"  %o{axis} = getelementptr inbounds {real}, ptr %{axis}, i64 %q")
        lines.append(f"  store {all_} %v{axis}, ptr %o{axis}, align {8 if wide else 4}")
    lines.append(f"  %next = add nsw i64 %q, {step}\n  br label %top")
    return "\n".join([*lines, "done:\n  ret void\n}"])


def pressing(moves_lanes: bool) -> str:
    """LLVM's text of `pressed`; with a processor that moves lanes by a vector, eight at once."""
    return _pressing_eight() if moves_lanes else _pressing_one()


def _pressing_eight() -> str:
    rows = []
    for mark in range(256):
        chosen = [k for k in range(8) if mark >> k & 1]
        order = ", ".join(f"i32 {k}" for k in (chosen + [0] * 8)[:8])
        rows.append(f"<8 x i32> <{order}>")
    table = ", ".join(rows)
    return (
        f"@orders = internal constant [256 x <8 x i32>] [{table}], align 32\n"
        "declare <8 x i32> @llvm.x86.avx2.permd(<8 x i32>, <8 x i32>)\n"
        "declare i8 @llvm.ctpop.i8(i8)\n"
        "define internal i64 @pressed(ptr %values, ptr %marks, i64 %n, ptr %out) alwaysinline "
        "nounwind {\nhead:\n  br label %top\n"
        "top:\n  %q = phi i64 [ 0, %head ], [ %next, %body ]\n"
        "  %new = phi i64 [ 0, %head ], [ %sum, %body ]\n"
        "  %more = icmp slt i64 %q, %n\n  br i1 %more, label %body, label %done\n"
        "body:\n  %m = getelementptr inbounds i32, ptr %marks, i64 %q\n"
        "  %mark = load <8 x i32>, ptr %m, align 4\n"
        "  %on = icmp ne <8 x i32> %mark, zeroinitializer\n"
        "  %bits = bitcast <8 x i1> %on to i8\n  %place = zext i8 %bits to i64\n"
        "  %o = getelementptr inbounds <8 x i32>, ptr @orders, i64 %place\n"
        "  %order = load <8 x i32>, ptr %o, align 32\n"
        "  %v = getelementptr inbounds i32, ptr %values, i64 %q\n"
        "  %value = load <8 x i32>, ptr %v, align 4\n"
        "  %kept = call <8 x i32> @llvm.x86.avx2.permd(<8 x i32> %value, <8 x i32> %order)\n"
        "  %to = getelementptr inbounds i32, ptr %out, i64 %new\n"
        "  store <8 x i32> %kept, ptr %to, align 4\n"
        "  %few = call i8 @llvm.ctpop.i8(i8 %bits)\n  %many = zext i8 %few to i64\n"
        "  %sum = add nsw i64 %new, %many\n"
        f"  %next = add nsw i64 %q, {LANES}\n  br label %top\n"
        "done:\n  ret i64 %new\n}"
    )


def _pressing_one() -> str:
    return (
        "define internal i64 @pressed(ptr %values, ptr %marks, i64 %n, ptr %out) alwaysinline "
        "nounwind {\nhead:\n  br label %top\n"
        "top:\n  %q = phi i64 [ 0, %head ], [ %next, %body ]\n"
        "  %new = phi i64 [ 0, %head ], [ %sum, %body ]\n"
        "  %more = icmp slt i64 %q, %n\n  br i1 %more, label %body, label %done\n"
        "body:\n  %m = getelementptr inbounds i32, ptr %marks, i64 %q\n"
        "  %mark = load i32, ptr %m\n  %on = icmp ne i32 %mark, 0\n"
        "  %v = getelementptr inbounds i32, ptr %values, i64 %q\n  %value = load i32, ptr %v\n"
        "  %to = getelementptr inbounds i32, ptr %out, i64 %new\n"
        "  store i32 %value, ptr %to\n"
        "  %one = zext i1 %on to i64\n  %sum = add nsw i64 %new, %one\n"
        "  %next = add nsw i64 %q, 1\n  br label %top\n"
        "done:\n  ret i64 %new\n}"
    )
