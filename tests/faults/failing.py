"""A command whose n-th write, folder or child process is refused by the system, or whose files may not grow.

`python failing.py KIND EVERY CACHE -- WORDS` runs the words in copies of the folder it stands in: once as it is, then
with each EVERY-th event of that kind refused. It prints a line of JSON a run. The commands are forked from one process
that has imported the package; CACHE is the folder of what is compiled, emptied before each run of children.
"""

import errno
import fcntl
import hashlib
import importlib
import json
import os
import resource
import shutil
import signal
import sys
import tempfile
import traceback
from pathlib import Path

from rover_pin.cli import app

WRITE, CHILD, ROOM, MEMORY = "write", "child", "room", "memory"
MADE = {"os.rename", "os.mkdir", "os.link", "os.symlink", "os.truncate", "tempfile.mkstemp", "tempfile.mkdtemp"}
BORN = {"subprocess.Popen", "os.posix_spawn", "os.fork", "os.exec"}
REFUSAL = {WRITE: errno.ENOSPC, CHILD: errno.EAGAIN}
ROOMS = (1, 100, 3_000, 40_000)
"""Bytes to which files may grow."""
MEMORIES = tuple(2**power for power in range(17, 30))
"""Bytes by which memory may grow: from nothing to more than any of them takes."""
LIBRARIES = (
    "matplotlib.pyplot",
    "pandas",
    "rover_pin.scenarios.scenario",
    "rover_pin.loop.close",
    "rover_pin.sweep.run",
)
LOADED = ("drive",)
"""What is imported before memory is refused, so that it is the command that finds none; and whose imports find none."""
CRASHED = 99
MOST_SAID = 2**20


def writes(event, arguments):
    """Whether an event of the interpreter makes or changes a file or folder."""
    if event != "open":
        return event in MADE
    path, mode, flags = arguments
    if not isinstance(path, (str, bytes)) or str(path).startswith(("/dev/", "/proc/")):
        return False
    return set("wax+") & set(mode) if isinstance(mode, str) else bool((flags or 0) & (os.O_WRONLY | os.O_RDWR))


class Refusing:
    """Refuses the n-th event of a kind, and counts them."""

    def __init__(self, kind):
        self.kind, self.count, self.at, self.armed = kind, 0, 0, False
        sys.addaudithook(self)

    def __call__(self, event, arguments):
        if not self.armed or not (event in BORN if self.kind == CHILD else writes(event, arguments)):
            return
        self.count += 1
        if self.count == self.at and self.kind in REFUSAL:
            raise OSError(REFUSAL[self.kind], os.strerror(REFUSAL[self.kind]))


def contents(folder):
    """Digest of every file of a folder but locks, which a process that ended no longer holds."""
    files = (path for path in sorted(folder.rglob("*")) if path.is_file() and path.suffix != ".lock")
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def main(kind, every, cache, _, *words):
    refusing, folder_at_start = Refusing(kind), Path.cwd()
    if kind == MEMORY and words[0] not in LOADED:
        for name in LIBRARIES:
            importlib.import_module(name)
    before = contents(folder_at_start)
    total, after = one(refusing, words, folder_at_start, cache, 0)
    events = {ROOM: ROOMS, MEMORY: MEMORIES}.get(kind, range(1, total + 1, int(every)))
    for at in events:
        one(refusing, words, folder_at_start, cache, at, before, after)


def one(refusing, words, folder, cache, at, before=None, after=None):
    """Run the words in a copy of the folder; print and return what became of it."""
    if refusing.kind == CHILD:
        shutil.rmtree(cache, ignore_errors=True)
        Path(cache).mkdir()
    with tempfile.TemporaryDirectory() as place:
        work = Path(place) / "work"
        shutil.copytree(folder, work)
        code, count, err = forked(refusing, words, work, at)
        now = contents(work)
    if before is None:
        print(json.dumps({"code": code, "events": count, "err": err}), flush=True)
        return count, now
    changed = [name for name, digest in now.items() if digest not in (before.get(name), after.get(name))]
    lost, absent = (sorted(set(files) - set(now)) for files in (before, after))
    print(
        json.dumps({"at": at, "code": code, "err": err, "changed": changed, "lost": lost, "absent": absent}), flush=True
    )
    return count, now


def forked(refusing, words, work, at):
    """Run the words in a child process; return its exit code, how many events there were, and what it said."""
    ours, theirs = os.pipe()
    spoken, speaking = os.pipe()  # no limit of a file's size holds there
    fcntl.fcntl(speaking, fcntl.F_SETPIPE_SZ, MOST_SAID)
    pid = os.fork()
    if pid:
        os.close(theirs)
        os.close(speaking)
        os.set_blocking(spoken, False)
        with os.fdopen(ours) as pipe, os.fdopen(spoken, "rb") as output:
            outcome = json.loads(pipe.read() or "[-9, 0]")
            os.waitpid(pid, 0)
            return *outcome, (output.read(MOST_SAID) or b"").decode()
    os.chdir(work)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    os.dup2(speaking, 2)
    code = refused(refusing, words, at)
    for limit in (resource.RLIMIT_FSIZE, resource.RLIMIT_AS):
        resource.setrlimit(limit, resource.getrlimit(limit)[1:] * 2)
    os.write(theirs, json.dumps([code, refusing.count]).encode())
    os._exit(0)


def taken():
    """Bytes of memory that this process has mapped."""
    return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()


def refused(refusing, words, at):
    sys.argv = ["rover-pin", *words]
    if refusing.kind == ROOM and at:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (at, resource.RLIM_INFINITY))
    if refusing.kind == MEMORY and at:
        resource.setrlimit(resource.RLIMIT_AS, (taken() + at, resource.RLIM_INFINITY))
    refusing.at, refusing.armed = at, True
    try:
        app.main()
    except SystemExit as end:
        return end.code or 0
    except BaseException:
        refusing.armed = False
        traceback.print_exc()
        return CRASHED
    finally:
        refusing.armed = False
        sys.stderr.flush()


if __name__ == "__main__":
    main(*sys.argv[1:])
