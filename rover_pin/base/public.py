"""Checks of the arguments of public functions and classes. A wrong argument raises an error of one sentence.

The annotations in the signature state the allowed values. If Python has no class for a kind of value, the annotation is
`Annotated[Any, Kind(...)]`.
"""

import functools
import inspect
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import fields, is_dataclass
from numbers import Integral, Real
from os import PathLike
from pathlib import Path
from reprlib import Repr
from types import NoneType, UnionType
from typing import Annotated, Any, NamedTuple, TypeVar, Union, get_args, get_origin, get_type_hints

from rover_pin.base.encode import html_text
from rover_pin.base.errors import ParameterError, closest

Thing = TypeVar("Thing", bound=Callable[..., Any])
SHORT = Repr()
"""Maker of short texts of values for error messages. A text of more than 60 characters loses its middle part, so that
the message stays readable."""
SHORT.maxother = SHORT.maxstring = 60


class Kind(NamedTuple):
    """A kind of value that has no class of its own in Python.

    `words` names the kind in errors, and `holds` is a function that returns whether a value is of this kind.
    """

    words: str
    holds: Callable[[Any], bool]


def public(thing: Thing) -> Thing:
    """Decorate a function or a dataclass so that each call checks its arguments against the signature and the
    annotations.

    Raises ParameterError: when the decorated function is called without a required argument, with an unknown argument,
    or with a value that does not fit the annotation.
    """
    if not isinstance(thing, type):
        return _guard_call(thing, thing)
    type.__setattr__(thing, "__init__", _guard_call(vars(thing)["__init__"], thing))
    return thing


def _guard_call(function: Any, hinted: Any) -> Any:
    """Return a function that checks its arguments against the annotations of `hinted` and then calls `function`.

    For a function, `hinted` is the function. For a dataclass, `function` is its __init__ and `hinted` is the class.
    """
    signature, owner = inspect.signature(function), hinted.__qualname__
    # Arguments such as *args and **kwargs hold several values, so they are not compared with a single annotation.
    names = [name for name in signature.parameters if name != "self"]
    several = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    single = [name for name in names if signature.parameters[name].kind not in several]

    # The annotations are resolved at the first call, because they may name classes that are defined later.
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
    """Check that all keywords of a call are among the known names.

    `owner` is the beginning of the error message, such as "Soil has no field".

    Raises ParameterError: a keyword is unknown; the message lists similar names.
    """
    for name in keywords:
        if name not in names:
            raise ParameterError(f"{owner} '{name}': {closest(name, names)}")


def fits(value: Any, hint: Any) -> bool:
    """Return whether a value fits a type annotation. If the annotation cannot be checked, the result is True."""
    origin, inner = get_origin(hint), get_args(hint)
    # The `Kind` in an annotation and the annotated type must both fit.
    if origin is Annotated:
        return all(marker.holds(value) for marker in inner[1:] if isinstance(marker, Kind)) and fits(value, inner[0])
    if origin in (Union, UnionType):
        return any(fits(value, option) for option in inner)
    # A whole number is a valid float, but True and False are numbers only by Python's inheritance.
    if hint in (float, int):
        return isinstance(value, Real if hint is float else Integral) and not isinstance(value, bool)
    # All elements of a tuple, or all values of a dict, must fit; only tuples of one repeated type are checked.
    if origin is tuple or origin is dict:
        parts = tuple(value.values()) if isinstance(value, dict) else value
        part = inner[-1] if origin is dict else inner[0] if inner[1:] == (...,) else Any
        return isinstance(value, origin) and all(fits(element, part) for element in parts)
    if getattr(origin, "__name__", "") == "Callable":
        if not callable(value) or isinstance(value, type):
            return False
        # The function must accept the positional arguments of the annotation. Some functions of C code have no known
        # signature, and are accepted.
        try:
            signature = inspect.signature(value)
        except ValueError:
            return True
        try:
            signature.bind(*inner[0])
        except TypeError:
            return False
        return True
    # A protocol has no class to test, so the value must have each of its public members.
    if getattr(hint, "_is_protocol", False):
        return all(hasattr(value, name) for name in vars(hint) if not name.startswith("_"))
    kind = PathLike if hint is Path else origin or hint
    if not isinstance(kind, type) or kind is Any:
        return True
    # The fields of a NamedTuple are checked too, because NamedTuple itself does not check them.
    hints = get_type_hints(kind, include_extras=True) if issubclass(kind, tuple) and hasattr(kind, "_fields") else {}
    return isinstance(value, kind) and all(fits(getattr(value, name), field_hint) for name, field_hint in hints.items())


