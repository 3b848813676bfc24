"""What a model or a data set of someone else may do: by itself neither run code nor name files outside its folder."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from rover_pin.base.errors import DataError
from rover_pin.base.files.paths import exists


@dataclass(frozen=True)
class Trust:
    """What the user allows: in Python by an argument, in a command by `--effects FILE` or `--trust`, never in a file.

    Parameters
    ----------
    effects : tuple of Path
        Files of effects, or folders of them, whose code may run.
    everything : bool
        The code of every effect that a model names may run, and files may lie outside the folder that names them.
    """

    effects: tuple[Path, ...] = ()
    everything: bool = False

    @classmethod
    def of(cls, effects: str | Path | Sequence[str | Path] | None = None, everything: bool = False) -> Self:
        """Return the trust in a file of effects, which must be there, or several, or in everything."""
        named = tuple(map(Path, [effects] if isinstance(effects, (str, Path)) else effects or []))
        for path in named:
            if not exists(path):
                raise DataError(f"{path}: there is no such effect file; give a .py file or a folder of them.")
        return cls(named, everything)

    def refuse_code(self, file: Path, where: str) -> None:
        """Refuse to run a file, or the files of a folder, that the user has not named.

        Raises DataError: it is not among `effects`; the sentence says how to allow it.
        """
        real = _real(file, where)
        if self.everything or any(_covers(effect_path.resolve(), real) for effect_path in self.effects):
            return
        raise DataError(
            f"{where}: this code lies in {file}, and it runs only if you say so: read it, then give "
            f"--effects {file}, or --trust for all that the model names (in Python trust=Trust.of('{file}'))."
        )

    def within(self, folder: Path, name: object, where: str) -> Path:
        """Return the path of a file that something in `folder` names.

        Raises DataError: it is no file's name, or lies outside the folder, by '..', as an absolute path or through a
        link.
        """
        if not isinstance(name, str) or not name or "\0" in name:
            raise DataError(f"{where}: {name!r} is not the name of a file; give one in {folder}.")
        path = folder / name
        if not self.everything and not _real(path, where).is_relative_to(folder.resolve()):
            raise DataError(
                f"{where}: the file {name!r} lies outside {folder}: put it there, or say --trust (in Python "
                "trust=Trust(everything=True))."
            )
        return path

    def refuse_elsewhere(self, table: object, file: Path) -> None:
        """Refuse a table in `file` where a text in it, at any depth, is the path of something outside.

        Inside are the folder of that file and the working directory, from which such paths are seen.

        Raises DataError: one names a file or folder elsewhere, by '..', as an absolute path or through a link.
        """
        pending = [] if self.everything else [("", table)]
        inside = (file.resolve().parent, Path.cwd())
        while pending:
            name, entry = pending.pop()
            if isinstance(entry, Mapping):
                pending += [(str(key), child) for key, child in entry.items()]
            elif isinstance(entry, list):
                pending += [(name, child) for child in entry]
            elif isinstance(entry, str) and os.path.lexists(entry):
                real = _real(Path(entry), str(file))
                if not any(real.is_relative_to(root) for root in inside):
                    raise DataError(
                        f"{file}: {name} = {entry!r} lies outside its folder: put the file there, or say --trust (in "
                        "Python trust=Trust(everything=True))."
                    )


def _covers(allowed: Path, real: Path) -> bool:
    return real == allowed or (allowed.is_dir() and real.parent == allowed)


def _real(path: Path, where: str) -> Path:
    """Return the path without links; one that leads nowhere by itself is an error."""
    try:
        return path.resolve()
    except (OSError, RuntimeError, ValueError) as error:
        raise DataError(f"{where}: {str(path)!r} is no path of a file; mend its name.") from error
