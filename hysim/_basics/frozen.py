"""Frozen dataclasses, compared and copied by value: `frozen` has read-only arrays, `checked` finite numbers, too."""

import dataclasses
import functools
import inspect
import math
import sys
import types
import typing
from collections.abc import Callable, Iterable, Mapping, Sized
from types import MappingProxyType
from typing import Any, TypeVar, dataclass_transform

import numpy as np
import numpy.typing as npt

from hysim._basics.names import among, meant
from hysim._basics.results import model_or_class

FloatArray = npt.NDArray[np.float64]
Positive = typing.Annotated[float, "positive"]
NotNegative = typing.Annotated[float, "not negative"]
Interval = typing.Annotated[tuple[float, ...], "lowest and highest"]
Count = typing.Annotated[int, "at least 1"]
"""Hints of fields that are checked where a specification is made; so are families and choices (`Literal`)."""

_RULES = (Positive, NotNegative, Interval, Count)
LAST = {"last": True}  # metadata of a field of a base class that stands behind those of its families
T = TypeVar("T")

_MOST_SUBSTEPS = 1e6
_TOO_LARGE = f"a number beyond {sys.float_info.max:.2g}"


@dataclass_transform(kw_only_default=True, frozen_default=True)
def frozen(cls: type[T]) -> type[T]:
    """Make `cls` a frozen keyword-only dataclass with read-only arrays and equality by value."""
    return _freeze(cls, finite=False)


@dataclass_transform(kw_only_default=True, frozen_default=True)
def checked(cls: type[T]) -> type[T]:
    """Make `cls` frozen, and refuse numbers that are not finite."""
    return _freeze(cls, finite=True)


def check_positive(**numbers: float | None) -> None:
    """A ValueError for the first number by name that is not positive; None is no number."""
    for name, value in numbers.items():
        if value is not None and not value > 0.0:
            raise ValueError(f"{name} must be positive, got {value}")


def check_not_negative(**numbers: float | None) -> None:
    """A ValueError for the first number by name that is negative; None is no number."""
    for name, value in numbers.items():
        if value is not None and not value >= 0.0:
            raise ValueError(f"{name} must not be negative, got {value}")


def check_finite(**numbers: float | None) -> None:
    """A ValueError for the first number by name that is not finite; None is no number."""
    for name, value in numbers.items():
        if value is not None and not math.isfinite(value):
            raise ValueError(f"{name} must be finite, got {value}")


def check_positive_and_finite(**numbers: float | None) -> None:
    """A ValueError for the first number by name that is not positive, or infinite; None is no number."""
    for name, value in numbers.items():
        if value is not None and not 0.0 < value < math.inf:
            raise ValueError(f"{name} must be positive and finite, got {value}")


def read_only(
    values: npt.ArrayLike, name: str = "values", *, ndim: int | None = None, finite: bool = True
) -> FloatArray:
    """Return a read-only contiguous float64 copy of `values`.

    A TypeError is raised unless they are real numbers, a ValueError if an element is masked, the number of axes is not
    `ndim`, or (with `finite`) an element is not finite.
    """
    array = _as_float_array(values, name)
    if ndim is not None and array.ndim != ndim:
        words = f"{name} must have {ndim} axes, got shape {array.shape}"
        raise ValueError(wrong_axes(name, array) if ndim == 1 else words)
    if finite and np.count_nonzero(np.isfinite(array)) != array.size:  # all() of a short array takes twice as long
        place = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        index = place[0] if len(place) == 1 else place
        raise ValueError(f"{name} must be finite, got {array[place]} at index {index}")
    array.setflags(write=False)
    return array


def wrong_axes(name: str, array: npt.NDArray[Any]) -> str:
    mend = "np.ravel makes it flat" if 1 in array.shape else f"take one column, {name}[:, 0]"
    return f"{name} must have 1 axis, got shape {array.shape}{f': {mend}' if array.ndim == 2 else ''}"


def vectors(**values: npt.ArrayLike) -> list[FloatArray]:
    """Return read-only copies of vectors of equal lengths; other errors are those of `read_only`."""
    arrays = {name: read_only(each, name, ndim=1) for name, each in values.items()}
    first, *others = arrays
    for name in others:
        if arrays[name].size != arrays[first].size:
            sizes = f"{arrays[first].size} and {arrays[name].size}"
            raise ValueError(f"{first} and {name} must have equal lengths, got {sizes}")
    return [*arrays.values()]


