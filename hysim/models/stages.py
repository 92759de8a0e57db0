"""A search in stages, as families declare it: a simpler family whose optimum starts it, and parameters freed in turn.

A family contains a simpler one if it is that one for some values of its further parameters, its *neutral* values. The
optimum of the simpler family is then a start, so that the larger family never fits worse.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from hysim.models.search_space import Freedom


@dataclass(frozen=True)
class Stage:
    """Parameters that a search frees together, after it has found the optimum without them.

    Parameters
    ----------
    word : str
        Name of the stage in messages.
    names : tuple of str
        The parameters.
    neutral : mapping
        Those of them without which the stage makes no sense, and their values in the law without it.
    optional : tuple of str
        Parameters that matter only with this stage, and are held unless the user frees them.
    drawn : int
        Random points in these parameters, beside the optimum of the stage before in all others.
    rounds : tuple of (int, int)
        How many of the best points descend for how many steps, round after round.
    idle : mapping
        Parameters of other stages, and the values at which, fixed, they leave this stage without an effect.
    """

    word: str
    names: tuple[str, ...]
    neutral: Mapping[str, float]
    optional: tuple[str, ...] = ()
    drawn: int = 64
    rounds: tuple[tuple[int, int], ...] = ((16, 25),)
    idle: Mapping[str, float] = field(default_factory=dict)

    def is_open(self, freedom: Freedom) -> bool:
        """Whether the user has left something to free that has an effect."""
        is_idle = any(freedom.fixed.get(name) == value for name, value in self.idle.items())
        return not is_idle and any(name not in freedom.fixed for name in self.neutral)

    def is_asked_for(self, freedom: Freedom, values: Mapping[str, float]) -> bool:
        """Whether the user frees, bounds or starts from a law with this stage, `values` by name."""
        named = {*freedom.free, *freedom.bounds}
        return self._is_begun(freedom, values) or bool(named & {*self.names, *self.optional})

    def _is_begun(self, freedom: Freedom, values: Mapping[str, float]) -> bool:
        return any(values[name] != value for name, value in self.neutral.items() if name not in freedom.fixed)

    def opened(self, freedom: Freedom, values: Mapping[str, float]) -> Freedom:
        """`freedom` with the parameters free, the optional ones only where the search begins with the stage."""
        names = tuple(name for name in self.names if name not in freedom.fixed and name not in freedom.free)
        chosen = {*freedom.fixed, *freedom.free, *freedom.bounds}
        others = () if self._is_begun(freedom, values) else self.optional
        held = {name: values[name] for name in others if name not in chosen}
        return replace(freedom, free=(*freedom.free, *names), fixed={**freedom.fixed, **held})

    def closed(self, freedom: Freedom, values: Mapping[str, float]) -> Freedom:
        """`freedom` without the stage: the parameters are held, at their neutral value or else as in `values`."""
        names = (*self.names, *self.optional)
        held = {name: self.neutral.get(name, values[name]) for name in names if name not in freedom.fixed}
        return replace(
            freedom,
            fixed={**freedom.fixed, **held},
            free=tuple(name for name in freedom.free if name not in held),
            bounds={name: pair for name, pair in freedom.bounds.items() if name not in held},
        )


BASE = Stage(word="", names=(), neutral={}, drawn=0, rounds=((4, 25),))
"""Before all stages: the descent from the simpler family's optimum alone."""


class Simpler(NamedTuple):
    """A `family` to identify before a larger one, and how its parameters carry over.

    `names` are its parameters' names in the larger family, `neutral` the values of that family's further ones.
    """

    family: Any
    names: Mapping[str, str]
    neutral: Mapping[str, float]

    def enlarged(self, parameters: Mapping[str, float]) -> dict[str, float]:
        """Parameters of the larger family with the same output."""
        return {**self.neutral, **{larger: parameters[name] for name, larger in self.names.items()}}

    def reduced(self, freedom: Freedom) -> Freedom:
        """The part of `freedom` that is about the parameters of both families."""
        return replace(
            freedom,
            fixed=self.carried(freedom.fixed),
            free=tuple(self.carried(dict.fromkeys(freedom.free))),
            bounds=self.carried(freedom.bounds),
        )

    def carried(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Values of the larger family's parameters by the simpler family's names."""
        return {name: values[larger] for name, larger in self.names.items() if larger in values}


@dataclass(frozen=True)
class Subset:
    """A family of laws that another one contains.

    Parameters
    ----------
    family : type
        The simpler family.
    neutral : mapping
        Further fields of the larger family, and the values for which it is the simpler one. Those of a tuple hold for
        the elements that are not among `names`. Fields that are not mentioned do not matter then.
    names : mapping
        Parameters of the simpler family that have other names in the larger one.
    """

    family: Any
    neutral: Mapping[str, float]
    names: Mapping[str, str] = field(default_factory=dict)

    def of(self, scalars: Mapping[str, float]) -> Simpler:
        """The simpler law with the values of a larger law, whose numbers by name are `scalars`."""
        law = self.family()
        names = {name: self.names.get(name, name) for name in law.scalars}
        rest = {name: name.partition("[")[0] for name in scalars if name not in names.values()}
        neutral = {name: self.neutral[base] for name, base in rest.items() if base in self.neutral}
        return Simpler(law.assemble({name: scalars[larger] for name, larger in names.items()}), names, neutral)
