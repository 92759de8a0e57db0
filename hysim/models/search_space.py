"""What a family declares about itself, so that `identify` needs to know none.

Identification searches a box of *coordinates* that the family chooses: scaled, free of redundancy,
of order one. The family turns coordinates into the user's parameters. Parameters in which the output is
affine are not searched: for given others, the best ones are the solution of a linear regression.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, Protocol, runtime_checkable

from hysim._frozen import FloatArray, frozen
from hysim.records import Record

Parameters = Mapping[str, Any]
"""User's names to floats or to arrays of shape (n_sets,)."""


@frozen
class SearchSpace:
    """The box in which a family's parameters are searched on one record.

    Parameters
    ----------
    coordinates : tuple of str, length n_x
        Names of the internal coordinates.
    lower, upper : array, shape (n_x,)
        The box. An unbounded side is infinite.
    starts : array, shape (n_starts, n_x)
        Points from which a search should begin beside the random ones.
    names : tuple of str
        The user's free parameters in the order in which they are reported, the linear ones among them.
    columns : tuple of str
        All parameters in which the output is affine, free or held, in the order of the regressors.
    linear : tuple of str
        Those of them that are free.
    held : mapping
        The user's parameters that are not free, and their values.
    parameters : callable
        Coordinates, shape (n_sets, n_x), to the free parameters that are not linear, each (n_sets,).
    redundant : tuple of tuples of str
        Groups of parameters of which the data can tell only the product.
    regions : mapping
        Name to the box (lower, upper) of a part of the space that has a meaning of its own.
    bounds : mapping
        The user's bounds on linear parameters, name to (lower, upper).
    state : tuple of str
        Parameters, searched or linear, that describe the state at the first sample. Of several records each
        has its own.
    screened : int, optional
        Random points that a search should try beside the starts, where one evaluation is dear; 0 for none.
    drawn : tuple of two arrays, shape (n_x,) each, optional
        Lower and upper side of the part of the box from which these points are drawn; by default all of it.
    """

    coordinates: tuple[str, ...]
    lower: FloatArray
    upper: FloatArray
    starts: FloatArray
    names: tuple[str, ...]
    columns: tuple[str, ...]
    linear: tuple[str, ...]
    held: Mapping[str, float]
    parameters: Callable[[FloatArray], dict[str, FloatArray]]
    redundant: tuple[tuple[str, ...], ...] = ()
    regions: Mapping[str, tuple[FloatArray, FloatArray]] = field(default_factory=dict)
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    state: tuple[str, ...] = ()
    screened: int | None = None
    drawn: tuple[FloatArray, FloatArray] | None = None


@dataclass(frozen=True)
class Freedom:
    """What the user says about the parameters; see `hysim.identify` for the meaning."""

    fixed: Mapping[str, float] = field(default_factory=dict)
    free: tuple[str, ...] = ()
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    initial: str | None = None

    def starts_at_rest(self, default: str = "free") -> bool:
        """Whether the initial state is not free, where the user says nothing by the family's default."""
        if self.initial not in (None, "free", "rest", "periodic"):
            raise ValueError(f'initial must be "free", "rest" or "periodic", got {self.initial!r}')
        return (self.initial or default) != "free"

    def held(
        self,
        defaults: Mapping[str, float],
        *,
        redundant: tuple[tuple[str, ...], ...] = (),
        at_rest: Iterable[str] = (),
    ) -> dict[str, float]:
        """The parameters that are not free, and their values.

        They are the fixed ones, those that are zero `at_rest`, and the first of each redundant group that
        has none of them; a name in `free` is taken out of the last two.

        Raises
        ------
        ValueError
            If a name is unknown, or both fixed and free.
        """
        for argument, names in (("fixed", tuple(self.fixed)), ("free", self.free)):
            for name in names:
                if name not in defaults:
                    raise ValueError(f"{argument} names {name!r}; the parameters are {', '.join(defaults)}")
        if both := set(self.fixed) & set(self.free):
            raise ValueError(f"{sorted(both)[0]!r} is both fixed and free")
        held = {name: 0.0 for name in at_rest if name not in self.free}
        held |= {name: float(value) for name, value in self.fixed.items()}
        for group in redundant:
            candidates = [name for name in group if name not in self.free]
            if candidates and not held.keys() & set(group):
                held[candidates[0]] = defaults[candidates[0]]
        return held

    def limits(self, defaults: Mapping[str, float], held: Mapping[str, float]) -> dict[str, tuple[float, float]]:
        """The bounds as floats.

        Raises
        ------
        ValueError
            If a name is unknown or held, or a lower bound is not below its upper one.
        """
        for name, pair in self.bounds.items():
            if name not in defaults or name in held:
                raise ValueError(f"bounds name {name!r}, which is not free; the parameters are {', '.join(defaults)}")
            if len(pair) != 2 or not pair[0] < pair[1]:
                raise ValueError(f"bounds of {name!r} must be (lower, upper) with lower < upper, got {pair}")
        return {name: (float(lower), float(upper)) for name, (lower, upper) in self.bounds.items()}


ALL_FREE = Freedom()


class Identifiable(Protocol):
    """What `identify` takes: a model class, a model as the start, or a structure.

    A family may offer two methods more: ``steady(parameters, record)``, the parameters of the state at the first
    sample of a record that repeats itself, by name, and ``notes(record, model)``, what a user should know of the
    identified model, as a tuple of phrases.
    """

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """Declare the box for `record`."""
        ...

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """Columns in which the output is affine, shape (n_sets, n_samples, n_columns + 1).

        Output = columns[..., :-1] @ (the parameters named by `SearchSpace.columns`) + columns[..., -1].
        A set that leaves the finite numbers has columns that are not finite.
        """
        ...

    def assemble(self, parameters: Mapping[str, float]) -> Any:
        """Build the model from the user's parameters."""
        ...


class DirectFit(NamedTuple):
    """A model that was fitted in one step.

    The `model`; its effective number of parameters, `degrees_of_freedom`; and at each sample that it was fitted to the
    standard error of its output for noise of standard deviation 1, `spread` (n,).
    """

    model: Any
    degrees_of_freedom: float
    spread: FloatArray


@runtime_checkable
class Direct(Protocol):
    """A family without memory that is fitted in one step, not searched for: `identify` takes it too."""

    def fitted(self, u: FloatArray, y: FloatArray) -> DirectFit:
        """The fit to outputs `y` at inputs `u`, both of shape (n,)."""
        ...

    def response(self, u: FloatArray) -> FloatArray:
        """Output at the inputs `u`, shape (n,)."""
        ...


@dataclass(frozen=True)
class Holding:
    """Something identifiable, some of its parameters held at values unless the user says more of them."""

    whole: Identifiable
    values: Mapping[str, float]

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """That of the whole, in less space."""
        held = {name: value for name, value in self.values.items() if name not in freedom.free}
        return self.whole.search_space(record, replace(freedom, fixed={**held, **freedom.fixed}))

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """Those of the whole."""
        return self.whole.regressors(parameters, record)

    def assemble(self, parameters: Mapping[str, float]) -> Any:
        """The model from the user's parameters."""
        return self.whole.assemble(parameters)

    def __getattr__(self, name: str) -> Any:
        """The two methods that a family may offer more."""
        if name not in ("steady", "notes"):
            raise AttributeError(name)
        return getattr(self.whole, name)
