"""Data sets with sealed answers: they are planned from a seed, driven in batches, and resumed after an interruption."""

import hashlib
import json
import os
import secrets
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from . import circumstance, hidden
from .campaign import DURATION, data_set, electric
from .drive import drive
from .logs import write_set
from .sensors import measured
from .vehicle import KNOWN

BATCH = 8
"""Sets driven together, six runs each."""
SEAL = "answers.sha256"
SOFT = "DifferentialCompliance"
COSTLY = ("ExitAngle", "DiggingMemory", "SlipSinkage", "SkidSinkage", "LoadExponent", "PeakStress")


def plan(seed, count, shares=None, only=None, under="plain"):
    """Return the hidden content of each set: dictionaries of index, kind, hidden effects and circumstance.

    `under` is the circumstance of all sets whose effects its rover can have (the others have none), or "any" for a
    random circumstance of each set.
    """
    random = np.random.default_rng([seed, 0])
    kinds = ["only"] * count if only else hidden.composition(count, shares or hidden.SHARES, random)
    listed = iter(hidden.dealt(sorted(hidden.LISTED), 3 * count, random))
    decks = {
        "off-list": iter(hidden.dealt(sorted(hidden.OFF_LIST), count, random)),
        "sensor": iter(hidden.dealt(sorted(hidden.SENSOR), count, random)),
        "other-law": iter(hidden.dealt(sorted(hidden.OTHER_LAWS), count, random)),
    }
    plan_list = []
    for index, kind in enumerate(kinds, 1):
        set_rng = np.random.default_rng([seed, index, 0])
        names = {
            "only": lambda: [] if only == "none" else [only],
            "none": list,
            "single": lambda: [next(listed)],
            "pair": lambda: pair(listed),
        }.get(kind, lambda kind=kind: [next(decks[kind])])()
        plan_of_set = {"index": index, "kind": kind, "hidden": [hidden.truth(name, set_rng) for name in names]}
        fit = under if circumstance.fits(under, plan_of_set["hidden"]) else "plain"
        plan_list.append(
            plan_of_set | {"under": circumstance.drawn(seed, index, plan_of_set["hidden"]) if under == "any" else fit}
        )
    return plan_list


def planned(seed, set_plan):
    return data_set(seed, set_plan["index"], set_plan["kind"], set_plan["hidden"], set_plan.get("under", "plain"))


def pair(listed):
    first = next(listed)
    return [first, next(name for name in listed if name != first)]


def folder_of(out, index):
    return Path(out) / f"set_{index:04d}"


def generate(out, sets, seed, answers, workers=1, duration=DURATION):
    """Write all sets that are missing in `out`, and write their answers, sealed, to a file in another place."""
    out, answers = Path(out), Path(answers)
    assert out.resolve() not in answers.resolve().parents, "keep the answers out of the sets' folder"
    out.mkdir(parents=True, exist_ok=True)
    seal(out, sets, seed, answers)
    waiting = [set_plan for set_plan in sets if not folder_of(out, set_plan["index"]).exists()]
    batches = list(batched(waiting))
    if workers <= 1 or len(batches) <= 1:
        for batch in batches:
            drive_batch(out, seed, batch, duration)
        return
    with ProcessPoolExecutor(workers) as pool:
        for done in [pool.submit(drive_batch, out, seed, batch, duration) for batch in batches]:
            done.result()


def seal(out, sets, seed, answers):
    """Write the answers once, and their hash next to the sets. Refuse answers that have changed since then."""
    answer_list = [
        {"set": folder_of(out, set_plan["index"]).name} | planned(seed, set_plan)["answer"] for set_plan in sets
    ]
    salt = json.loads(answers.read_text())["salt"] if answers.exists() else secrets.token_hex(16)
    text = json.dumps({"salt": salt, "seed": seed, "sets": answer_list}, indent=1) + "\n"
    digest = hashlib.sha256(text.encode()).hexdigest()
    mark = out / SEAL
    if mark.exists() and mark.read_text().split()[0] != digest:
        raise SystemExit(f"{out}: its sets were sealed with other answers; choose another folder.")
    for path, content in ((answers, text), (mark, f"{digest}  {answers.name}\n")):
        path.parent.mkdir(parents=True, exist_ok=True)
        beside = path.with_name(f".{path.name}.{os.getpid()}")
        beside.write_text(content)
        os.replace(beside, path)


def opened(out, answers):
    """Return the answers after a comparison with their hash."""
    text = Path(answers).read_bytes()
    assert hashlib.sha256(text).hexdigest() == (Path(out) / SEAL).read_text().split()[0], "the seal is broken"
    return json.loads(text)


def batched(sets):
    """Return the sets in batches. Sets with a compliant differential have another tree of joints, and batches of their
    own.

    A batch has one rover. Every costly law that acts in one of its runs is computed for all of them, so that runs with
    costly laws are put together.
    """

    def dear(set_plan):
        return sorted(COSTLY.index(cause["effect"]) for cause in set_plan["hidden"] if cause["effect"] in COSTLY)

    ordered = sorted(sets, key=lambda set_plan: dear(set_plan) or [-1])

    def tree(set_plan):
        return vehicle_of(set_plan).name, any(cause["effect"] == SOFT for cause in set_plan["hidden"])

    for kind in ((name, soft) for name in KNOWN for soft in (False, True)):
        same_tree = [set_plan for set_plan in ordered if tree(set_plan) == kind]
        yield from (same_tree[i : i + BATCH] for i in range(0, len(same_tree), BATCH))


def vehicle_of(set_plan):
    return circumstance.vehicle(set_plan.get("under", "plain"))


def drive_batch(out, seed, sets, duration=DURATION):
    """Drive the runs of some sets at once, and write each set."""
    plans = [planned(seed, set_plan) for set_plan in sets]
    runs = [run for set_plan in plans for _, _, run in set_plan["runs"]]
    vehicle = vehicle_of(sets[0])
    true = drive(runs, duration, vehicle=vehicle)
    at = 0
    for set_plan, drive_plan in zip(sets, plans, strict=True):
        logged = []
        for number, _ in enumerate(drive_plan["runs"]):
            random = np.random.default_rng([seed, set_plan["index"], 3, number])
            channels = {name: values[at] for name, values in true.items()}
            own_time = np.random.default_rng([seed, set_plan["index"], 5, number])
            channels = circumstance.sampled(drive_plan["under"], channels, own_time)
            faults, gains = drive_plan["faults"], drive_plan["answer"]["tacho_gain"]
            read = measured(channels, faults, gains, random, electric(set_plan["index"]), vehicle)
            logged.append(circumstance.read(drive_plan["under"], read, random))
            at += 1
        write_set(folder_of(out, set_plan["index"]), drive_plan, logged)
