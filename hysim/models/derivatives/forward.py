"""Steps in forward mode: each number beside its rate, by a walk over the syntax trees of the portable subset.

    y = f(x)    becomes    y, y__d = f(x, x__d)

Each function of the subset (`hysim/kernels/__init__.py`) becomes one for each set of arguments that have a rate. Where
the program branches, the rate is that of the branch that the value takes. A comparison ``x == y`` of numbers with
different rates is false: next to the point the numbers differ, and the derivative is that of the general case.
"""

import inspect
import textwrap
from collections.abc import Callable
from typing import Any, NamedTuple

from hysim.kernels.tangents import rules
from hysim.models.derivatives.body import Body
from hysim.models.derivatives.iterations import in_place_of
from hysim.models.derivatives.sources import argument_names, returned_kinds
from hysim.models.tracing.routine import plain, routine

RULES = ("power_rate", "root_rate", "size_rate", "quotient", "distance_rate", "signed_rate")


class Translated(NamedTuple):
    """A function of the module: its name, whether each result is a float, and whether it has rates."""

    name: str
    kinds: tuple[bool, ...]
    has_rates: bool


class Program:
    """Text of a Python module with the functions translated so far, each behind those that it calls."""

    def __init__(self) -> None:
        self.constants: dict[str, Any] = {}
        self.imports: dict[str, str] = {}
        self._functions: dict[Any, Translated] = {}
        self._texts: list[str] = []

    def function(self, of: Callable[..., Any], flags: tuple[Any, ...]) -> Translated:
        """The translation of a function for arguments with a rate (True), without (False), or known as `Fixed`.

        Raises UntranslatableError if the function, or one that it calls, is outside the subset.
        """
        source = routine(in_place_of(plain(of)))
        key = source.function, flags
        if key not in self._functions:
            names, has_rates = argument_names(source), True in flags
            if len(names) != len(flags):
                raise source.refusal(source.tree, f"{source.function.__name__} takes {len(names)} arguments")
            body = Body(self, source, dict(zip(names, flags, strict=True)), has_rates)
            lines = body.translated()
            name = f"f{len(self._functions)}_{source.function.__name__}"
            self._functions[key] = Translated(name, returned_kinds(source), has_rates)
            self._texts.append("\n".join([f"@inner\ndef {name}({', '.join(body.arguments())}):", *lines, ""]))
        return self._functions[key]

    def constant(self, source: Any, name: str, value: Any) -> str:
        """Name of a global array in the module."""
        for known, each in self.constants.items():
            if each is value:
                return known
        alias = f"table{len(self.constants)}"
        self.constants[alias] = value
        module = source.function.__module__
        owner = inspect.getmodule(source.function)
        if owner is not None and vars(owner).get(name) is value and module != "__main__":
            self.imports[alias] = f"from {module} import {name} as {alias}"
        return alias

    def text(self, step: Translated, start: Translated) -> str:
        """The module, with ``along(parameters, parameters__d, state, state__d, u, y, y__d)`` at its end."""
        helpers = ["@inner\n" + textwrap.dedent(inspect.getsource(vars(rules)[name])) for name in RULES]
        return "\n\n".join([*helpers, *self._texts, _ALONG.format(step=step.name, start=start.name)])


_ALONG = '''\
@kernel
def along(parameters, parameters__d, state, state__d, u, y, y__d):
    """Outputs at the samples of `u` and their rates, the state moving along; the first sample not finite, or -1."""
    {start}(parameters, parameters__d, state, state__d, u[0])
    for k in range(u.size):
        y[k], y__d[k] = {step}(parameters, parameters__d, state, state__d, u[k])
        if not abs(y[k]) < 1.7976931348623157e308:
            return k
    return -1
'''


def module_text(step: Callable[..., Any], start: Callable[..., Any]) -> tuple[str, Program]:
    """Text of the module for a step and its start, and the program with its constants."""
    program = Program()
    flags = (True, True, False)
    translated = program.function(start, flags), program.function(step, flags)
    return program.text(translated[1], translated[0]), program
