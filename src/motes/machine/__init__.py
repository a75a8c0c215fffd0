"""From Python functions to machine code, through LLVM and nothing else.

Kernels are scalar functions with loops around them. They need a fraction of what Python is, so that
their compiler is small: `kinds` (numbers, tuples, arrays, and how they mix), `values` (what an
expression stands for while a function is compiled), `block` (LLVM's text, in static single
assignment form), `expressions`, `calls` and `function` (one walk over the syntax tree, which finds
types and writes the text at once), `target` (LLVM: optimisation, object code, loading), `door` (how
Python calls in). Nothing here knows of particles.

The meaning of a function is Python's, on NumPy's scalar types: integers are of 64 bits or less and
wrap, an operation on smaller ones gives 64 bits, `float32` with an integer of 32 bits or more gives
`float64`, a division by an integer 0 gives 0. An index counts from the array's start and is not
checked; only a literal one may be negative.
"""
