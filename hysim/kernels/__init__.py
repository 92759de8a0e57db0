"""Compiled numerics on plain floats and arrays; nothing here knows a class.

Steps, `step(parameters, state, u) -> y`, and their starts, `start(parameters, state, u0)`, keep to a subset of Python
that can be translated to C one statement after the other:

1. Arguments are annotated; arrays are contiguous vectors of doubles.
2. Scalars are floats, integers or truth values; `and` and `or` join truth values only.
3. Loops are `while`, or `for ... in range(...)` with a step of 1 or -1, whose variable is not assigned in the loop and
   not read after it.
4. Indices are not negative, but for a literal -1; slices lie inside their array and have no stride.
5. No arithmetic of whole arrays, and no `a[:] = b`: a loop copies, and compiles seconds faster.
6. Room for work is a part of the state, or `np.empty` of a constant size.
7. Tuples are results and targets only, and hold numbers.
8. Globals are numbers, vectors of doubles, or kernels.
9. No recursion, exceptions, keyword arguments, closures, or choice between arrays.
10. At most one call in an expression writes to the state.

What does not change from sample to sample is prepared before, among the parameters. The front of the state is the last
input and the memory; a workspace may follow, which holds nothing that the memory does not determine.
"""
