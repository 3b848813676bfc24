"""Compare what a slip control achieves on board if its belief about soil and rover is right, wrong or wide.

Question
    How many drives does the on-board slip control pass, and in how many does it bury a wheel, if the controller does
    not know the rover and the soil that are driven?
Method
    Drives of 40 s are chosen at random by two generators. `slip_sensing.drawn` is the generator of the other studies of
    control: inclines that dig, ditches, slopes that steepen, hills and rocks, a sixth of them with the cart.
    `strange_drives` shares no code and no distribution with it: named soils with their own sinkage laws, slip sinkage
    instead of digging, other grounds, a start that is turned, and 0.5 to 2.5 times the sensor noise. Both drive the
    package's simulator. The belief of each row is made apart from the plant: k is wrong by a factor of 1.5 and phi by
    3 deg in both directions, R by 30 %, the torque constant by 10 %; a cable that pulls with 3 N is unknown; and the
    rover is on the Moon. Wrong numbers have the uncertainty of a soil that is known by its name (`BeliefSD`). In the
    row "taken for certain" the belief has no uncertainty. Nothing was chosen on these seeds. A first run on other seeds
    (410001 and 420001) had a narrower belief about unknown sand: with the SD .08 of R and k = 12 mm it passed 17 and
    buried 5 of 40 drives of the project's generator, and 19 and 4 of the other. The belief was then widened, on drives
    of the seed 55001, and this study was run once on the present seeds.
Result
    Passed and buried drives, of 20 drives of each generator: constant duty 17 / 3 and 14 / 2; with the plant's own
    numbers 16 / 0 and 11 / 0; knowing nothing about the sand 11 / 0 and 9 / 0. With the unsafe wrong soil (k / 1.5, phi
    + 3 deg) 16 / 1 and 14 / 0, and if this soil is taken for certain 16 / 1 and 14 / 1; with the safe wrong soil 14 / 0
    and 7 / 0. With a cable of 3 N and no knowledge 6 / 1 and 4 / 0 (constant duty 13 / 6 and 9 / 3). 20 drives cannot
    show that at most 1 % are buried. On the drives of another seed, on which the estimate was chosen, the unsafe wrong
    soil buried 15 of 80 when it was taken for certain, and 1 of 40 with its uncertainty. The knowledge of the sand buys
    passed drives: on an even slope no sensor shows the speed, so that the slip stays unknown where k is unknown.
What the paper says
    The slip is measured from outside, so that no soil has to be known.
What differs
    The slip comes from on-board sensors and a belief about the soil.
Run: python studies/beliefs.py [--quick] [--rounds N] [--workers N] [--out DIR]
"""

from __future__ import annotations

import argparse
import dataclasses
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from slip_controllers import by_hole
from slip_sensing import GOAL, Case, built, drawn, said

from rover_pin import plot
from rover_pin.control.open_loop import ConstantDuty
from rover_pin.control.sensing.onboard_slip import OnboardSlip
from rover_pin.control.sensing.soil_belief import CERTAIN, BeliefSD, ControllerBelief, highest_strength
from rover_pin.control.sensing.stop import StopStuck
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.simulation.command import Controller
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.sensors import NoisyController, Sensors
from rover_pin.simulation.simulate import simulate
from rover_pin.tuning.evaluations import Evaluations

SEEDS = {"project": 430_001, "strange": 440_001}
"""Generator of drives -> seed of its first drive. Nothing was chosen on these seeds."""
ROUNDS, DURATION = 2, 40.0
"""Number of rounds of ten drives of each generator, and the duration of a drive [s]."""
STRANGE_GOAL = {"ditch": 0.95, "incline": 1.0, "bump": 0.9, "washboard": 0.9, "hills": 0.7}
"""Scenario of the strange generator -> position x that the base must reach for the drive to count as passed [m]."""


def wrong(k: float = 1.0, phi_deg: float = 0.0, R: float = 1.0, torque: float = 1.0) -> Callable[[Model], Model]:
    """Return a function that makes a wrong model of a plant: factors on k, R and the torque constant, and an error of
    phi.
    """

    def of(plant: Model) -> Model:
        soil = plant.soils[0]
        soil = soil.replace(k=k * float(soil.k), phi=float(soil.phi) + math.radians(phi_deg))
        motor = plant.motor.replace(k_t=torque * float(plant.motor.k_t))
        model = plant.replace(soils=(soil, *plant.soils[1:]), motor=motor)
        resistance = plant.effect(MotionResistance)
        return model.having(resistance.replace(R=R * float(resistance.R)))

    return of