def check_lengths(*, empty: bool = True, **values: Sized) -> None:
    """A ValueError for values by name that are not equally long, or that are empty where they must not be."""
    sizes = [len(each) for each in values.values()]
    if len({*sizes}) > 1 or not (empty or sizes[0]):
        names, numbers = (f"{', '.join(each[:-1])} and {each[-1]}" for each in ([*values], [*map(str, sizes)]))
        raise ValueError(f"{names} must be equally long{'' if empty else ' and not empty'}, got {numbers}")


def check_one_each(name: str, values: Sized, number: int, kind: str) -> None:
    """A ValueError for values that are not as many as the things of a kind, such as masses."""
    if len(values) != number:
        raise ValueError(f"{name} must hold one number for each of {number} {kind}, got {len(values)}")


def check_choice(name: str, value: object, choices: Iterable[object]) -> None:
    if value not in (known := tuple(choices)):
        raise ValueError(f"{name} must be one of {', '.join(map(str, known))}, got {value!r}{meant(value, known)}")


def check_count(name: str, value: object) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or value < 1:
        raise ValueError(f"{name} must be an integer of at least 1, got {value!r}")


def _as_float_array(values: npt.ArrayLike, name: str) -> FloatArray:
    if type(values) is np.ndarray and values.dtype is np.dtype(float):  # nearly every one: checks take long
        return values.copy()
    if _is_masked(values):
        raise ValueError(f"{name} must have no masked element: leave these samples out, or fill them with filled()")
    try:
        array = np.asarray(values)
        kind = array.dtype.kind
        numbers = np.array(array, dtype=np.float64, order="C") if kind not in "cmM" else None
    except OverflowError:
        raise ValueError(f"{name} must be finite, got {_TOO_LARGE}") from None
    except (TypeError, ValueError, RecursionError) as error:
        raise TypeError(f"{name} must be numbers, got {type(values).__name__}: {error}") from None
    if kind == "c":
        raise TypeError(f"{name} must be real numbers, got complex ones")
    if numbers is None:  # NumPy would convert dates to counts of their unit
        raise TypeError(f"{name} must be numbers, got dates or times: give seconds from the first one")
    return numbers


def _is_masked(values: Any) -> bool:
    """Whether an element is masked: NumPy would take the number under the mask, or make nan with a warning."""
    if isinstance(values, (list, tuple)):
        return any(isinstance(each, np.ma.MaskedArray) and np.ma.is_masked(each) for each in values)
    return type(values) is not np.ndarray and bool(np.ma.is_masked(values))


def _freeze(cls: type[T], *, finite: bool) -> type[T]:
    check = getattr(cls, "__post_init__", None)  # a class may have none, or inherit it
    prepare = getattr(cls, "_prepare", None)  # for arguments that say more than their numbers

    def coerce_then_check(self: Any) -> None:
        if prepare is not None:
            prepare(self)
        for name, coerce in _coercions(type(self), finite).items():  # type: ignore[arg-type]
            object.__setattr__(self, name, coerce(vars(self)[name], name))
        for name, kinds in _checks(type(self)).items() if finite else ():  # type: ignore[arg-type]
            _check_kind(vars(self)[name], name, kinds)
        if check is not None:
            check(self)

    cls.__post_init__ = coerce_then_check  # type: ignore[attr-defined]
    cls.__eq__ = _equal  # type: ignore[method-assign]
    cls.__hash__ = _hash  # type: ignore[method-assign]
    cls.__reduce__ = _reduce  # type: ignore[method-assign]
    made = dataclasses.dataclass(frozen=True, kw_only=True, eq=False)(cls)
    if _field_names(made)[2]:  # type: ignore[arg-type]
        made.__repr__ = _repr_without_none  # type: ignore[method-assign]
        made.__doc__ = _with_last(made.__doc__ or "")
        _, *arguments = inspect.signature(made.__init__).parameters.values()
        arguments.sort(key=lambda each: each.name in _field_names(made)[2])  # type: ignore[arg-type]
        made.__signature__ = inspect.Signature(arguments)  # type: ignore[attr-defined]
    return _with_advice(made)


_PARAMETERS = "\n    Parameters\n    ----------\n"
_PLACE = """    u0 : float, optional
        Input at which the initial memory holds [unit of u], from which the law first moves to an input's first sample;
        by default that sample itself.
    u_range : (float, float), optional
        Lowest and highest input of the record that the law was identified on [unit of u].
"""


def _with_last(text: str) -> str:
    """A docstring whose section of parameters ends with those that are `LAST`."""
    before, heading, rest = text.partition(_PARAMETERS)
    if not heading or _PLACE in text:
        return text
    own, blank, others = rest.partition("\n\n    ")
    return before + heading + own.rstrip() + "\n" + (_PLACE.rstrip("\n") if blank else _PLACE) + blank + others


