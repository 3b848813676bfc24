"""A command whose n-th write, folder or child process is refused by the system, or whose files may not grow.

`python failing.py KIND EVERY CACHE -- WORDS` runs the words in copies of the folder it stands in: once as it is, then
with each EVERY-th event of that kind refused. It prints a line of JSON a run. The commands are forked from one process
that has imported the package; CACHE is the folder of what is compiled, emptied before each run of children.
"""

import errno
import hashlib
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

WRITE, CHILD, ROOM = "write", "child", "room"
MADE = {"os.rename", "os.mkdir", "os.link", "os.symlink", "os.truncate", "tempfile.mkstemp", "tempfile.mkdtemp"}
BORN = {"subprocess.Popen", "os.posix_spawn", "os.fork", "os.exec"}
REFUSAL = {WRITE: errno.ENOSPC, CHILD: errno.EAGAIN}
ROOMS = (0, 100, 3_000, 40_000)
"""Bytes to which files may grow."""
CRASHED = 99


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
        if self.count == self.at and self.kind != ROOM:
            raise OSError(REFUSAL[self.kind], os.strerror(REFUSAL[self.kind]))


def contents(folder):
    """Digest of every file of a folder but locks, which a process that ended no longer holds."""
    files = (path for path in sorted(folder.rglob("*")) if path.is_file() and path.suffix != ".lock")
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def main(kind, every, cache, _, *words):
    refusing, here = Refusing(kind), Path.cwd()
    before = contents(here)
    total, after = one(refusing, words, here, cache, 0)
    events = ROOMS if kind == ROOM else range(1, total + 1, int(every))
    for at in events:
        one(refusing, words, here, cache, at, before, after)


def one(refusing, words, here, cache, at, before=None, after=None):
    """Run the words in a copy of the folder; print and return what became of it."""
    if refusing.kind == CHILD:
        shutil.rmtree(cache, ignore_errors=True)
        Path(cache).mkdir()
    with tempfile.TemporaryDirectory() as place:
        work, spoken = Path(place) / "work", Path(place) / "err"
        shutil.copytree(here, work)
        code, count = forked(refusing, words, work, spoken, at)
        now, err = contents(work), spoken.read_text()
    if before is None:
        print(json.dumps({"code": code, "events": count, "err": err}), flush=True)
        return count, now
    changed = [name for name, digest in now.items() if digest not in (before.get(name), after.get(name))]
    lost, absent = (sorted(set(files) - set(now)) for files in (before, after))
    print(
        json.dumps({"at": at, "code": code, "err": err, "changed": changed, "lost": lost, "absent": absent}), flush=True
    )
    return count, now


def forked(refusing, words, work, spoken, at):
    """Run the words in a child process; return its exit code and how many events there were."""
    ours, theirs = os.pipe()
    pid = os.fork()
    if pid:
        os.close(theirs)
        with os.fdopen(ours) as pipe:
            said = pipe.read()
        os.waitpid(pid, 0)
        return json.loads(said or "[-9, 0]")
    os.chdir(work)
    files = [os.open(name, os.O_WRONLY | os.O_CREAT) for name in (os.devnull, spoken)]
    for stream, file in zip((1, 2), files, strict=True):
        os.dup2(file, stream)
    code = refused(refusing, words, at)
    resource.setrlimit(resource.RLIMIT_FSIZE, resource.getrlimit(resource.RLIMIT_FSIZE)[1:] * 2)
    os.write(theirs, json.dumps([code, refusing.count]).encode())
    os._exit(0)


def refused(refusing, words, at):
    sys.argv = ["rover-pin", *words]
    if refusing.kind == ROOM and at in ROOMS:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (at or 1, resource.RLIM_INFINITY))
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
