"""The search space of a law with several values of some parameters, one for each place of a polynomial."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from hysim._frozen import FloatArray
from hysim.models.search_space import SearchSpace

_HALVINGS = 60
_SCREENED = 128  # random points beside starts, which are the ends of searches themselves


def expanded(
    space: SearchSpace, names: Mapping[str, tuple[str, ...]], starts: Sequence[Mapping[str, float]] = ()
) -> SearchSpace:
    """The space with the `names` of values in place of parameters, each in the box of the parameter.

    `starts` are further points: the law's constant parameters and the values by name.
    """
    if not names:
        return space
    own = [(k, name) for k, each in enumerate(space.coordinates) for name in names.get(each, (each,))]
    places = [k for k, _ in own]
    several = {each: [j for j, (k, _) in enumerate(own) if space.coordinates[k] == each] for each in names}

    def laid(side: FloatArray) -> FloatArray:
        return side[..., places]

    def base(x: FloatArray) -> FloatArray:
        """The law's own coordinates, the mean where there are several values."""
        columns = [x[:, np.equal(places, i)].mean(axis=1) for i in range(len(space.coordinates))]
        return np.stack(columns, axis=1) if columns else np.empty((len(x), 0))

    def parameters(x: FloatArray) -> dict[str, FloatArray]:
        sets = np.atleast_2d(x)
        middle = base(sets)
        found = dict(space.parameters(middle))
        for each, columns in several.items():
            if not columns:
                continue
            del found[each]
            for name, j in zip(names[each], columns, strict=True):
                at_place = middle.copy()
                at_place[:, places[j]] = sets[:, j]
                found[name] = space.parameters(at_place)[each]
        return found

    def expanded_names(known: Sequence[str]) -> tuple[str, ...]:
        return tuple(name for each in known for name in names.get(each, (each,)))

    encode = _encoder(space)
    further = [
        [float(encode(_at_place(start, names, name))[k]) for k, name in own] for start in starts if space.coordinates
    ]
    return replace(
        space,
        coordinates=tuple(name for _, name in own),
        lower=laid(space.lower),
        upper=laid(space.upper),
        starts=np.concatenate([np.reshape(further, (len(further), len(own))), laid(space.starts)]),
        names=expanded_names(space.names),
        columns=expanded_names(space.columns),
        linear=expanded_names(space.linear),
        parameters=parameters,
        regions={each: (laid(low), laid(high)) for each, (low, high) in space.regions.items()},
        bounds={name: pair for each, pair in space.bounds.items() for name in names.get(each, (each,))},
        physical={name: pair for each, pair in space.physical.items() for name in names.get(each, (each,))},
        drawn=space.drawn and (laid(space.drawn[0]), laid(space.drawn[1])),
        encoded=None,
        screened=_SCREENED if starts else space.screened,
    )


def _at_place(start: Mapping[str, float], names: Mapping[str, tuple[str, ...]], chosen: str) -> dict[str, float]:
    """The law's parameters of a start with the chosen value of one polynomial, and the means of the others."""
    known = {name: value for name, value in start.items() if not any(name in each for each in names.values())}
    for parameter, values in names.items():
        if values[0] in start:
            at = chosen if chosen in values else None
            known[parameter] = start[at] if at else float(np.mean([start[name] for name in values]))
    return known


def _encoder(space: SearchSpace) -> Callable[[Mapping[str, float]], FloatArray]:
    """A function from the law's parameters to its coordinates inside the box."""
    if space.encoded is not None:
        return space.encoded
    middle = space.starts[0] if len(space.starts) else 0.5 * (space.lower + space.upper)

    def encoded(parameters: Mapping[str, float]) -> FloatArray:
        x = middle.copy()
        for k, name in enumerate(space.coordinates):
            if name in parameters:
                x[k] = _coordinate(space, x, k, name, parameters[name])
        return x

    return encoded


def _coordinate(space: SearchSpace, x: FloatArray, k: int, name: str, value: float) -> float:
    """The coordinate of a parameter's value, by halving the box: each is a monotone function of its own coordinate."""

    def at(c: float) -> float:
        return float(np.ravel(space.parameters(np.where(np.arange(x.size) == k, c, x)[np.newaxis])[name])[0])

    low, high = float(space.lower[k]), float(space.upper[k])
    rises = at(high) >= at(low)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if (at(middle) < value) == rises else (low, middle)
    return 0.5 * (low + high)