def _repr_without_none(self: Any) -> str:
    return f"{type(self).__qualname__}({', '.join(f'{name}={value!r}' for name, value in given_items(self).items())})"


def _with_advice(cls: type[T]) -> type[T]:
    """Let the constructor name its parameters, and the one that may have been meant, where one is unknown."""
    generated: Any = cls.__init__

    @functools.wraps(generated)
    def construct(self: Any, *arguments: Any, **values: Any) -> None:
        try:
            generated(self, *arguments, **values)
        except TypeError:
            fields = dataclasses.fields(cls)  # type: ignore[arg-type]
            known, by_place = [*_field_names(cls)[0]], sum(not field.kw_only for field in fields)  # type: ignore[arg-type]
            unknown = next((name for name in values if name not in known), None)
            if unknown is None and len(arguments) <= by_place:
                raise
            most = f"at most {by_place} positional argument" if by_place else "no positional argument"
            what = f"takes {most}" if unknown is None else f"has no parameter {unknown!r}"
            raise TypeError(f"{cls.__name__} {what}; by name it takes {among(unknown, known)}") from None

    cls.__init__ = construct  # type: ignore[method-assign]
    return cls


@functools.cache
def _coercions(cls: Any, finite: bool) -> dict[str, Callable[[Any, str], Any]]:
    own: dict[Any, Callable[..., Any]] = {float: _as_float, tuple[float, ...]: _as_float_tuple, FloatArray: read_only}
    rules: dict[Any, Callable[[Any, str], Any]] = {}
    for kind, coerce in own.items():
        rules[kind] = functools.partial(coerce, finite=finite)
        rules[kind | None] = functools.partial(_if_any, rules[kind])
    hints = typing.get_type_hints(cls)
    kinds = {field.name: field.metadata.get("kind", hints[field.name]) for field in dataclasses.fields(cls)}
    coercions = {name: rules.get(kind) for name, kind in kinds.items()}
    mapping = _as_named_parts if finite else as_mapping
    coercions |= {name: mapping for name in coercions if typing.get_origin(hints[name]) is Mapping}
    if finite:  # the parts of a specification are models, and no results of fits
        coercions = {name: _as_parts if coerce is None else coerce for name, coerce in coercions.items()}
    return {name: coerce for name, coerce in coercions.items() if coerce is not None}


@functools.cache
def _checks(cls: Any) -> dict[str, tuple[Any, ...]]:
    """Kinds of hysim's own fields for which `_check_kind` has a rule; of an optional one None is a kind, too."""
    own = {
        name for base in cls.__mro__ if base.__module__.startswith("hysim.") for name in inspect.get_annotations(base)
    }
    own &= {each.name for each in dataclasses.fields(cls)}
    checks = {}
    for name, hint in typing.get_type_hints(cls, include_extras=True).items() if own else ():
        kinds = typing.get_args(hint) if typing.get_origin(hint) in (types.UnionType, typing.Union) else (hint,)
        is_literal = typing.get_origin(kinds[0]) is typing.Literal
        if name in own and (is_literal or kinds[0] in _RULES or dataclasses.is_dataclass(kinds[0])):
            checks[name] = kinds
    return checks


def _check_kind(value: Any, name: str, kinds: tuple[Any, ...]) -> None:
    kind = kinds[0]
    if value is None and types.NoneType in kinds:
        return
    if kind == Positive:
        check_positive(**{name: value})
    elif kind == NotNegative:
        check_not_negative(**{name: value})
    elif kind == Count:
        check_whole(value, name)
    elif kind == Interval:
        if not (len(value) == 2 and value[0] <= value[1]):
            raise ValueError(f"{name} must be (lowest, highest), got {value}")
    elif typing.get_origin(kind) is typing.Literal:
        check_choice(name, value, typing.get_args(kind))
    elif not isinstance(value, kinds):
        names = [each.__name__ for each in kinds if each is not types.NoneType]
        words = f"a {', a '.join(names[:-1])} or a {names[-1]}" if names[1:] else f"of {names[0]}"
        raise TypeError(f"{name} must be {words}, got {type(value).__name__}")


def _if_any(coerce: Callable[[Any, str], Any], value: Any, name: str) -> Any:
    return None if value is None else coerce(value, name)


