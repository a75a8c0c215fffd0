"""Operations over the lanes of a vector, and choices among them."""

from __future__ import annotations

from collections.abc import Callable

from motes.machine.ahead import MARK
from motes.machine.kinds import INT, SINGLE, UINT, Number, Unsupported
from motes.machine.memory import Memory
from motes.machine.shuffles import LANES, order_table
from motes.machine.values import Known, Scalar, Value, View


class Many(Memory):
    """What kernels call to compare, sum, mark and keep lanes."""

    def streams(self) -> Value:
        """`lanes.streams`."""
        self.declare(MARK)
        return Known(None)

    def bits(self, condition: Value) -> Value:
        """`lanes.bits`."""
        truth = self.truth(condition)
        lanes = truth.type.lanes
        whole = truth.text
        if lanes > 1:
            whole = self.do(f"bitcast {truth.type.llvm} {truth.text} to i{lanes}")
        return Scalar(UINT, self.do(f"zext i{lanes} {whole} to i64"))

    def lowest(self, number: Value) -> Value:
        """`lanes.lowest`."""
        self.declare("declare i64 @llvm.cttz.i64(i64, i1)")
        if not isinstance(number, Scalar):
            raise Unsupported("the lowest bit of anything but a number")
        whole = self.cast(number, UINT).text
        return Scalar(UINT, self.do(f"call i64 @llvm.cttz.i64(i64 {whole}, i1 true)"))

    def choose(self, condition: Value, one: Value, other: Value) -> Value:
        """`lanes.choose`."""
        picked = self.chosen(self.truth(condition), one, other)
        if picked is None:
            raise Unsupported("the two values of a choice have types that do not fit")
        return picked

    def spread_over(self, value: Value, lanes: Value) -> Value:
        """`lanes.spread_over`."""
        if not isinstance(value, Scalar) or not isinstance(lanes, Scalar) or not lanes.literal:
            raise Unsupported("a number is spread over lanes whose number is known")
        return self.cast(value, value.type.over(int(lanes.literal)))

    def total(self, lanes: Value) -> Value:
        """`lanes.total`."""
        return self._by_halves(lanes, self._sum)

    def largest_lane(self, lanes: Value) -> Value:
        """`lanes.largest`."""
        return self._by_halves(lanes, self._larger)

    def _sum(self, a: Scalar, b: Scalar) -> Scalar:
        return Scalar(a.type, self.do(f"fadd {a.type.llvm} {a.text}, {b.text}"))

    def _larger(self, a: Scalar, b: Scalar) -> Scalar:
        found = self.chosen(self.compare("Gt", a, b), a, b)
        assert isinstance(found, Scalar)
        return found

    def _by_halves(self, value: Value, join: Callable[[Scalar, Scalar], Scalar]) -> Scalar:
        if not isinstance(value, Scalar) or value.type.kind != "f":
            raise Unsupported("lanes of real numbers are joined")
        while (width := value.type.lanes) > 1:
            value = join(*(self._half(value, width // 2, k) for k in (0, 1)))
        return value

    def _half(self, value: Scalar, width: int, k: int) -> Scalar:
        kind = value.type.over(width)
        if width == 1:
            text = f"extractelement {value.type.llvm} {value.text}, i64 {k}"
        else:
            places = range(k * width, (k + 1) * width)
            text = self.shuffled(value.type.llvm, (value.text, "poison"), places)
        return Scalar(kind, self.do(text))

    def shuffled(self, llvm: str, pair: tuple[str, str], places: range | list[int]) -> str:
        """LLVM's text of the numbers at some places of two vectors end to end."""
        mask = ", ".join(f"i32 {k}" for k in places)
        a, b = pair
        return f"shufflevector {llvm} {a}, {llvm} {b}, <{len(places)} x i32> <{mask}>"

    def rough_inverse_root(self, value: Value) -> Value:
        """`lanes.rough_inverse_root`: the processor's estimate, where it has one."""
        from motes.machine.target import has

        if not isinstance(value, Scalar) or value.type.over(1) != SINGLE:
            raise Unsupported("only roots in single precision are estimated")
        kind = value.type
        if kind.lanes == 16 and has("avx512f"):
            name, more = "@llvm.x86.avx512.rsqrt14.ps.512", f", {kind.llvm} undef, i16 -1"
            types = f"{kind.llvm}, {kind.llvm}, i16"
        elif kind.lanes == 8 and has("avx"):
            name, more, types = "@llvm.x86.avx.rsqrt.ps.256", "", kind.llvm
        else:
            root = self.intrinsic("sqrt", value)
            one = self.cast(Scalar(SINGLE, "1.0"), kind)
            return Scalar(kind, self.do(f"fdiv {kind.llvm} {one.text}, {root.text}"))
        self.declare(f"declare {kind.llvm} {name}({types})")
        return Scalar(kind, self.do(f"call {kind.llvm} {name}({kind.llvm} {value.text}{more})"))

    def put_some(self, array: Value, place: Value, value: Value, condition: Value) -> Value:
        """`lanes.put_some`: in one step for lanes of 32 bits that fill a register, else one by one.

        AVX-512 moves the lanes that count together; AVX2 permutes eight by a table of orders.
        """
        from motes.machine.target import has, moves_lanes

        truth = self.truth(condition)
        if not isinstance(array, View) or not isinstance(value, Scalar):
            raise Unsupported("lanes are written to an array")
        assert isinstance(place, Scalar)
        one, lanes = array.type.item, truth.type.lanes
        at, memory = self._start(array, place), self.kind_of_memory(one)
        text = self.cast(value, one.over(lanes)).text
        marks = self.do(f"bitcast {truth.type.llvm} {truth.text} to i{lanes}")
        if lanes == LANES and one.bytes == 4 and moves_lanes():
            wide = self.do(f"zext i8 {marks} to i64")
            row = self.do(f"getelementptr inbounds <8 x i32>, ptr {order_table(self)}, i64 {wide}")
            order = self.do(f"load <8 x i32>, ptr {row}, align 32")
            whole = self.do(f"bitcast <8 x {one.llvm}> {text} to <8 x i32>")
            self.declare("declare <8 x i32> @llvm.x86.avx2.permd(<8 x i32>, <8 x i32>)")
            call = f"call <8 x i32> @llvm.x86.avx2.permd(<8 x i32> {whole}, <8 x i32> {order})"
            self.line(f"store <8 x i32> {self.do(call)}, ptr {at}, align 4{memory}")
        elif lanes == 16 and one.bytes == 4 and has("avx512f"):
            whole = self.do(f"bitcast <16 x {one.llvm}> {text} to <16 x i32>")
            name, kind = "@llvm.x86.avx512.mask.compress.v16i32", "<16 x i32>"
            self.declare(f"declare {kind} {name}({kind}, {kind}, <16 x i1>)")
            call = f"call {kind} {name}({kind} {whole}, {kind} {whole}, <16 x i1> {truth.text})"
            self.line(f"store {kind} {self.do(call)}, ptr {at}, align 4{memory}")
        else:
            self._put_one_by_one(one, at, text, truth)
        if lanes == 1:
            return Scalar(INT, self.do(f"zext i1 {marks} to i64"))
        self.declare(f"declare i{lanes} @llvm.ctpop.i{lanes}(i{lanes})")
        count = self.do(f"call i{lanes} @llvm.ctpop.i{lanes}(i{lanes} {marks})")
        return Scalar(INT, self.do(f"zext i{lanes} {count} to i64"))

    def _put_one_by_one(self, one: Number, at: str, text: str, truth: Scalar) -> None:
        """Write every lane, and move on where it counts: no branch, and the next one covers it."""
        lanes, memory = truth.type.lanes, self.kind_of_memory(one)
        for k in range(lanes):
            item, mark = text, truth.text
            if lanes > 1:
                item = self.do(f"extractelement {one.over(lanes).llvm} {text}, i64 {k}")
                mark = self.do(f"extractelement {truth.type.llvm} {truth.text}, i64 {k}")
            self.line(f"store {one.llvm} {item}, ptr {at}{memory}")
            step = self.do(f"zext i1 {mark} to i64")
            at = self.do(f"getelementptr inbounds {one.llvm}, ptr {at}, i64 {step}")
