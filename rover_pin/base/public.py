"""The door of a public function or class: what is called otherwise than its signature says is refused in a sentence.

Annotations are the one place where that is said; `Annotated[Any, Kind(...)]` is for what Python has no class for.
"""

import functools
import inspect
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from html import escape
from numbers import Integral, Real
from os import PathLike
from pathlib import Path
from reprlib import Repr
from types import NoneType, UnionType
from typing import Annotated, Any, NamedTuple, TypeVar, Union, get_args, get_origin, get_type_hints

from rover_pin.base.errors import ParameterError, closest

Thing = TypeVar("Thing", bound=Callable[..., Any])
SHORT = Repr()
SHORT.maxother = SHORT.maxstring = 60


class Kind(NamedTuple):
    """A kind of value by what it is called and a test of it."""

    words: str
    holds: Callable[[Any], bool]


def public(thing: Thing) -> Thing:
    """Return a function, or a dataclass, that refuses arguments which do not fit its signature and annotations.

    Raises ParameterError: by the thing: an argument that is missing, unknown, too many, or of another kind than its
    annotation says.
    """
    if not isinstance(thing, type):
        return _guard_call(thing, thing)
    type.__setattr__(thing, "__init__", _guard_call(vars(thing)["__init__"], thing))
    return thing


def _guard_call(function: Any, hinted: Any) -> Any:
    signature, owner = inspect.signature(function), hinted.__qualname__
    names = [name for name in signature.parameters if name != "self"]
    several = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    single = [name for name in names if signature.parameters[name].kind not in several]

    @functools.cache
    def hints() -> dict[str, Any]:
        all_hints = get_type_hints(hinted, include_extras=True)
        return {name: all_hints[name] for name in single if name in all_hints}

    @functools.wraps(function)
    def wrapper(*args: Any, **kwargs: Any) -> Any:
        try:
            bound = signature.bind(*args, **kwargs).arguments
        except TypeError as error:
            refuse_unknown(f"{owner} {'has no field' if isinstance(hinted, type) else 'takes no'}", kwargs, names)
            raise ParameterError(f"{owner}: {error}; it takes {', '.join(names)}.") from None
        for name, hint in hints().items():
            if name in bound and not fits(bound[name], hint):
                raise ParameterError(f"{owner}: {name} = {SHORT.repr(bound[name])} is not allowed: give {words(hint)}.")
        return function(*args, **kwargs)

    return wrapper


def refuse_unknown(owner: str, keywords: Iterable[str], names: Collection[str]) -> None:
    """Refuse a name that is none of these, with the close ones; `owner` as in "Soil has no field"."""
    for name in keywords:
        if name not in names:
            raise ParameterError(f"{owner} '{name}': {closest(name, names)}")


def fits(value: Any, hint: Any) -> bool:
    """Return whether a value is of the kind that an annotation says; what cannot be checked is accepted."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return all(marker.holds(value) for marker in inner[1:] if isinstance(marker, Kind)) and fits(value, inner[0])
    if origin in (Union, UnionType):
        return any(fits(value, option) for option in inner)
    if hint in (float, int):
        return isinstance(value, Real if hint is float else Integral) and not isinstance(value, bool)
    if origin is tuple or origin is dict:
        parts = tuple(value.values()) if isinstance(value, dict) else value
        part = inner[-1] if origin is dict else inner[0] if inner[1:] == (...,) else Any
        return isinstance(value, origin) and all(fits(element, part) for element in parts)
    if getattr(origin, "__name__", "") == "Callable":
        return callable(value) and not isinstance(value, type) and _takes(value, inner[0])
    if getattr(hint, "_is_protocol", False):
        return all(hasattr(value, name) for name in vars(hint) if not name.startswith("_"))
    kind = PathLike if hint is Path else origin or hint
    if not isinstance(kind, type) or kind is Any:
        return True
    hints = get_type_hints(kind, include_extras=True) if issubclass(kind, tuple) and hasattr(kind, "_fields") else {}
    return isinstance(value, kind) and all(fits(getattr(value, name), field_hint) for name, field_hint in hints.items())


def _takes(function: Any, parameters: Any) -> bool:
    """Return whether a function can be called with as many arguments; of one that does not tell, it is believed."""
    try:
        signature = inspect.signature(function)
    except ValueError:
        return True
    try:
        signature.bind(*parameters)
    except TypeError:
        return False
    return True


NAMES = {float: "a number", int: "a whole number", str: "text", bool: "True or False", Path: "a path", NoneType: "None"}


def words(hint: Any) -> str:
    """Return what an annotation says, in words."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return next((marker.words for marker in inner[1:] if isinstance(marker, Kind)), words(inner[0]))
    if origin in (Union, UnionType):
        *most, last = dict.fromkeys(map(words, inner))
        return f"{', '.join(most)} or {last}" if most else last
    if origin is tuple:
        return f"a tuple, each {words(inner[0])}"
    if getattr(origin, "__name__", "") == "Callable":
        return f"a function that takes {', '.join(words(argument) for argument in inner[0]) or 'nothing'}"
    name = str(getattr(origin or hint, "__name__", hint))
    return NAMES.get(hint) or f"{'an' if name[0] in 'AEIO' else 'a'} {name}"


def brief(kind: type[Any]) -> Any:
    """Return a dataclass or NamedTuple whose repr is a line that one reads, whatever it holds; a notebook's a table.

    Long parts go by their kind and number. It is for people: no digest may be made of it.
    """
    type.__setattr__(kind, "__repr__", _brief)
    if not hasattr(kind, "_repr_html_"):
        type.__setattr__(kind, "_repr_html_", _brief_html)
    return kind


def html_table(caption: str, rows: Mapping[str, str]) -> str:
    """Return names and what belongs to them as a table of a notebook; whatever they hold is shown as text."""
    cells = (f"<tr><th scope='row'>{escape(name)}</th><td>{escape(text)}</td></tr>" for name, text in rows.items())
    return f"<table><caption>{escape(caption)}</caption>{''.join(cells)}</table>"


LONGEST, PART = 240, 48
"""Letters of a brief repr, and of each part in it."""


def _shown_names(thing: Any) -> Sequence[str]:
    return [field.name for field in fields(thing) if field.repr] if is_dataclass(thing) else thing._fields


def _brief_html(self: Any) -> str:
    return html_table(type(self).__name__, {name: _part(getattr(self, name)) for name in _shown_names(self)})


def _brief(self: Any) -> str:
    text = ""
    for name in _shown_names(self):
        more = f"{', ' if text else ''}{name}={_part(getattr(self, name))}"
        if len(text) + len(more) > LONGEST:
            text += ", ..."
            break
        text += more
    return f"{type(self).__name__}({text})"


def _part(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, (str, PathLike)):
        return SHORT.repr(str(value))
    if hasattr(value, "shape"):
        return f"array{value.shape}"
    if isinstance(value, Collection) and value:
        listing = f"({', '.join(map(_part, value))})" if len(value) < 4 and not isinstance(value, Mapping) else ""
        return listing if 0 < len(listing) <= PART else f"<{len(value)} in a {type(value).__name__}>"
    if value is None or isinstance(value, (bool, int, Collection)):
        return SHORT.repr(value)
    if is_dataclass(value) and len(fields(value)) < 3:
        return SHORT.repr(value)
    name = getattr(value, "name", "") or getattr(value, "__name__", "")
    return f"<{type(value).__name__}{f' {name}' if isinstance(name, str) and name else ''}>"
