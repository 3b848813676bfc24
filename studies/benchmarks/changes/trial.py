"""Tries changes in one pytest session that has collected a room's tests: each in a fork, on the tests it touches."""

from __future__ import annotations

import functools
import json
import math
import os
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from changes import switch
from changes.covered import covered
from changes.first import First
from changes.fork import forked, silence
from changes.graft import UngraftableError, grafted
from changes.kept import Kept, digest, test_digest
from changes.known import Known, Tried
from changes.python import Mutant, lines_of
from changes.recompile import recompiled
from changes.warm import lines_of_warming, warm

PATIENCE, LEAST = 10.0, 2.0
"""A test may take so many times what it takes on the code as it is, and so much more [s of CPU]."""
QUICK = 0.3
"""Tests of so little CPU [s] are asked of a change outside of functions though they run no line of its file."""
BEGUN = 0.02
"""What a test takes besides its own time [s of CPU]."""
REHEARSED = 60.0
"""How long the tests of the compiled step are rehearsed [s of CPU]."""
LONGEST = 1800.0
"""Time [s] after which a change counts as one that hangs, whatever it waits for."""
UNGRAFTED = 98
"""Exit code of a fork that could not put a change into loaded modules."""


class Trial:
    """A pytest plugin that runs, in place of the tests, each change on the tests that run its lines.

    A change is first put into the loaded modules. Where it is not within a function, what was worked out while they
    were imported may differ: if its tests pass, they run once more on modules imported anew, together with all that
    run anything of its file, before it counts as one that no test notices.

    `limits` are the CPU time [s] of the longest test that is asked, and when to begin no further change.
    """

    def __init__(self, tree: Path, changes: Sequence[tuple[Path, Mutant]], kept: Kept, limits: tuple[float, float]):
        self.tree, self.changes, self.kept = tree, changes, kept
        self.sources = {str(path.relative_to(tree)): digest(path) for path, _ in changes}
        self.longest, self.end, self.warm = *limits, False
        self.numbers = dict[tuple[str, Mutant], int]()
        self.failed, self.tried, self.broken = False, list[Tried](), list[str]()
        self.kills: Counter[tuple[Path, str]] = Counter()
        self.blind: Counter[tuple[Path, str]] = Counter()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note that a test failed."""
        self.failed |= report.failed

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Say what is known of the changes, then learn what each test runs and try the others."""
        self.items = {item.nodeid: item for item in session.items}
        self.all_tests = digest(*sorted({item.path for item in session.items}))
        self.all_tests += "" if self.longest == math.inf else f" to {self.longest:g} s"
        new = []
        for path, mutant in self.changes:
            killer = self._remembered(self._key(path, mutant))
            if killer is None:
                new.append((path, mutant))
            else:
                self._note(path, mutant, killer)
        if not new or time.monotonic() > self.end:
            return True
        self.known = {name: Known(*self._learnt(item)) for name, item in self.items.items()}
        self.broken = [name for name, known in self.known.items() if known.taken < 0.0]
        for each in sorted(new, key=lambda each: not self._builds(*each)):
            self._try(*each)
        return True

    @functools.cached_property
    def _built(self) -> dict[str, list[int]]:
        code, said = forked(lambda tell: tell(json.dumps(lines_of_warming(self.tree))), LONGEST)
        return dict(json.loads(said)) if code == 0 else {}

    def _builds(self, path: Path, mutant: Mutant) -> bool:
        """Return whether a change lies in what builds the models that are kept: then none may be there before."""
        lines = lines_of(path.read_text(encoding="latin-1"), mutant) if path.suffix == ".py" else None
        return lines is not None and not lines.isdisjoint(self._built.get(str(path.relative_to(self.tree)), ()))

    def _warm(self, rehearse: bool) -> None:
        """Build what every fork would build; where the compiled step is changed, which builds nothing, by its tests."""
        if rehearse:
            self.numbers = switch.built(self.changes)
        warm()
        self.warm = True
        first = time.process_time()
        for name, known in sorted(self.known.items(), key=lambda one: one[1].taken) if rehearse else ():
            begun = time.process_time()
            if begun - first > REHEARSED:
                break
            if switch.builds(self.items[name].path) or not 0.0 <= known.taken <= self.longest:
                continue
            if any(each in known.lines for each in STEP):
                self._run([self.items[name]])
                taken, self.failed = -1.0 if self.failed else time.process_time() - begun, False
                self.known[name] = known._replace(taken=taken)
        signal.setitimer(signal.ITIMER_PROF, 0.0)

    def _learnt(self, item: pytest.Item) -> list[Any]:
        """Return CPU time and lines of a test; a time below 0 where it fails on the code as it is."""
        key = f"{item.nodeid} {_digest(item)}"
        taken, lines, seen = self.kept.get(key) or (-1.0, {}, {})
        given_up = lines is None and self.longest < taken
        if not given_up and (
            taken < 0.0 or lines is None or any(self.sources.get(file, was) != was for file, was in seen.items())
        ):
            code, said = forked(lambda tell: tell(json.dumps(self._covered(item))), LONGEST)
            taken, lines = json.loads(said) if code == 0 and said else [-1.0, {}]
            if code == -signal.SIGPROF:
                taken, lines = self._patience, None
            self.kept.put(key, [taken, lines, {file: digest(self.tree / file) for file in lines or ()}])
        return [taken, lines or {}]

    @property
    def _patience(self) -> float:
        """How long a test is watched while its lines are learnt [s of CPU], which makes it slower."""
        return 1.0 + 2.5 * self.longest

    def _covered(self, item: pytest.Item) -> list[Any]:
        signal.setitimer(signal.ITIMER_PROF, min(self._patience, LONGEST))
        failed, taken, lines = covered(self.tree, lambda: self._run([item]))
        return [-1.0 if failed else taken, lines]

    def _run(self, items: Sequence[pytest.Item]) -> str:
        """Run tests until one fails; return its name."""
        for item, after in zip(items, [*items[1:], None], strict=True):
            known = getattr(self, "known", {}).get(item.nodeid)
            if known is not None:
                signal.setitimer(signal.ITIMER_PROF, LEAST + PATIENCE * known.taken)
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=after)
            if self.failed:
                return item.nodeid
        return ""

    def _try(self, path: Path, mutant: Mutant) -> None:
        if time.monotonic() > self.end:
            return
        if not (self.warm or self._builds(path, mutant)):
            with silence():
                self._warm(path.suffix != ".py")
        killer = self._killer(path, mutant)
        test = self.items.get(killer.partition(" ")[0])
        self.kept.put(self._key(path, mutant), [killer, _digest(test) if test else self.all_tests])
        self._note(path, mutant, killer)

    def _key(self, path: Path, mutant: Mutant) -> str:
        return f"{path.relative_to(self.tree)} {mutant.start} {mutant.end} {mutant.new} {digest(path)}"

    def _note(self, path: Path, mutant: Mutant, killer: str) -> None:
        self.kills[_one(path), killer] += 1
        self.tried.append(Tried(path, mutant, killer))
        if not killer:
            print(f"{path.relative_to(self.tree)}:{mutant.line}: {mutant.said}", file=sys.__stdout__, flush=True)

    def _remembered(self, key: str) -> str | None:
        """Return what is known of a change with the tests as they are."""
        found = self.kept.get(key)
        if found is None:
            return None
        killer, tests = found
        if killer and "::" not in killer:
            return str(killer)  # it hangs or does not compile: no test's words say so
        test = self.items.get(killer.partition(" ")[0])
        return killer if tests == (_digest(test) if test else self.all_tests) else None

    def _killer(self, path: Path, mutant: Mutant) -> str:
        """Return the test that notices a change, or nothing."""
        changed = mutant.of(path.read_text(encoding="latin-1"))
        near, far = self._telling(path, mutant)
        killer = self._asked(path, mutant, changed, (near, far))
        asked = [item.nodeid for item in [*near, *far]]
        before = asked[: asked.index(killer)] if killer in asked else asked
        self.blind.update((_one(path), name) for name in before)
        return killer

    def _asked(self, path: Path, mutant: Mutant, changed: str, tests: tuple[list[pytest.Item], ...]) -> str:
        near, far = tests
        within = path.suffix == ".py" and lines_of(path.read_text(encoding="latin-1"), mutant) is not None
        if within and not near:
            return ""
        if path.suffix == ".py" and near:
            code, killer = forked(lambda tell: self._grafted(path, changed, near, tell), LONGEST)
            if code not in (0, UNGRAFTED):
                return killer or "hangs"
            if code == 0 and within:
                return ""  # a function's code is the same, however it came there
        number = self.numbers.get((path.name, mutant))
        if number:
            code, killer = forked(lambda tell: self._chosen(number, [*near, *far], tell), LONGEST)
            if code:
                return killer or "hangs"
            near, far = [], [item for item in (*near, *far) if switch.builds(item.path)]
        told = path.read_bytes()
        path.write_text(changed, encoding="latin-1")
        work = self._anew if path.suffix == ".py" else self._recompiled
        try:
            code, killer = forked(lambda tell: work([*near, *far], tell), LONGEST)
        finally:
            path.write_bytes(told)
        return "" if code == 0 else killer or "hangs"

    def _grafted(self, path: Path, changed: str, items: list[pytest.Item], tell: Callable[[str], None]) -> None:
        try:
            grafted(path, changed)
        except UngraftableError:
            os._exit(UNGRAFTED)
        except Exception:
            tell(f"{items[0].nodeid} (it cannot be imported)")
            os._exit(1)
        self._tell(self._run(items), tell)

    def _chosen(self, number: int, items: list[pytest.Item], tell: Callable[[str], None]) -> None:
        switch.CHOSEN.value = number
        self._tell(self._run([item for item in items if not switch.builds(item.path)]), tell)

    def _recompiled(self, items: list[pytest.Item], tell: Callable[[str], None]) -> None:
        if not recompiled():
            tell("the compiler")
            os._exit(1)
        self._tell(self._run(items), tell)

    def _anew(self, items: list[pytest.Item], tell: Callable[[str], None]) -> None:
        """Run tests on modules imported anew."""
        if not items:
            return
        for name, module in list(sys.modules.items()):
            if str(getattr(module, "__file__", None) or "").startswith(str(self.tree)):
                del sys.modules[name]
        patience = sum(self.known[item.nodeid].taken for item in items)
        signal.setitimer(signal.ITIMER_PROF, 10 * LEAST + PATIENCE * patience)
        first = First()
        code = pytest.main([*OPTIONS, *(item.nodeid for item in items)], plugins=[first])
        self._tell(first.failed or ("no test can be collected" if code else ""), tell)

    def _tell(self, killer: str, tell: Callable[[str], None]) -> None:
        if killer:
            tell(killer)
            os._exit(1)

    def _telling(self, path: Path, mutant: Mutant) -> tuple[list[pytest.Item], list[pytest.Item]]:
        """Return the tests that run the changed statement and the others that run anything of its file."""
        file = str(path.relative_to(self.tree))
        wanted = lines_of(path.read_text(encoding="latin-1"), mutant) if path.suffix == ".py" else None
        near, far = [], []
        for name, known in self.known.items():
            lines = known.lines.get(file) if path.suffix == ".py" else any(each in known.lines for each in STEP)
            if not 0.0 <= known.taken <= self.longest:
                continue
            if lines:
                (near if wanted is None or not wanted.isdisjoint(known.lines[file]) else far).append(name)
            elif wanted is None and known.taken < QUICK:
                far.append(name)

        def ordered(names: list[str]) -> list[pytest.Item]:
            """What a change costs before it is noticed, by what was noticed so far."""

            def cost(name: str) -> float:
                noticed, missed = self.kills[_one(path), name], self.blind[_one(path), name]
                return (BEGUN + self.known[name].taken) * (1.0 + noticed + missed) / (1.0 + 2.0 * noticed)

            names.sort(key=cost)
            return [self.items[name] for name in names]

        return ordered(near), ordered(far)


def _one(path: Path) -> Path:
    """Return for what tests are known to notice much or little: a file, or all files of one library."""
    return path if path.suffix == ".py" else path.parent


def _digest(test: pytest.Item) -> str:
    return test_digest(test.path, str(getattr(test, "originalname", test.name)))


STEP = ("rover_pin/motion/kernel.py", "rover_pin/motion/native/__init__.py")
"""Tests that run one of these run the C of the step, or read it."""
OPTIONS = "-x -q --tb=no -s -p no:cacheprovider -p no:xdist -p no:benchmark -p no:faulthandler -m".split()
OPTIONS += ["not slow", "-W", "ignore::pytest.PytestAssertRewriteWarning"]