def _as_float(value: Any, name: str, *, finite: bool) -> float:
    if type(value) is float and math.isfinite(value):  # nearly every one; the checks take most of the time of a law
        return value
    if isinstance(value, (str, bytes, bool, list, tuple, Mapping)) or np.ndim(value) != 0:
        raise TypeError(f"{name} must be a number, got {value!r}")
    if np.ma.is_masked(value):
        raise ValueError(f"{name} must be a number, got a masked one")
    try:
        number = float(value)
    except OverflowError:
        raise ValueError(f"{name} must be finite, got {_TOO_LARGE}") from None
    except (TypeError, ValueError):
        raise TypeError(f"{name} must be a number, got {value!r}") from None
    if finite and not math.isfinite(number):
        raise ValueError(f"{name} must be finite, got {number}")
    return number


def _as_float_tuple(values: Any, name: str, *, finite: bool) -> tuple[float, ...]:
    several = isinstance(values, (list, tuple)) or np.ndim(values) != 0
    return tuple(read_only(values if several else [values], name, ndim=1, finite=finite).tolist())


def as_mapping(values: Mapping[Any, Any], name: str) -> Mapping[Any, Any]:
    """A read-only copy of a mapping; TypeError for anything else."""
    if not isinstance(values, Mapping):
        raise TypeError(f"{name} must be a mapping, got {type(values).__name__}")
    return MappingProxyType(dict(values))


def _as_parts(value: Any, name: str) -> Any:
    return type(value)(map(model_or_class, value)) if type(value) in (list, tuple) else model_or_class(value)


def _as_named_parts(values: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    return MappingProxyType({key: model_or_class(each) for key, each in as_mapping(values, name).items()})


def check_whole(value: Any, name: str, *, least: int = 1) -> None:
    """Refuse what is no whole number from `least` up: TypeError if it is no int, ValueError if it is too small."""
    if isinstance(value, bool) or not isinstance(value, int):
        raise TypeError(f"{name} must be a whole number, got {value!r}")
    if value < least:
        raise ValueError(f"{name} must {f'be at least {least}' if least else 'not be negative'}, got {value}")


def whole_substeps(count: float) -> int:
    """Sub-steps of a sample, at least one; ValueError for more than a computer takes in a reasonable time."""
    if not count < _MOST_SUBSTEPS:
        reason = "it is too long for the stiffness and damping over the mass"
        raise ValueError(f"a sample would take {count:.3g} sub-steps: {reason}")
    return max(1, math.ceil(count))


def items(value: Any) -> dict[str, Any]:
    values = vars(value)
    return {name: values[name] for name in _field_names(type(value))[0]}  # type: ignore[arg-type]


def own_items(value: Any) -> dict[str, Any]:
    """Fields of a frozen value by name, without those that are `LAST`."""
    last = last_names(type(value))
    return {name: item for name, item in items(value).items() if name not in last}


def given_items(value: Any) -> dict[str, Any]:
    """Fields of a frozen value by name, without those that are `LAST` and None."""
    last = last_names(type(value))
    return {name: item for name, item in items(value).items() if item is not None or name not in last}


def last_names(cls: Any) -> tuple[str, ...]:
    return _field_names(cls)[2]


@functools.cache
def _field_names(cls: Any) -> tuple[tuple[str, ...], ...]:
    fields = sorted(dataclasses.fields(cls), key=lambda field: "last" in field.metadata)
    return (
        tuple(field.name for field in fields),
        tuple(field.name for field in fields if field.compare),
        tuple(field.name for field in fields if "last" in field.metadata),
    )


def _compared(value: Any) -> tuple[Any, ...]:
    values = vars(value)
    return tuple(values[name] for name in _field_names(type(value))[1])  # type: ignore[arg-type]


def _key(value: Any) -> Any:
    if type(value) is float:  # nearly every one
        return "nan" if math.isnan(value) else value
    if isinstance(value, np.ndarray):
        return value.shape, (value + 0.0 if value.dtype.kind == "f" else value).tobytes()
    if isinstance(value, (tuple, list)):
        return tuple(_key(item) for item in value)
    if isinstance(value, Mapping):
        return tuple((name, _key(item)) for name, item in sorted(value.items()))
    return "nan" if isinstance(value, float) and math.isnan(value) else value


def _equal(self: Any, other: object) -> Any:
    if type(self) is not type(other):
        return NotImplemented
    pairs = zip(_compared(self), _compared(other), strict=True)
    return all(one is another or _key(one) == _key(another) for one, another in pairs)


def _hash(self: Any) -> int:
    return hash((type(self), _key(_compared(self))))


def _reduce(self: Any) -> tuple[Any, ...]:
    plain = {name: dict(item) if isinstance(item, MappingProxyType) else item for name, item in items(self).items()}
    return _rebuild, (type(self), plain)


def _rebuild(cls: type, items: dict[str, Any]) -> Any:
    return cls(**items)
