"""The parameters of a step as expressions of a law's numbers.

`Law.pack` turns the fields of laws into what their step takes, in numpy. It is run once on arrays of symbols, which
record the arithmetic; the record is written as a function in C99 or JavaScript, for programs whose numbers may still be
changed where they run.
"""

import itertools
from collections.abc import Iterable, Sequence

import numpy as np

from hysim._frozen import FloatArray
from hysim.models.law import Law
from hysim.models.tracing.symbols import HELPERS, Number, Symbol, Tape, UntraceableError
from hysim.models.tracing.traced import traced

_MANY = 8  # equal numbers in a row


class Packing:
    """Parameters and first memory of a law's step, as expressions of its numbers.

    Parameters
    ----------
    fields : tuple of str
        Names of the numbers that may be changed, in the order of the law's `scalars`.
    parameters : tuple
        Parameters of the step: floats, and symbols that depend on the fields.
    memory : tuple
        Front of the state before the first sample, likewise; its first place is that of the last input, zero.
    tape : Tape
        The operations.
    """

    def __init__(
        self, fields: tuple[str, ...], parameters: tuple[Number, ...], memory: tuple[Number, ...], tape: Tape
    ) -> None:
        self.fields, self.parameters, self.memory, self._tape = fields, parameters, memory, tape

    def evaluate(self, values: Sequence[float]) -> tuple[FloatArray, FloatArray]:
        """Parameters and memory for `values` of the fields.

        Parameters
        ----------
        values : sequence of float, length n_fields
            In the order of `fields`.

        Returns
        -------
        parameters, memory : array
            As `Law.packed` of the law with these values has them.
        """
        if len(values) != len(self.fields):
            raise ValueError(f"expected {len(self.fields)} values, got {len(values)}")
        numbers = self._tape.evaluate((*self.parameters, *self.memory), values)
        size = len(self.parameters)
        return np.array(numbers[:size]), np.array(numbers[size:])

    def to_c(self, name: str) -> str:
        """A function ``static void name(const double *fields, double *parameters, double *state)`` in C99.

        It needs ``math.h`` alone. Compile it with ``-ffp-contract=off``.

        Examples
        --------
        >>> import hysim as hs
        >>> from hysim.export._packing import packing
        >>> print(packing(hs.Line(offset=0.5, slope=2.0), free=("slope",)).to_c("pack"))
        static void pack(const double *fields, double *parameters, double *state)
        {
            parameters[0] = 0.5;
            parameters[1] = fields[0];
            state[0] = 0.0;
        }
        <BLANKLINE>
        """
        lines, helpers = self._lines("c", name)
        unused = () if any("fields[" in line for line in lines) else ("    (void)fields;",)
        head = f"static void {name}(const double *fields, double *parameters, double *state)\n{{"
        return "\n".join((*helpers, head, *unused, *lines, "}\n"))

    def to_js(self, name: str) -> str:
        """A function ``name(fields, parameters, state)`` in JavaScript that fills the last two."""
        lines, helpers = self._lines("js", name)
        return "\n".join((*helpers, f"function {name}(fields, parameters, state) {{", *lines, "}\n"))

    def _lines(self, language: str, name: str) -> tuple[list[str], list[str]]:
        """Statements of a function, and the functions that it calls."""
        locals_, texts = self._tape.texts((*self.parameters, *self.memory), language)
        truths = self._tape.truth_values()
        words = {local: "const int" if local in truths else "const double" for local, _ in locals_}
        statements = [
            f"    {words[local] if language == 'c' else 'const'} {local} = {_bare(text)};" for local, text in locals_
        ]
        size = len(self.parameters)
        for target, values in (("parameters", texts[:size]), ("state", texts[size:])):
            statements += _assignments(target, values, "int" if language == "c" else "let")
        called = [helper for helper in HELPERS[language] if any(f"@{helper}(" in line for line in statements)]
        helpers = [HELPERS[language][helper].replace("@", f"{name}_") for helper in called]
        return [line.replace("@", f"{name}_") for line in statements], helpers


def packing(law: Law, free: Iterable[str] | None = None) -> Packing:
    """The parameters of a law's step as expressions of its numbers.

    Parameters
    ----------
    law : Law
        A law.
    free : iterable of str, optional
        Names, as in `law.scalars`, of the numbers that may be changed; by default all but those in `law.structural`.
        The others are constants.

    Returns
    -------
    Packing

    Raises
    ------
    ValueError
        If a name is unknown, or the step or its parameters cannot be computed from it by arithmetic alone.

    Examples
    --------
    >>> import hysim as hs
    >>> from hysim.export._packing import packing
    >>> dahl = packing(hs.Dahl(), free=("stiffness", "coulomb"))
    >>> dahl.evaluate([2.0, 4.0])[0].tolist()
    [2.0, 0.5, 0.0, 1.0, 1.0, 0.0, 0.0]
    """
    scalars, family = law.scalars, type(law).__name__
    names = [name for name in scalars if name not in law.structural] if free is None else list(free)
    if unknown := [name for name in names if name not in scalars]:
        raise ValueError(f"free names {unknown[0]!r}: a {family} has {', '.join(scalars)}")
    if chosen := [name for name in names if name in law.structural]:
        raise ValueError(f"{chosen[0]} of this {family} decides which step it has and cannot be free: leave it out")
    fields = tuple(name for name in scalars if name in names)
    tape = Tape(fields)
    columns = {name: traced(tape.field(k)) for k, name in enumerate(fields)}
    try:
        parameters, memory = law.pack(law.completed(law.exchanged(columns)))
        return Packing(fields, _row(parameters), _row(memory), tape)
    except UntraceableError as error:
        which = ", ".join(error.names)
        raise ValueError(
            f"the parameters of this {family} are no expressions of {which}: leave {which} out of free"
        ) from None


def _row(table: FloatArray) -> tuple[Number, ...]:
    """The numbers of one law."""
    return tuple(number if isinstance(number, Symbol) else float(number) for number in table[0].tolist())


def _assignments(target: str, texts: list[str], word: str) -> list[str]:
    """Statements that fill an array; many equal numbers in a row are a loop."""
    lines, k = [], 0
    for text, run in itertools.groupby(texts):
        count = len(list(run))
        if count < _MANY:
            lines += [f"    {target}[{i}] = {_bare(text)};" for i in range(k, k + count)]
        else:
            lines.append(f"    for ({word} k = {k}; k < {k + count}; k++) {target}[k] = {_bare(text)};")
        k += count
    return lines


def _bare(text: str) -> str:
    """A text without the parentheses around the whole of it."""
    if not (text.startswith("(") and text.endswith(")")):
        return text
    depth = 0
    for place, character in enumerate(text):
        depth += (character == "(") - (character == ")")
        if depth == 0 and place < len(text) - 1:
            return text
    return text[1:-1]
