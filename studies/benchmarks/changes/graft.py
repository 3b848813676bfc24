"""Puts a changed text into modules that are loaded: its functions' code, its defaults and its plain constants."""

from __future__ import annotations

import functools
import inspect
import sys
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

PLAIN = (bool, int, float, str, tuple, list, dict, frozenset, np.ndarray, type(None))
GENERATED = {"__dict__", "__weakref__", "__module__", "__doc__", "__annotations__", "__dataclass_fields__"}


class UngraftableError(Exception):
    """The change is none of code, defaults or constants that can be set in place: the module must be imported anew."""


def grafted(path: Path, text: str) -> None:
    """Let the loaded module of `path` do what `text` says.

    Whoever holds one of its functions or classes holds the same object as before, with other code. What was worked out
    from it while modules were imported stays as it is.

    Raises
    ------
    UngraftableError
        Nothing that can be set in place differs, or the module is not loaded.
    """
    module = next((each for each in list(sys.modules.values()) if getattr(each, "__file__", None) == str(path)), None)
    if module is None:
        raise UngraftableError(f"{path} is not loaded")
    made = types.ModuleType(module.__name__)
    made.__file__, made.__package__ = str(path), module.__package__
    exec(compile(text.encode("latin-1"), str(path), "exec"), made.__dict__)
    if not _into(module, vars(module), vars(made), module.__name__):
        raise UngraftableError("nothing differs that can be set in place")


def _into(owner: Any, old: Any, new: dict[str, Any], module: str) -> int:
    """Set what differs in one namespace; return how much did."""
    count = 0
    for name, made in list(new.items()):
        found = old.get(name)
        if name in GENERATED or made is found:
            continue
        if inspect.isclass(made) and made.__module__ == module and inspect.isclass(found):
            count += _into(found, vars(found), dict(vars(made)), module)
        elif type(made) is type(found) and isinstance(made, PLAIN):
            count += _constant(owner, name, found, made)
        else:
            pairs = zip(_functions(found), _functions(made), strict=False)
            count += sum(_function(mine, theirs) for mine, theirs in pairs)
    return count


def _functions(value: Any) -> Iterator[types.FunctionType]:
    """Return the plain functions behind a function, method, property or cache."""
    if isinstance(value, property):
        inner = [value.fget, value.fset]
    elif isinstance(value, functools.cached_property):
        inner = [value.func]
    elif isinstance(value, (staticmethod, classmethod)):
        inner = [value.__func__]
    else:
        inner = [value]
    for each in inner:
        plain = inspect.unwrap(each) if callable(each) else None
        if isinstance(plain, types.FunctionType):
            yield plain


def _function(old: types.FunctionType, new: types.FunctionType) -> int:
    count = int(old.__code__ != new.__code__)
    for name in ("__defaults__", "__kwdefaults__"):
        if repr(getattr(old, name)) != repr(getattr(new, name)):
            setattr(old, name, getattr(new, name))
            count += 1
    try:
        old.__code__ = new.__code__
    except ValueError as error:  # it closes over other variables
        raise UngraftableError(str(error)) from error
    return count


def _constant(owner: Any, name: str, old: Any, new: Any) -> int:
    """Set a constant wherever it is known by this name."""
    if repr(old) == repr(new):
        return 0
    holders: list[Any] = [each for each in list(sys.modules.values()) if vars(each).get(name) is old]
    for holder in (owner, *holders):
        setattr(holder, name, new)
    return 1