NAMES = {float: "a number", int: "a whole number", str: "text", bool: "True or False", Path: "a path", NoneType: "None"}
"""Type in an annotation -> the words for it in an error message."""


def words(hint: Any) -> str:
    """Return a type annotation in words for an error message, such as "a number or None"."""
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
    """Give a dataclass or NamedTuple a short repr for people and an HTML table for notebooks, and return the class.

    A long field is shown by its type and its number of elements. Do not use such a repr to distinguish objects, because
    different objects may have equal reprs.
    """

    def short_repr(self: Any) -> str:
        text = ""
        for name, part in _field_texts(self).items():
            more = f"{', ' if text else ''}{name}={part}"
            if len(text) + len(more) > MAX_REPR:
                text += ", ..."
                break
            text += more
        return f"{type(self).__name__}({text})"

    def table(self: Any) -> str:
        return html_table(type(self).__name__, _field_texts(self))

    type.__setattr__(kind, "__repr__", short_repr)
    # A class with a table of its own keeps it.
    if not hasattr(kind, "_repr_html_"):
        type.__setattr__(kind, "_repr_html_", table)
    return kind


def html_table(caption: str, rows: Mapping[str, str]) -> str:
    """Return an HTML table for a notebook. `rows` maps the name in the first column to the text in the second
    column.
    """
    cells = (
        f"<tr><th scope='row'>{html_text(name)}</th><td>{html_text(text)}</td></tr>" for name, text in rows.items()
    )
    return f"<table><caption>{html_text(caption)}</caption>{''.join(cells)}</table>"


MAX_REPR, MAX_PART = 240, 48
"""Maximum number of letters of a short repr (MAX_REPR), and of a field whose elements are listed (MAX_PART). A longer
repr ends with "...", and a longer field is shown by its type and its number of elements. A repr of 240 letters fills
about three lines of a terminal, with about five fields of 48 letters."""


def _field_texts(thing: Any) -> dict[str, str]:
    """Return field name -> short text of the value, for the fields of a dataclass or NamedTuple that its repr shows."""
    names = [field.name for field in fields(thing) if field.repr] if is_dataclass(thing) else thing._fields
    return {name: _part(getattr(thing, name)) for name in names}


def _part(value: Any) -> str:
    """Return the value of a field as short text for a repr: a number, a short list, or the type and the size of the
    value.
    """
    # Numbers and texts are shown in full, up to a maximum length.
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, (str, PathLike)):
        return SHORT.repr(str(value))
    # Arrays are shown by their shape, because their elements would fill the line.
    if hasattr(value, "shape"):
        return f"array{value.shape}"
    if isinstance(value, Collection) and value:
        listing = f"({', '.join(map(_part, value))})" if len(value) < 4 and not isinstance(value, Mapping) else ""
        return listing if 0 < len(listing) <= MAX_PART else f"<{len(value)} in a {type(value).__name__}>"
    if value is None or isinstance(value, (bool, int, Collection)):
        return SHORT.repr(value)
    if is_dataclass(value) and len(fields(value)) < 3:
        return SHORT.repr(value)
    name = getattr(value, "name", "") or getattr(value, "__name__", "")
    return f"<{type(value).__name__}{f' {name}' if isinstance(name, str) and name else ''}>"
