"""The numbers of a structure by name, and the structure with other ones.

    mass, stiffness, damping        the number where it is one, or the ratio of a ModalDamping of one ratio;
                                    else a factor of the whole, 1 as it is
    mass[1], damping[0]             one of several, the ratio of a mode; likewise influence[2], initial_state[0]
    damping.mass, damping.stiffness of a Rayleigh damping
    elements.0.beta                 of the law of an element, by its own names, such as elements.0.thresholds[1]
    elements.0.bouc_wen.beta        of a part of a sum, or a stage of a cascade
    elements.*.beta                 one number for all elements whose law has this name

A factor multiplies what the other names leave; a name with a number wins over the one with the star.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from hysim._frozen import FloatArray
from hysim.models.protocols import Numbered
from hysim.plants.structures.damping import ModalDamping, Rayleigh

_MATRICES = ("mass", "stiffness", "damping")
_TUPLES = ("influence", "initial_state")
_ELEMENTS, _ALL = "elements", "*"
_SHOWN = 24  # names in a message


def scalars_of(structure: Any) -> dict[str, float]:
    """Every number of a structure by name."""
    numbers: dict[str, float] = {}
    for name in _MATRICES:
        numbers |= _numbers(name, vars(structure)[name])
    for name in _TUPLES:
        numbers |= {f"{name}[{k}]": value for k, value in enumerate(vars(structure)[name])}
    for k, element in enumerate(structure.elements):
        own = element.law.scalars if isinstance(element.law, Numbered) else {}
        numbers |= {f"{_ELEMENTS}.{k}.{name}": float(value) for name, value in own.items()}
    return numbers


def assembled(structure: Any, parameters: Mapping[str, float]) -> Any:
    """The structure with some numbers exchanged.

    Raises ValueError if a name is unknown, or a constructor refuses a number.
    """
    others = expanded(structure.scalars, parameters)
    changes: dict[str, Any] = {}
    for name in _MATRICES:
        if own := {key: value for key, value in others.items() if key.partition("[")[0].partition(".")[0] == name}:
            changes[name] = _changed(name, vars(structure)[name], own)
    for name in _TUPLES:
        if own := {key: value for key, value in others.items() if key.startswith(f"{name}[")}:
            changes[name] = tuple(_placed(name, np.array(vars(structure)[name]), own).tolist())
    elements = [_with_law(element, _below(others, f"{_ELEMENTS}.{k}")) for k, element in enumerate(structure.elements)]
    return replace(structure, **changes, elements=tuple(elements))


def expanded(scalars: Mapping[str, float], parameters: Mapping[str, float]) -> dict[str, float]:
    """Parameters with those of all elements under the name of each; ValueError if a name is unknown."""
    by_star: dict[str, float] = {}
    for name, value in parameters.items():
        if is_shared(name):
            by_star |= dict.fromkeys(sharing(scalars, name), value)
    return by_star | {name: _known(scalars, name, value) for name, value in parameters.items() if not is_shared(name)}


def is_shared(name: str) -> bool:
    """Whether a name is that of all elements."""
    return name.startswith(f"{_ELEMENTS}.{_ALL}.")


def sharing(scalars: Mapping[str, float], name: str) -> list[str]:
    """Names of the elements' numbers that a name of all elements stands for; ValueError if there are none."""
    last = name.removeprefix(f"{_ELEMENTS}.{_ALL}.")
    names = [each for each in scalars if each.startswith(f"{_ELEMENTS}.") and each.split(".", 2)[2] == last]
    if not names:
        raise unknown(scalars, name)
    return names


def unknown(scalars: Mapping[str, float], name: str) -> ValueError:
    """The error for a name that no number has."""
    return ValueError(f"the structure has no parameter {name!r}; its parameters are {_listed(scalars)}")


def _listed(scalars: Iterable[str]) -> str:
    """The names in words, numbers of elements with the star where a law's name is that of several."""
    names: dict[str, None] = {}
    every = list(scalars)
    for name in every:
        parts = name.split(".", 2)
        last = parts[2] if parts[0] == _ELEMENTS else ""
        is_common = last and sum(each.split(".", 2)[2:] == [last] for each in every) > 1
        names[f"{_ELEMENTS}.k.{last}" if is_common else name] = None
    more = len(names) - _SHOWN
    shown = ", ".join(list(names)[:_SHOWN]) + (f" and {more} more" if more > 0 else "")
    return shown + (
        f" (k is the place of an element, or {_ALL} for all)" if any(".k." in each for each in names) else ""
    )


def _known(scalars: Mapping[str, float], name: str, value: float) -> float:
    if name not in scalars:
        raise unknown(scalars, name)
    return value


def _numbers(name: str, value: Any) -> dict[str, float]:
    """Numbers of the mass, the stiffness or the damping: itself or its factor, and those in it that have a name."""
    if isinstance(value, Rayleigh):
        return {name: 1.0, f"{name}.mass": value.mass, f"{name}.stiffness": value.stiffness}
    several = np.asarray(value.ratio if isinstance(value, ModalDamping) else value)
    if several.ndim == 0:
        return {name: float(several)}
    return {name: 1.0} | ({f"{name}[{k}]": float(each) for k, each in enumerate(several)} if several.ndim == 1 else {})


def _changed(name: str, value: Any, numbers: Mapping[str, float]) -> Any:
    """The mass, the stiffness or the damping with other numbers."""
    whole = numbers.get(name)
    if isinstance(value, Rayleigh):
        own = [numbers.get(f"{name}.{part}", vars(value)[part]) for part in ("mass", "stiffness")]
        factor = 1.0 if whole is None else whole
        return Rayleigh(mass=factor * own[0], stiffness=factor * own[1])
    make: Callable[[Any], Any] = (
        (lambda ratio: ModalDamping(ratio=ratio)) if isinstance(value, ModalDamping) else _as_is
    )
    several = np.array(value.ratio if isinstance(value, ModalDamping) else value)
    if several.ndim == 0:
        return make(whole)
    changed = _placed(name, several, numbers)
    return make(changed if whole is None else whole * changed)


def _as_is(value: Any) -> Any:
    return value


def _placed(name: str, values: FloatArray, numbers: Mapping[str, float]) -> FloatArray:
    """A vector with some numbers, ``name[k]``, exchanged."""
    changed = values.copy()
    for key, value in numbers.items():
        if key != name:
            changed[int(key[len(name) + 1 : -1])] = value
    return changed


def _below(numbers: Mapping[str, float], prefix: str) -> dict[str, float]:
    return {name[len(prefix) + 1 :]: value for name, value in numbers.items() if name.startswith(f"{prefix}.")}


def _with_law(element: Any, numbers: Mapping[str, float]) -> Any:
    return replace(element, law=element.law.with_scalars(numbers)) if numbers else element
