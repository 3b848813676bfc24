"""The user's consent to run code and to read files.

Without this consent, a model or a data set runs no code and reads no files outside its own folder.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from rover_pin.base.encode import shell_word
from rover_pin.base.errors import DataError
from rover_pin.base.files.paths import exists, is_folder


@dataclass(frozen=True)
class Trust:
    """The user's consent to run code from files and to read files outside a data set's folder.

    A file cannot give consent. In Python, consent is an argument; on the command line, it is given by `--effects FILE`
    or `--trust`.

    Parameters
    ----------
    effects : tuple of Path
        Files of Python code, or folders of such files, that may run.
    everything : bool
        Whether all code that a model names may run, and data may refer to files outside their folder.
    """

    effects: tuple[Path, ...] = ()
    everything: bool = False

    @classmethod
    def of(cls, effects: str | Path | Sequence[str | Path] | None = None, everything: bool = False) -> Self:
        """Return the consent to run the code in some files or folders, or to run all code and read all files.

        Raises DataError: a file or folder does not exist.
        """
        named = tuple(map(Path, [effects] if isinstance(effects, (str, Path)) else effects or []))
        for path in named:
            if not exists(path):
                raise DataError(f"{path}: there is no such file of Python code; give a .py file or a folder of them.")
        return cls(named, everything)

    def refuse_code(self, file: Path, where: str) -> None:
        """Check that the user has consented to run a file of code. `where` is the beginning of the error message.

        Raises DataError: `effects` names neither the file nor its folder, and `everything` is False. The message states
        how to allow the file.
        """
        real = _real(file, where)
        if self.everything or any(_covers(effect_path.resolve(), real) for effect_path in self.effects):
            return
        raise DataError(
            f"{where}: the file {file} is Python code, and it runs only with your consent: read the file, then give "
            f"--effects {shell_word(file)}, or --trust to allow all code that the model names (in Python "
            f"trust=Trust.of({str(file)!r}))."
        )

    def within(self, folder: Path, name: object, where: str) -> Path:
        """Return the path of the file that a description in `folder` calls `name`.

        `where` is the beginning of an error message.

        Raises DataError: `name` cannot be the name of a file, or the file is outside the folder, because the name
        contains '..', is an absolute path, or is a link.
        """
        if not isinstance(name, str) or not name or "\0" in name:
            raise DataError(f"{where}: {name!r} is not the name of a file; give the name of a file in {folder}.")
        path = folder / name
        if not self.everything and not _real(path, where).is_relative_to(folder.resolve()):
            raise DataError(
                f"{where}: the file {name!r} lies outside {folder}: move it into this folder, or give --trust to allow "
                "files elsewhere (in Python trust=Trust(everything=True))."
            )
        return path

    def refuse_elsewhere(self, table: object, file: Path) -> None:
        """Check that a table of a file refers to no file in another folder.

        `file` is the file that holds the table. Every text in the table and in its inner tables is checked, because any
        text can be a path. A path may lead into the folder of `file`, or into the working directory, because relative
        paths begin there.

        Raises DataError: a path leads to another folder, by '..', as an absolute path, or through a link.
        """
        # Tables and lists may be nested to any depth, so their entries wait in a list instead of a recursive call.
        pending = [] if self.everything else [("", table)]
        inside = (file.resolve().parent, Path.cwd())
        while pending:
            name, entry = pending.pop()
            if isinstance(entry, Mapping):
                pending += [(str(key), child) for key, child in entry.items()]
            elif isinstance(entry, list):
                pending += [(name, child) for child in entry]
            # Only a text that is the path of an existing file can lead outside; all other texts are harmless.
            elif isinstance(entry, str) and os.path.lexists(entry):
                real = _real(Path(entry), str(file))
                if not any(real.is_relative_to(root) for root in inside):
                    raise DataError(
                        f"{file}: {name} = {entry!r} lies outside the folder of {file.name}: move the file into this "
                        "folder, or give --trust to allow files elsewhere (in Python trust=Trust(everything=True))."
                    )


def code_files(path: Path) -> list[Path]:
    """Return the .py files that a user allows by naming a path: the file itself, or all files directly in a folder.

    Raises DataError: a file of the folder is a link to a file outside the folder. A user who has read the files of the
    folder before consenting may not have read the linked file.
    """
    if not is_folder(path):
        return [path]
    files = sorted(path.glob("*.py"))
    for file in files:
        if not _covers(path.resolve(), _real(file, str(path))):
            raise DataError(
                f"{file} is a link to {_real(file, str(path))}. You allowed the code in the folder {path} to run, but "
                "the linked file lies outside this folder: remove the link, or name the linked file with --effects."
            )
    return files


def _covers(allowed: Path, real: Path) -> bool:
    """Return whether the consent to the path `allowed` includes the file `real`.

    The consent includes a file if `allowed` is the file itself, or is the folder that directly contains the file.
    """
    return real == allowed or (allowed.is_dir() and real.parent == allowed)


def _real(path: Path, where: str) -> Path:
    """Return a path with all links followed.

    Raises DataError: no file can have this name, or links form a circle. `where` is the beginning of the message.
    """
    try:
        return path.resolve()
    except (OSError, RuntimeError, ValueError) as error:
        raise DataError(f"{where}: {str(path)!r} is not the path of a file; correct the name.") from error
