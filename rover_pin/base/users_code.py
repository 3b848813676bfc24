"""Wrappers that report failures of the code in a user's file, such as an effect or a controller.

An exception in the user's code becomes a one-line error with the file and the line. A return value of a wrong type also
becomes such an error; the base class of the effect or controller declares the right type.
"""

import functools
import inspect
import traceback
import typing
from types import FunctionType, ModuleType
from typing import Any

from rover_pin.base.errors import DataError, RoverPinError, UnknownAttributeError
from rover_pin.base.jobs.workers import Terminated
from rover_pin.base.public import fits, words

MAX_QUOTED = 80
"""Maximum number of letters of a value that an error quotes, which is one line of a terminal. A longer value is cut at
this length."""


def mistake(error: BaseException, file: str, otherwise: int = 0) -> DataError:
    """Return an error that reports an exception with the line of the user's file that raised it.

    If the exception passed through several lines of the file, the last line is named. If it passed through no line of
    the file, the line `otherwise` is named, or no line if `otherwise` is 0.
    """
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    # A syntax error arises before any line of the file runs, so Python states its line in the error itself.
    if isinstance(error, SyntaxError) and error.filename == file:
        lines, error = [error.lineno], SyntaxError(error.msg)
    line = lines[-1] if lines else otherwise
    place = f"{file}, line {line}" if line else file
    reason = f": {error}".rstrip(": .") if str(error) else ""
    # Python programmers know this mistake as AttributeError, so this name is printed also for UnknownAttributeError.
    kind = AttributeError if isinstance(error, AttributeError) else type(error)
    return DataError(f"{place}: the code there ends with {kind.__name__}{reason}; correct it.")


def is_stop(error: BaseException) -> bool:
    """Return whether an exception must be passed on unchanged, because it is no mistake in the user's code.

    The result is True for an error of this package, Ctrl-C and SIGTERM. It is False for an UnknownAttributeError,
    because an unknown attribute is a mistake in the user's code, although this package raises the error.
    """
    if isinstance(error, UnknownAttributeError):
        return False
    return isinstance(error, (RoverPinError, KeyboardInterrupt, Terminated))


def guard(module: ModuleType) -> None:
    """Wrap every method of the classes in a user's module, so that exceptions and wrong return types become a
    `DataError`.

    Raises DataError: a class variable of such a class, such as `states` or `neutral`, is of another type than its base
    class declares.
    """
    file = str(module.__file__)
    for _, kind in inspect.getmembers(module, inspect.isclass):
        # Classes that the user's file only imports are not the user's code.
        if kind.__module__ != module.__name__:
            continue
        # The class variables must fit the `ClassVar` annotations of the package's base class.
        for name, value in vars(kind).items():
            # The nearest base class that annotates the variable decides about its type.
            base = next((ancestor for ancestor in kind.__mro__[1:] if name in inspect.get_annotations(ancestor)), None)
            hint = typing.get_type_hints(base, include_extras=True)[name] if base is not None else Any
            if typing.get_origin(hint) is typing.ClassVar and not fits(value, typing.get_args(hint)[0]):
                raise DataError(
                    f"{file}, line {inspect.getsourcelines(kind)[1]}: {kind.__name__}.{name} is {_quoted(value)}, "
                    f"{_demand(typing.get_args(hint)[0])}."
                )
        # Properties, class methods and static methods hold their function inside, so that the function is wrapped and
        # then packed again. A member without a function of the user stays as it is.
        for name, member in list(vars(kind).items()):
            if isinstance(member, property) and member.fget is not None:
                guarded: Any = property(_guard_method(kind, name, member.fget, file))
            elif isinstance(member, (classmethod, staticmethod)):
                guarded = type(member)(_guard_method(kind, name, member.__func__, file))
            else:
                guarded = _guard_method(kind, name, member, file)
            if guarded is not member:
                setattr(kind, name, guarded)


def _guard_method(kind: type, name: str, method: Any, file: str) -> Any:
    """Return a method that reports its exceptions by file and line, and that checks the type of its return value."""
    # A method from another file, such as a method that `dataclass` generates, is not the user's code.
    if not isinstance(method, FunctionType) or method.__code__.co_filename != file:
        return method
    line = method.__code__.co_firstlineno
    # The return value must fit the annotation of the nearest base class that declares the method outside the user's
    # module, because the user's own annotation may be missing or wrong. Without such a base class, any value fits.
    hint: Any = Any
    for base in kind.__mro__[1:]:
        if base.__module__ != kind.__module__ and name in vars(base):
            member = vars(base)[name]
            declared = member.fget if isinstance(member, property) else getattr(member, "__func__", member)
            hints = typing.get_type_hints(declared, include_extras=True) if isinstance(declared, FunctionType) else {}
            hint = hints.get("return", Any)
            hint = kind if hint is typing.Self else hint
            break

    @functools.wraps(method)
    def call(*args: Any, **named: Any) -> Any:
        try:
            result = method(*args, **named)
        except BaseException as error:
            if is_stop(error):
                raise
            raise mistake(error, file, line) from error
        if not fits(result, hint):
            raise DataError(f"{file}, line {line}: {kind.__name__}.{name} returns {_quoted(result)}, {_demand(hint)}.")
        return result

    return call


def _demand(hint: Any) -> str:
    """Return the last part of an error message, which states the needed type, such as "but a number is needed"."""
    fields = ", each field of its declared type" if isinstance(hint, type) and hasattr(hint, "_fields") else ""
    return f"but {words(hint)}{fields} is needed"


def _quoted(value: Any) -> str:
    """Return a value as text on one line, cut after MAX_QUOTED letters."""
    text = " ".join(str(value).split())
    return text if len(text) < MAX_QUOTED else f"{text[:MAX_QUOTED]} ..."