class Row(NamedTuple):
    """A row of the table: the belief of a plant's controller (None: constant duty), and what the drive has in
    addition.
    """

    belief: Callable[[Model], ControllerBelief] | None
    plant: Mapping[str, Any] = MappingProxyType({})


def about(model: Callable[[Model], Model], sd: BeliefSD = BeliefSD()) -> Callable[[Model], ControllerBelief]:
    """Return a function that makes the belief in a wrong model of a plant."""
    return lambda plant: ControllerBelief(model(plant), sd, "study")


CABLE, MOON = {"add": "TetherDrag.f_0=3"}, {"gravity": "moon"}
WIDE = ControllerBelief.unknown_sand
ROWS = {
    "constant duty": Row(None),
    "knows the plant": Row(ControllerBelief.of_plant),
    "unknown sand": Row(WIDE),
    "k / 1.5, phi + 3 deg, taken for certain": Row(about(wrong(1 / 1.5, 3.0), CERTAIN)),
    "k / 1.5, phi + 3 deg": Row(about(wrong(1 / 1.5, 3.0))),
    "k x 1.5, phi - 3 deg": Row(about(wrong(1.5, -3.0))),
    "k / 1.5, phi - 3 deg": Row(about(wrong(1 / 1.5, -3.0))),
    "k x 1.5, phi + 3 deg": Row(about(wrong(1.5, 3.0))),
    "constant duty, cable of 3 N": Row(None, CABLE),
    "unknown sand, unknown cable of 3 N": Row(WIDE, CABLE),
    "constant duty, Moon": Row(None, MOON),
    "unknown sand, Moon": Row(WIDE, MOON),
    "R x 1.3": Row(about(wrong(R=1.3))),
    "R x 0.7": Row(about(wrong(R=0.7))),
    "torque constant x 1.1": Row(about(wrong(torque=1.1))),
    "torque constant / 1.1": Row(about(wrong(torque=1 / 1.1))),
}


def strange_drives(count: int, seed: int) -> list[Case]:
    """Return `count` drives of the generator that shares nothing with `slip_sensing.drawn`. The settings `noise` and
    `start.yaw` are the factor on the sensor noise and the heading at the start.
    """
    random = np.random.default_rng(seed)
    soils = ("table-1", "slope-sand", "literature-sand", "fjs-1", "hit-lss1", "lunar-nominal", "mars-sand")
    cases = []
    for at in range(count):
        scene = str(random.choice(["incline", "incline", "ditch", "bump", "washboard", "hills"]))
        settings: dict[str, Any] = {"soil": str(random.choice(soils)), "duration": DURATION}
        settings["effect.MotionResistance.R"] = float(random.triangular(0.01, 0.05, 0.12))
        settings["start.yaw"] = float(random.normal(0.0, 0.05))
        if scene == "incline":
            settings |= {"terrain.angle_deg": float(random.gamma(6.0, 1.4)), "terrain.start": 0.3}
        if scene == "ditch":
            settings |= {"terrain.wall_angle_deg": float(random.uniform(32.0, 50.0))}
            settings |= {"terrain.depth": float(random.uniform(0.03, 0.06))}
        if scene == "bump":
            settings["terrain.height"] = float(random.uniform(0.02, 0.06))
        if scene == "washboard":
            settings["terrain.amplitude"] = float(random.uniform(0.005, 0.02))
        if scene == "hills":
            settings |= {"terrain.seed": int(random.integers(1000)), "terrain.height": float(random.uniform(0.03, 0.1))}
        # Wheels dig, or sink with slip, or neither.
        digging = f"DiggingMemory.c_d={random.uniform(0.03, 0.25):.3f},length={random.uniform(0.03, 0.08):.3f}"
        sinking = f"SlipSinkage.n_1={random.uniform(0.1, 0.6):.2f}"
        settings["add"] = ((digging,), (sinking,), ())[int(random.integers(3))]
        settings["noise"] = float(np.exp(random.uniform(math.log(0.5), math.log(2.5))))
        cases.append(Case(f"{at + 1}: {scene}", f"strange {scene}", scene, tuple(sorted(settings.items()))))
    return cases


def controller(plant: Model, row: Row) -> Controller:
    """Return the controller of a row for a plant."""
    if row.belief is None:
        return ConstantDuty()
    belief = row.belief(plant)
    estimate = OnboardSlip.of(belief)
    control = by_hole(belief.model, estimate)
    control = dataclasses.replace(control, limit=control.limit.scaled(highest_strength(belief.sd)))
    return StopStuck(control, estimate)


