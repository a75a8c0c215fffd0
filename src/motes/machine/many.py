"""Operations over the lanes of a vector, and choices among them."""

from __future__ import annotations

from collections.abc import Callable

from motes.machine.kinds import INT, SINGLE, Unsupported
from motes.machine.memory import Memory
from motes.machine.shuffles import LANES, order_table
from motes.machine.values import Scalar, Value, View


class Many(Memory):
    """What kernels call to compare, sum and keep lanes."""

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
        """`lanes.put_some`: by a table of orders for eight lanes, else by LLVM's own means."""
        from motes.machine.target import moves_lanes

        truth = self.truth(condition)
        if not isinstance(array, View) or not isinstance(value, Scalar):
            raise Unsupported("lanes are written to an array")
        assert isinstance(place, Scalar)
        kind = array.type.item.over(truth.type.lanes)
        if kind.over(1).llvm != "i32":
            raise Unsupported("some lanes are written as integers of 32 bits")
        at, text, lanes = self._start(array, place), self.cast(value, kind).text, kind.lanes
        marks = self.do(f"bitcast {truth.type.llvm} {truth.text} to i{lanes}")
        memory = self.kind_of_memory(array.type.item)
        if lanes == LANES and moves_lanes():
            wide = self.do(f"zext i8 {marks} to i64")
            row = self.do(f"getelementptr inbounds <8 x i32>, ptr {order_table(self)}, i64 {wide}")
            order = self.do(f"load <8 x i32>, ptr {row}, align 32")
            self.declare("declare <8 x i32> @llvm.x86.avx2.permd(<8 x i32>, <8 x i32>)")
            call = f"call <8 x i32> @llvm.x86.avx2.permd(<8 x i32> {text}, <8 x i32> {order})"
            self.line(f"store <8 x i32> {self.do(call)}, ptr {at}, align 4{memory}")
        else:
            name = f"@llvm.masked.compressstore.v{lanes}i32"
            self.declare(f"declare void {name}({kind.llvm}, ptr, {truth.type.llvm})")
            given = f"{kind.llvm} {text}, ptr {at}, {truth.type.llvm} {truth.text}"
            self.line(f"call void {name}({given})")
        self.declare(f"declare i{lanes} @llvm.ctpop.i{lanes}(i{lanes})")
        count = self.do(f"call i{lanes} @llvm.ctpop.i{lanes}(i{lanes} {marks})")
        return Scalar(INT, self.do(f"zext i{lanes} {count} to i64"))
