"""The border between this program and the code of a user's file: an error there is reported by file and line."""

import functools
import inspect
import traceback
import typing
from types import FunctionType, ModuleType
from typing import Any

from rover_pin.base.errors import DataError, RoverPinError
from rover_pin.base.jobs.workers import Terminated
from rover_pin.base.public import fits, words


def mistake(error: BaseException, file: str, otherwise: int = 0) -> DataError:
    """Return the error that tells of an exception by the last line of a user's file that it passed."""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    if isinstance(error, SyntaxError) and error.filename == file:
        lines, error = [error.lineno], SyntaxError(error.msg)
    line = lines[-1] if lines else otherwise
    place = f"{file}, line {line}" if line else file
    reason = f": {error}".rstrip(": .") if str(error) else ""
    return DataError(f"{place}: the code there ends with {type(error).__name__}{reason}; mend it.")


def is_stop(error: BaseException) -> bool:
    """Return whether an exception is none of the code's own: a sentence of this program, Ctrl-C or SIGTERM."""
    return isinstance(error, (RoverPinError, KeyboardInterrupt, Terminated))


def guard(module: ModuleType) -> None:
    """Let every method of a module's classes raise one sentence, and return what its base class says, or be refused."""
    for _, kind in inspect.getmembers(module, inspect.isclass):
        if kind.__module__ == module.__name__:
            _refuse_other_types(kind, str(module.__file__))
            for name, member in list(vars(kind).items()):
                guarded = _guard_member(kind, name, member, str(module.__file__))
                if guarded is not member:
                    setattr(kind, name, guarded)


def _refuse_other_types(kind: type, file: str) -> None:
    """Refuse what a class says of all its objects, as `states` and `neutral`, where its base asks for another type."""
    for name, value in vars(kind).items():
        base = next((ancestor for ancestor in kind.__mro__[1:] if name in inspect.get_annotations(ancestor)), None)
        hint = typing.get_type_hints(base, include_extras=True)[name] if base is not None else Any
        if typing.get_origin(hint) is typing.ClassVar and not fits(value, typing.get_args(hint)[0]):
            raise DataError(
                f"{file}, line {inspect.getsourcelines(kind)[1]}: {kind.__name__}.{name} is {_short(value)}, "
                f"{_demand(typing.get_args(hint)[0])}."
            )


def _guard_member(kind: type, name: str, member: Any, file: str) -> Any:
    """Return a method, property or class method that is watched; anything else as it is."""
    if isinstance(member, property) and member.fget is not None:
        return property(_watch_method(kind, name, member.fget, file))
    if isinstance(member, (classmethod, staticmethod)):
        return type(member)(_watch_method(kind, name, member.__func__, file))
    return _watch_method(kind, name, member, file)


def _watch_method(kind: type, name: str, method: Any, file: str) -> Any:
    if not isinstance(method, FunctionType) or method.__code__.co_filename != file:
        return method
    line, hint = method.__code__.co_firstlineno, _return_hint(kind, name)

    @functools.wraps(method)
    def call(*args: Any, **named: Any) -> Any:
        try:
            result = method(*args, **named)
        except BaseException as error:
            if is_stop(error):
                raise
            raise mistake(error, file, line) from error
        if not fits(result, hint):
            raise DataError(f"{file}, line {line}: {kind.__name__}.{name} returns {_short(result)}, {_demand(hint)}.")
        return result

    return call


def _return_hint(kind: type, name: str) -> Any:
    """Return what the method of this name returns in the nearest base class that is not the user's; Any without one."""
    for base in kind.__mro__[1:]:
        if base.__module__ != kind.__module__ and name in vars(base):
            member = vars(base)[name]
            method = member.fget if isinstance(member, property) else getattr(member, "__func__", member)
            hints = typing.get_type_hints(method, include_extras=True) if isinstance(method, FunctionType) else {}
            hint = hints.get("return", Any)
            return kind if hint is typing.Self else hint
    return Any


def _demand(hint: Any) -> str:
    parts = ", each field as it is declared" if isinstance(hint, type) and hasattr(hint, "_fields") else ""
    return f"where {words(hint)}{parts} belongs"


def _short(thing: Any) -> str:
    text = " ".join(str(thing).split())
    return text if len(text) < 80 else f"{text[:80]} ..."