def driven(case: Case, name: str, seed: int) -> list[float]:
    """Return the final x [m] of a drive, whether the rover passed, and whether a wheel was buried."""
    row, settings = ROWS[name], dict(case.settings)
    noise = settings.pop("noise", 1.0)
    added = settings.get("add", ())
    cable = (row.plant["add"],) if "add" in row.plant else ()
    settings |= row.plant | ({"add": (*((added,) if isinstance(added, str) else added), *cable)} if cable else {})
    scene = built(case._replace(settings=tuple(sorted(settings.items()))))
    law = controller(scene.model, row)
    sensors = Sensors()
    noisy = sensors.replace(**{key: noise * float(value) for key, value in sensors.values().items() if "sd" in key})
    law = NoisyController(law, noisy, seed) if row.belief else law
    trace = simulate(scene.model, law, scene.duration, scene.start, scene.timing, measure_error=False)
    goal = STRANGE_GOAL[case.scene] if case.kind.startswith("strange") else GOAL[case.scene]
    x = trace["body_x"]
    return [float(x[-1]), float(np.max(x) > goal), float(str(trace.attrs["stop"]).startswith("buried"))]


def main() -> None:
    """Drive every case with every row, and write and print the results."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="two short drives of three rows: shows that it runs")
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    parser.add_argument("--workers", type=int, default=0, help="processes; 0 for all cores")
    parser.add_argument("--out", type=Path, default=Path("out/beliefs"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    count = 10 * options.rounds
    cases = [(case, SEEDS["project"] + at) for at, case in enumerate(drawn(options.rounds, DURATION, SEEDS["project"]))]
    cases += [(case, SEEDS["strange"] + at) for at, case in enumerate(strange_drives(count, SEEDS["strange"]))]
    names = list(ROWS)
    if options.quick:
        names, pair = ["constant duty", "unknown sand", "unknown sand, unknown cable of 3 N"], (cases[3], cases[-1])
        short = [{**dict(case.settings), "duration": 3.0} for case, _ in pair]
        cases = [
            (case._replace(settings=tuple(sorted(settings.items()))), seed)
            for (case, seed), settings in zip(pair, short, strict=True)
        ]
    evaluations = Evaluations(options.out, options.workers or None, said)
    tables = []
    for name in names:
        results = evaluations.run(name, driven, [(case, name, seed) for case, seed in cases])
        drives = pd.DataFrame(results, columns=["end_x", "passed", "buried"])
        generators = ["strange" if case.kind.startswith("strange") else "project" for case, _ in cases]
        kinds = [case.kind for case, _ in cases]
        tables.append(drives.assign(belief=name, generator=generators, kind=kinds, seed=[seed for _, seed in cases]))
        print(line(tables[-1]), flush=True)
        # The table is written after each row, so that an interrupted run leaves a table.
        columns = ["belief", "generator", "kind", "seed", "end_x", "passed", "buried"]
        plot.write_csv(pd.concat(tables)[columns], options.out / "beliefs.csv")
    print(f"written: {options.out}/beliefs.csv, {figure(pd.concat(tables), options.out)}")


def figure(table: pd.DataFrame, out: Path) -> Path:
    """Draw the share of passed and of buried drives of each row, one panel for each generator, and return the file."""
    rows = list(dict.fromkeys(table.belief))
    sheet, axes = plot.new_figure(1, 2, size=(10.0, 1.5 + 0.35 * len(rows)), sharey=True)
    at = np.arange(len(rows))
    for axis, (generator, drives) in zip(axes, table.groupby("generator"), strict=False):
        shares = drives.groupby("belief")[["passed", "buried"]].mean().loc[rows] * 100.0
        axis.barh(at - 0.2, shares.passed, 0.4, label="passed")
        axis.barh(at + 0.2, shares.buried, 0.4, label="buried")
        axis.set(xlim=(0.0, 100.0), xlabel="drives [%]", title=f"{generator} generator")
    # The first row of the table is at the top; both panels share this axis.
    axes[0].set(yticks=at, yticklabels=rows)
    axes[0].invert_yaxis()
    axes[-1].legend(loc="lower right")
    return plot.save(sheet, out / "beliefs.png")


def line(drives: pd.DataFrame) -> str:
    """Return the results of one row as text: passed and buried drives of each generator, and of the cart."""
    parts = [(name, part) for name, part in drives.groupby("generator")]
    parts += [("cart", drives[drives.kind == "cart"])]
    counts = [f"{name} {int(part.passed.sum())} / {int(part.buried.sum())} of {len(part)}" for name, part in parts]
    return f"{drives.belief.iloc[0]:42s} passed / buried: {', '.join(counts)}"


if __name__ == "__main__":
    main()
