"""Compiled numerics on plain floats and arrays; nothing here knows a class.

Steps, `step(parameters, state, u) -> y`, and their starts, `start(parameters, state, u0)`, keep to a subset of Python
that `hysim.export` translates to C one statement after the other:

1. Numbers among the arguments are annotated; arrays are contiguous vectors of doubles, which `reshape` may give more
   axes.
2. Scalars are floats, integers or truth values; `and` and `or` join truth values only.
3. Loops are `while`, or `for ... in range(...)` with a constant step, whose variable has no other use; neither has an
   `else`.
4. Indices are not negative, but for a literal -1; slices lie inside their array and have no stride.
5. No arithmetic of whole arrays, and no `a[:] = b`: a loop copies, and compiles seconds faster.
6. Room for work is a part of the state, or `np.empty` of a constant size.
7. Tuples hold numbers, and are results, targets, arguments and names; a choice between two is a target's.
8. Globals are numbers, vectors of doubles, or kernels.
9. No recursion, exceptions, keyword arguments, inner functions, or choice between arrays. A step may itself be an
   inner function that has kernels from around it.
10. At most one call in an expression writes to the state.

What does not change from sample to sample is prepared before, among the parameters. The front of the state is the last
input and the memory; a workspace may follow, which holds nothing that the memory does not determine.
"""
