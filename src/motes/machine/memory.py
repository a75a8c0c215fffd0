"""Elements and parts of arrays and tuples as LLVM's text."""

from __future__ import annotations

from collections.abc import Sequence

from motes.machine.arithmetic import Arithmetic
from motes.machine.block import common_type
from motes.machine.kinds import INT, UINT, Array, LiteralNeeded, Number, Unsupported
from motes.machine.values import Group, Known, Scalar, Value, View


class Memory(Arithmetic):
    """Elements and parts of arrays and tuples."""

    def offset(self, index: Scalar) -> str:
        """An index as a 64-bit register."""
        if not index.type.whole:
            raise Unsupported("an index is an integer")
        return self.cast(index, UINT if index.type.kind != "i" else INT).text

    def element(self, array: View, places: Sequence[Scalar]) -> str:
        """Address of an element; a literal index below 0 counts from the end."""
        item = array.type.item
        indices = []
        for axis, place in enumerate(places):
            if place.literal is not None and place.literal < 0:
                indices.append(self.do(f"add nsw i64 {array.shape[axis]}, {place.literal}"))
            else:
                indices.append(self.offset(place))
        if array.type.packed:
            at = indices[0]
            for extent, index in zip(array.shape[1:], indices[1:], strict=False):
                at = self.do(f"mul nsw i64 {at}, {extent}")
                at = self.do(f"add nsw i64 {at}, {index}")
            for extent in array.shape[len(indices) :]:
                at = self.do(f"mul nsw i64 {at}, {extent}")
            return self.do(f"getelementptr inbounds {item.stored}, ptr {array.address}, i64 {at}")
        address = array.address
        for index, stride in zip(indices, array.strides, strict=False):
            step = self.do(f"mul nsw i64 {index}, {stride}")
            address = self.do(f"getelementptr inbounds i8, ptr {address}, i64 {step}")
        return address

    def load(self, array: View, places: Sequence[Scalar]) -> Value:
        """An element, or the part of the array that fewer indices than axes leave."""
        address, item, rest = self.element(array, places), array.type.item, len(places)
        if rest < array.type.axes:
            kind = Array(item, array.type.axes - rest, array.type.packed)
            return View(kind, address, array.shape[rest:], array.strides[rest:])
        register = self.do(f"load {item.stored}, ptr {address}{self.kind_of_memory(item)}")
        if item.kind == "b":
            register = self.do(f"icmp ne i8 {register}, 0")
        return Scalar(item, register)

    def store(self, array: View, places: Sequence[Scalar], value: Value) -> None:
        """Write an element."""
        if len(places) != array.type.axes or not isinstance(value, Scalar):
            raise Unsupported("only numbers can be written into elements of arrays")
        if array.address.startswith("@"):
            raise Unsupported("an array of the module is only read")
        item = array.type.item
        number = self.cast(value, item)
        if number.type.lanes > 1:
            raise Unsupported("lanes are written by put")
        text = number.text
        if item.kind == "b":
            text = self.do(f"zext i1 {text} to i8")
        address = self.element(array, places)
        self.line(f"store {item.stored} {text}, ptr {address}{self.kind_of_memory(item)}")

    def take(self, array: View, place: Scalar, lanes: Scalar) -> Scalar:
        """Elements of an array, from a place on, one for each lane."""
        one, address = array.type.item, self._start(array, place)
        kind = one.over(int(lanes.literal))
        text = f"load {kind.llvm}, ptr {address}, align {one.bytes}{self.kind_of_memory(one)}"
        return Scalar(kind, self.do(text))

    def put(self, array: View, place: Scalar, value: Scalar) -> Value:
        """Write lanes to the elements of an array, from a place on."""
        one, address = array.type.item, self._start(array, place)
        number = self.cast(value, one)
        text = f"{number.type.llvm} {number.text}, ptr {address}, align {one.bytes}"
        self.line(f"store {text}{self.kind_of_memory(one)}")
        return Known(None)

    def fetch(self, array: View, place: Scalar) -> Value:
        """`lanes.fetch`: into the first cache; a place beyond the end does no harm."""
        item, at = array.type.item, self.offset(place)
        address = self.do(f"getelementptr {item.stored}, ptr {array.address}, i64 {at}")
        self.declare("declare void @llvm.prefetch.p0(ptr, i32, i32, i32)")
        self.line(f"call void @llvm.prefetch.p0(ptr {address}, i32 0, i32 3, i32 1)")
        return Known(None)

    def _start(self, array: View, place: Scalar) -> str:
        if not array.type.packed or array.type.axes != 1 or array.type.item.kind == "b":
            raise Unsupported("lanes are taken from packed numbers along one axis")
        return self.element(array, [place])

    def kind_of_memory(self, item: Number) -> str:
        """A mark that tells LLVM that arrays of different types do not overlap."""
        raise NotImplementedError

    def fill(self, part: View, value: Value) -> None:
        """Write a number, or the elements of an array of the same shape, into part of an array."""
        if part.type.axes == 1:

            def write(i: Scalar) -> None:
                self.store(part, [i], value if isinstance(value, Scalar) else self.load(value, [i]))  # type: ignore[arg-type]

            if isinstance(value, View) and value.type.axes != 1:
                raise Unsupported("arrays of different shapes")
            self.counted(part.shape[0], write)
            return
        self.counted(part.shape[0], lambda i: self._fill_row(part, value, i))

    def _fill_row(self, part: View, value: Value, i: Scalar) -> None:
        row = self.load(part, [i])
        assert isinstance(row, View)
        self.fill(row, self.load(value, [i]) if isinstance(value, View) else value)

    def cut(self, array: View, axis_parts: Sequence[Scalar | tuple[Value, Value]]) -> View:
        """Part of an array by an index or a pair (first, last) for each axis that is named."""
        strides, address = self.strides(array), array.address
        shape: list[str] = []
        steps: list[str] = []
        packed = array.type.packed
        for axis, part in enumerate(axis_parts):
            extent = array.shape[axis]
            if isinstance(part, tuple):
                first, last = (self._end(end, extent, k) for k, end in enumerate(part))
                size = self.do(f"sub nsw i64 {last}, {first}")
                shape.append(self._call64("smax", size, "0"))
                steps.append(strides[axis])
                packed = packed and len(shape) == 1
            else:
                first = self.offset(part)
                packed = packed and not shape
            move = self.do(f"mul nsw i64 {first}, {strides[axis]}")
            address = self.do(f"getelementptr inbounds i8, ptr {address}, i64 {move}")
        rest = len(axis_parts)
        shape += array.shape[rest:]
        steps += strides[rest:]
        kind = Array(array.type.item, len(shape), packed)
        return View(kind, address, tuple(shape), () if packed else tuple(steps))

    def _end(self, end: Value, extent: str, last: int) -> str:
        """One end of a slice, within 0 and the extent; below 0 it counts from the array's end."""
        if isinstance(end, Known):
            return extent if last else "0"
        assert isinstance(end, Scalar)
        at = self.offset(end)
        if end.literal is None or end.literal < 0:
            if end.type.kind == "i":
                below = self.do(f"icmp slt i64 {at}, 0")
                moved = self.do(f"add nsw i64 {at}, {extent}")
                at = self.do(f"select i1 {below}, i64 {moved}, i64 {at}")
                at = self._call64("smax", at, "0")
        elif end.literal == 0:
            return "0"
        return self._call64("umin" if end.type.kind == "u" else "smin", at, extent)

    def _call64(self, name: str, a: str, b: str) -> str:
        return self.intrinsic(name, Scalar(INT, a), Scalar(INT, b)).text

    def picked(self, group: Group, index: Scalar) -> Value:
        """An item of a tuple; where the index is only known at run time, all have one type."""
        if index.literal is not None:
            try:
                item: Value = group.items[index.literal]
                return item
            except IndexError:
                raise Unsupported(f"a tuple of {len(group.items)} has no {index.literal}") from None
        kind = common_type(list(group.items))
        if not isinstance(kind, Number):
            raise LiteralNeeded("a tuple of arrays, or of different types, needs a literal index")
        size = len(group.items)
        room = self.room(kind, size)
        for k, item in enumerate(group.items):
            text = self.converted(item, kind)
            assert isinstance(text, Scalar)
            at = self.do(f"getelementptr inbounds {kind.llvm}, ptr {room}, i64 {k}")
            self.line(f"store {kind.llvm} {text.text}, ptr {at}")
        at = self.do(f"getelementptr inbounds {kind.llvm}, ptr {room}, i64 {self.offset(index)}")
        return Scalar(kind, self.do(f"load {kind.llvm}, ptr {at}"))

    def room(self, kind: Number, count: int) -> str:
        """Address of room for numbers on the stack."""
        raise NotImplementedError
