"""What the loop says of a few fixed data sets, frozen; run this file to freeze today's answers into answers.json.

Only what a reader acts on is kept: the answer, the names, the sizes with their intervals, the held-out errors.
"""

import importlib.util
import json
import sys
import tempfile
from pathlib import Path

from rover_pin.effects.supply_sag import SupplySag
from rover_pin.effects.weak_motor import WeakMotor
from rover_pin.loop.close import close_the_loop

TESTS = Path(__file__).parents[1]
FROZEN = Path(__file__).with_name("answers.json")


def _module(path):
    spec = importlib.util.spec_from_file_location(f"golden_{path.stem}", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


generator = _module(TESTS / "oracle" / "rig_generator.py")
drive_sets = _module(TESTS / "experiments" / "drive_log" / "drive_sets.py")


def rig(effect, seed):
    """Return a maker of the folder of a generated rig set."""

    def make(folder):
        hidden = generator.Rig(effect, generator.SIZES[effect])
        return generator.write(
            folder, hidden, generator.rig_set(hidden, seed=seed), generator.WRONG if seed % 2 else None
        )

    return make


def drive(hidden, **options):
    """Return a maker of the folder of a small drive log."""
    return lambda folder: drive_sets.write(folder, hidden, **options)


FAST = {
    "cmu-smooth-wheel": lambda folder: TESTS.parent / "studies" / "data" / "cmu-smooth-wheel",
    "rig none 2": rig("none", 2),
}
SLOW = {
    **{f"rig {effect} {seed}": rig(effect, seed)
       for effect, seed in (("none", 3), ("slip_sinkage", 1), ("exit_angle", 2), ("peak_stress", 0), ("post_peak", 1),
                            ("motion_resistance", 2), ("digging", 3), ("slip_squared_drag", 1))},
    "drive supply sag": drive([SupplySag(R_b=2.5)]),
    "drive cart weak motor": drive([WeakMotor(g=-0.25, wheel=0)], rover="cart", runs=4, duration=6.0),
}  # fmt: skip
MAKERS = FAST | SLOW


def answer(name, folder):
    """Return the answer of the loop on one set."""
    stored = close_the_loop(MAKERS[name](folder), jobs=1).as_dict()
    prefix = "soil." if stored["kind"] == "wheel-rig" else "."
    fitted = {key.removeprefix(prefix): entry for key, entry in stored["after"].items()}
    sizes = {
        key: [entry["value"], entry["low"], entry["high"]]
        for key, entry in fitted.items()
        if "." not in key or key.partition(".")[0].partition("[")[0] in stored["effects"]
    }
    held_out = {entry["name"]: [entry["before"], entry["after"]] for entry in stored["held_out"]}
    return {"answer": stored["answer"], "effects": stored["effects"], "alike": stored["alike"], "sizes": sizes} | {
        "held_out": held_out
    }


def freeze():
    """Write today's answers of the sets named on the command line, or of all."""
    stored = json.loads(FROZEN.read_text(encoding="utf-8")) if FROZEN.exists() else {}
    for name in sys.argv[1:] or MAKERS:
        with tempfile.TemporaryDirectory() as folder:
            stored[name] = answer(name, Path(folder) / "set")
    FROZEN.write_text(json.dumps(stored, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    freeze()
