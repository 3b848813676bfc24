"""Numbers of the pages: `{{ ... }}` in a page is a field of `studies/results`, put in when the site is built.

A field that no result has fails the build. `dec(x, n)` rounds to n decimals, `sig(x, n)` to n digits.
`interval(x, n)` writes a value with its 95 % interval, `printed` one that a command prints, and `tables`
has the tables of `page_tables.py`.
"""

from __future__ import annotations

import importlib
import json
import math
import sys
import tomllib
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import jinja2
import pandas as pd
from blind_sets import by_circumstance, counts, misses, reliability, shares, size_error
from page_tables import tables

from rover_pin.simulation.stepping.timing import TOLERANCE

STUDIES = Path(__file__).parents[1] / "studies"
RESULTS = STUDIES / "results"
MEASURED = {
    "smooth": "softening + rate",
    "lugged": "softening + trench + rate",
    "braked": "ploughing",
    "both signs": "softening + ploughing",
    "slip angles": "+ softening + flank",
    "braked askew": "+ softening + flank + ploughing",
    "lugs askew": "+ softening + flank + trench + grip",
    "braked lugs": "ploughing",
}
"""The law of each measured set that is shown."""
CURVES = ("quadratic", "Gaussian process")
FURTHER = 0.01
"""How much further [m] a rover is said to come."""


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Put in the numbers that a page asks for."""
    written = (Path(__file__).parent / page.file.src_uri).is_file()
    return fill_in(markdown) if written and "{{" in markdown else markdown


def fill_in(text: str) -> str:
    """Return a page's text with its numbers."""
    environment = jinja2.Environment(undefined=jinja2.StrictUndefined, autoescape=False, trim_blocks=True)
    environment.globals |= {
        "dec": lambda value, n: f"{value:.{n}f}",
        "sig": significant,
        "interval": interval,
        "printed": printed_interval,
    }
    return environment.from_string(text, globals=fields()).render()


def significant(value: float, digits: int) -> str:
    """Return a number to so many significant digits, without an exponent."""
    return f"{value:.{max(0, digits - 1 - math.floor(math.log10(abs(value))))}f}" if value else "0"


def interval(result: Mapping[str, float], digits: int, scale: float = 1.0) -> str:
    """Return a fitted number with its interval, both times a scale."""
    value, low, high = (f"{scale * result[end]:.{digits}f}" for end in ("value", "low", "high"))
    return f"{value} [{low}, {high}]"


def printed_interval(numbers: Mapping[str, float], name: str, digits: int) -> str:
    """Return a number that a command prints, with the ends of its interval."""
    ends = zip(("value", "low", "high"), (name, f"{name}_low", f"{name}_high"), strict=True)
    return interval({end: numbers[key] for end, key in ends}, digits)


@cache
def fields() -> Mapping[str, Any]:
    """Return every field, by the result that has it."""
    blind = {"rigs": kept("blind_rig", keep_default_na=False), "logs": kept("blind_drives", keep_default_na=False)}
    blind["both"] = pd.concat(blind.values())
    of: dict[str, Any] = {
        "blind": {
            name: {
                "sets": len(sets),
                "shares": shares(sets),
                "counts": counts(sets),
                "misses": misses(sets),
                "size_error": size_error(sets),
            }
            for name, sets in blind.items()
        },
        "circumstances": by_circumstance(blind["logs"]),
        "reliability": {name: reliability(sets) for name, sets in blind.items()},
        "commands": tomllib.loads((RESULTS / "commands.toml").read_text(encoding="utf-8")),
        "made": tomllib.loads((RESULTS / "made.toml").read_text(encoding="utf-8")),
        "digging": digging(),
        "ditches": ditches(),
        "fig10": fig10(),
        "gallery": kept("gallery").to_dict("records"),
        "log_loop": log_loop(),
        "measured_loops": kept("measured_wheels", keep_default_na=False).to_dict("records"),
        "loops_over": loops_over(),
        "mutation": kept("mutation").to_dict("records"),
        "next_run": next_runs(),
        "pendulum": pendulum(),
        "benchmark_systems": rows_of_benchmarks(),
        "slip": sensed_slip(),
        "control": controllers(),
        "beliefs": beliefs(),
        "monitor": {row["level"]: row for row in kept("monitor").to_dict("records")},
        "brier": brier(),
        "speed": speed(),
        "took": took(),
        "traction": traction(),
        "as_driven": as_driven(),
        "tuned": tuned(),
        "improved": improved(),
        "foreign": foreign_logs(),
        "rtk": rtk_log(),
        "turns": turns(),
        "step_error": step_errors(),
        "wheels": measured_wheels(),
    }
    return of | {"tables": tables(of)}


def study_of(name: str) -> ModuleType:
    """Return a study as a module."""
    if str(STUDIES) not in sys.path:
        sys.path.insert(0, str(STUDIES))
    return importlib.import_module(name)


def kept(name: str, **options: Any) -> pd.DataFrame:
    """Return a kept table."""
    return pd.read_csv(RESULTS / f"{name}.csv", **options)


def as_driven() -> list[dict[str, Any]]:
    """Return what is kept of each control that was tuned, or not, as it is driven, by the ground."""
    rows = kept("tune_as_driven").to_dict("records")
    controls = dict.fromkeys(row["control"] for row in rows)
    return [{"name": name, **{row["ground"]: row for row in rows if row["control"] == name}} for name in controls]


def foreign_logs() -> list[dict[str, Any]]:
    """Return how many foreign layouts each importer read right, asked about, or read wrong."""
    kept_layouts = kept("foreign_logs")
    counts = kept_layouts.groupby(["importer", "answer"]).size().unstack(fill_value=0)
    counts = counts.reindex(columns=["right", "asked", "wrong"], fill_value=0).reset_index()
    seeds = kept_layouts.groupby("importer")["seed"].unique()
    counts["seeds"] = [", ".join(map(str, seeds[importer])) for importer in counts["importer"]]
    return [{str(name): value for name, value in row.items()} for row in counts.to_dict("records")]


def turns() -> list[dict[str, Any]]:
    """Return the yaw rate driven over that commanded of public rovers, and their effective track over B."""
    table = kept("public_turns")
    table["share"] = table["driven_deg_s"] / table["commanded_deg_s"]
    shares = table.pivot(index=["rover", "track_over_B", "makers"], columns=["turn", "ground"], values="share")
    return [
        {
            "rover": rover, "ours": f"{ours:.2f}", "makers": f"{makers:.2f}",
            **{turn: f"{row[turn, 'sand']:.2f}, {row[turn, 'hard']:.2f}" for turn in table["turn"].unique()},
        }
        for (rover, ours, makers), row in shares.iterrows()
    ]  # fmt: skip


def step_errors() -> dict[str, float]:
    """Return how many random drives keep their tolerance, and are further off than they state."""
    table = kept("step_error").dropna(subset="off_m")
    off, stated, keeps = table["off_m"], table["stated_m"], table["kept"].astype(bool)
    low, chance = off > stated, table["control"] == "onboard"
    rows = {"low": low, "low elsewhere": low & ~chance, "not kept": keeps & (off > TOLERANCE), "kept": keeps}
    counts = {name: int(chosen.sum()) for name, chosen in rows.items()}
    shares = {"ratio": float((stated / off).median()), "onboard": float(keeps[chance].mean())}
    return counts | {"drives": len(table)} | shares


RTK_MODELS = {"odometry": "Odometry", "base": "Base model", "loop": "What the loop keeps"}


def rtk_log() -> dict[str, Any]:
    """Return the errors on runs left out, and on later ones, of a skid-steered rover's recordings."""
    table = kept("rtk_log", keep_default_na=False)
    rows = []
    for runs, errors in table.groupby("runs", sort=False):
        cells = {row["channel"]: row for row in errors.to_dict("records")}
        both = {name: shown(cells["path"][name], cells["heading"][name]) for name in (*RTK_MODELS, "noise")}
        rows.append({"runs": runs, **both})
    later = table[table["answer"] == ""]
    ahead = later[later["loop"] < later["odometry"]].groupby("channel").size()
    first = table.iloc[0]
    return {"rows": rows, "later": later["runs"].nunique(), "path": ahead.get("path", 0),
            "heading": ahead.get("heading", 0), "answer": first["answer"], "named": first["named"]}  # fmt: skip


def shown(path: float, heading: float) -> str:
    """Return a length in mm and an angle in degrees."""
    return f"{1e3 * path:.1f} mm, {math.degrees(heading):.2f} deg"


def improved() -> dict[str, int]:
    """Return the counts of the blind test of `improve`."""
    table = kept("blind_improve")
    taken = table[~table["keeps"]]
    counts = {"sets": len(table), "inside": int(table["inside"].sum()), "keeps": int(table["keeps"].sum())}
    return counts | {"true_gains": int((taken["true"] > 0.0).sum()), "harms": int(taken["harms"].sum())}


def brier() -> list[dict[str, Any]]:
    """Return the Brier score of the monitor's forecasts, and that of their mean share."""
    row = kept("monitor").iloc[0]
    shares = {event: row[f"share_{event}"] for event in ("stuck", "buried")}
    return [
        {"name": event, "score": row[f"brier_{event}"], "base": share * (1 - share)} for event, share in shares.items()
    ]


def next_runs() -> dict[str, dict[str, float]]:
    """Return how many more runs told what is hidden, by kind: sets, and the medians of those proposed and at random."""
    kinds = kept("next_run").groupby("kind")
    return {str(kind): {"sets": len(rows), **rows[["proposed", "at random"]].median()} for kind, rows in kinds}


def pendulum() -> list[dict[str, Any]]:
    """Return the counts of the blind test of the pendulum."""
    table = kept("blind_pendulum", keep_default_na=False)
    hides = table.hidden != "none"
    laws, nulls = table[hides & table.detectable], table[~hides]
    right = laws.named == laws.hidden
    stated = laws.apply(lambda row: row["hidden"] in row["set"].split(" or "), axis=1)
    counts = {
        "a detectable law, named alone": right & (laws.answer == "named"),
        "a detectable law, in a stated set": (laws.answer == "set") & stated,
        "nothing hidden, something named": nulls.named != "",
        "intervals that hold the truth": laws["interval holds"].astype(str) == "True",
    }
    return [{"what": what, "count": int(rows.sum()), "whole": len(rows)} for what, rows in counts.items()]


def rows_of_benchmarks() -> list[dict[str, Any]]:
    """Return the sets of the benchmark systems, one row each; a set of full length has no unseen runs."""
    rows = kept("benchmark_systems", keep_default_na=False).rename(columns={"CPU [s]": "CPU"}).to_dict("records")
    return [{key: "" if value == "nan" else value for key, value in row.items()} for row in rows]


def speed() -> dict[str, dict[str, float]]:
    """Return what each benchmark measured."""
    table = kept("speed")
    return {str(name): dict(zip(rows.name, rows.value, strict=True)) for name, rows in table.groupby("benchmark")}


def took() -> dict[str, str]:
    """Return the CPU seconds of commands by their first two words: "close-loop cmu-smooth-wheel"."""
    seconds = kept("times").set_index("command").cpu_s
    return {" ".join(line.split()[1:3]): significant(cpu, 2 if cpu >= 1 else 1) for line, cpu in seconds.items()}


def digging() -> dict[str, Any]:
    """Return what becomes of drives on soft inclines that are dug away, and on stiff sand that loses strength."""
    table = kept("digging").fillna({"R": -1.0})
    ground = ["scene", "angle", "k", "R", "c_d"]
    soft = table[(table.scene == "incline") & (table.k >= 0.025) & (table.c_d > 0)]
    stiff = table[(table.scene == "ditch") & (table.loss > 0)]
    bare, stuck = (rows[rows.control == "none"].set_index(ground) for rows in (soft, stiff))
    was_stuck = stuck.there.isna()
    counts: dict[str, Any] = {"inclines": len(bare), "stuck": int(was_stuck.sum())}
    for control in table.control.unique():
        on_soft, on_stiff = (rows[rows.control == control].set_index(ground) for rows in (soft, stiff))
        gain = (on_soft.x_buried - bare.x_buried)[bare.buried.notna()]
        counts[str(control)] = {
            "driven": int(on_soft.end_x.notna().sum()),
            "buried": int(on_soft.buried.notna().sum()),
            "further": int((gain > FURTHER).sum()),
            "rescued": int(on_stiff.there[was_stuck].notna().sum()) if len(on_stiff) else 0,
        }
    return counts


def fig10() -> dict[str, Any]:
    """Return what slip control makes of the ditch of Fig 10, on sand that keeps its strength and that loses it."""
    table = kept("fig10_map")
    losing = table.sand.str.endswith("lost")
    rising, falling = against_bare(table[~losing]), against_bare(table[losing & (table.kind != "eq9")])
    out = falling[(falling.bare == "stuck") & (falling.verdict == "out")]
    walls = sorted(rows.wall_deg.max() - rows.wall_deg.min() + 0.5 for _, rows in out.groupby("sand"))
    return {
        "drives": len(table),
        "rescued": int(((rising.bare == "stuck") & (rising.verdict == "out")).sum()),
        "stuck": int((rising.bare == "stuck").sum()),
        "lost": int(((rising.bare == "out") & (rising.verdict == "stuck")).sum()),
        "passed": int((rising.bare == "out").sum()),
        "falling_rescued": len(out),
        "falling_stuck": int((falling.bare == "stuck").sum()),
        "falling_lost": int(((falling.bare == "out") & (falling.verdict == "stuck")).sum()),
        "falling_passed": int((falling.bare == "out").sum()),
        "other_slip": int((out.S_d != 0.2).sum()),
        "windows": walls,
    }


def against_bare(rows: pd.DataFrame) -> pd.DataFrame:
    """Return controlled drives with the outcome of constant duty on the same ground."""
    bare = rows[rows.kind == "none"].set_index(["sand", "wall_deg"]).verdict.rename("bare")
    return rows[rows.kind != "none"].join(bare, on=["sand", "wall_deg"])


def ditches() -> dict[str, Any]:
    """Return how many held-out ditches each control passes."""
    table = kept("beyond_the_paper")
    rows = table[table.kind == "ditch"]
    passed = {str(name): int(part.passed.sum()) for name, part in rows.groupby("control")}
    inclines = int(table[table.kind == "incline"].drive.nunique())
    return {"passed": passed, "drives": int(rows.drive.nunique()), "inclines": inclines}


def tuned() -> dict[str, Any]:
    """Return mean costs on held-out drives, by control and ensemble, and the slip that tuning chose."""
    table = kept("tune_gains")
    means = table[table.set == "held out"].pivot(index="control", columns="ensemble", values="mean")
    gains = {
        name: tomllib.loads((RESULTS / f"tuned_{name}.toml").read_text(encoding="utf-8"))["S_d"]
        for name in ("slopes", "ditch")
    }
    return {"cost": means.to_dict("index"), "S_d": gains}


LOG_TRUTH = {
    "DiggingMemory.c_d": ("c_d", 3, 1.0, 0.1),
    "DiggingMemory.length": ("L [mm]", 1, 1e3, 40.0),
    "DiggingMemory.deepest": ("deepest hole over r", 2, 1.0, 0.5),
    "soil.k": ("k [mm]", 2, 1e3, 1.5),
    "soil.phi": ("phi [deg]", 1, math.degrees(1.0), 30.0),
    "MotionResistance.R": ("R", 3, 1.0, 0.34),
}
"""Numbers of the drive log: what a page calls each, its decimals, its scale, and the truth."""


def log_loop() -> dict[str, Any]:
    """Return what the loop on the drive log found, held-out errors, and how far free runs go from the log [mm]."""
    verdict = json.loads((RESULTS / "steepening-slope" / "verdict.json").read_text(encoding="utf-8"))
    runs = verdict["extra"]["free_runs"]
    free = {side: math.sqrt(sum(run[side] ** 2 for run in runs) / len(runs)) for side in ("before", "after")}
    held_out = {row["name"]: row for row in verdict["held_out"]}
    rows = {"held-out path": held_out["path"], "held-out elevation": held_out["body_z"], "free runs": free}
    errors = [{"name": name, **{side: 1e3 * row[side] for side in free}} for name, row in rows.items()]
    found = verdict["after"]
    fitted = [
        {"name": name, "fitted": interval(found[key], digits, scale), "true": true}
        for key, (name, digits, scale, true) in LOG_TRUTH.items()
    ]
    return verdict | {"errors": errors, "fitted": fitted}


def sensed_slip() -> dict[str, Any]:
    """Return the errors of sensed slip by estimate and ground."""
    by_estimate: dict[str, Any] = {}
    for row in kept("slip_errors").to_dict("records"):
        by_estimate.setdefault(row["estimate"], {})[row["kind"]] = row
    return by_estimate


def controllers() -> dict[str, Any]:
    """Return how many drives there are, and how many each controller passes and buries, with its mean way [m]."""
    drives = kept("controllers").groupby("control", sort=False)
    rows = {
        str(name): {"passed": int(each.passed.sum()), "buried": int(each.buried.sum()), "way": each.end_x.mean()}
        for name, each in drives
    }
    return {"drives": int(drives.size().max()), "rows": rows}


def beliefs() -> dict[str, Any]:
    """Return how many drives of each generator pass and end buried with each belief of the on-board estimate."""
    table = kept("beliefs")

    def counts(drives: pd.DataFrame) -> dict[str, int]:
        return {"drives": len(drives), "passed": int(drives.passed.sum()), "buried": int(drives.buried.sum())}

    rows = [
        {"name": name, **{generator: counts(part) for generator, part in drives.groupby("generator")},
         "cart": counts(drives[drives.kind == "cart"])}
        for name, drives in table.groupby("belief", sort=False)
    ]  # fmt: skip
    return {"rows": rows, "of": {row["name"]: row for row in rows}, "drives": rows[0]["project"]["drives"]}


def measured_wheels() -> dict[str, Any]:
    """Return tables of held-out errors on measured wheels, in cells of pull [N] / sinkage [mm] (/ side force [N])."""
    cells: dict[tuple[str, str], str] = {}
    for row in kept("wheel_laws").to_dict("records"):
        cells[row["set"], row["law"]] = _cell([row["drawbar_pull_N"], row["sinkage_mm"], row["side_force_N"]])
    study = study_of("wheel_laws")
    tables: dict[str, Any] = {"own": [], "from the others": []}
    for name, law in {**MEASURED, "lugged from smooth": "lugs, sand on sand by the rim's m"}.items():
        curves = {curve: cells[name, curve] for curve in CURVES}
        others = {key: cells.get(at, "-") for key, at in (
            ("authors", (name, study.AUTHORS)), ("one", (study.ONE + name, study.LAW))
        )}  # fmt: skip
        reach = _cell(study.REACH[name])
        tables["own"].append({"set": name, "law": law, "held": cells[name, law], **curves, **others, "reach": reach})
        alone = study.FROM + name
        if (alone, study.THE_LAW) in cells:
            curves = {curve: cells[alone, curve] for curve in CURVES}
            tables["from the others"].append({"set": name, "held": cells[alone, study.THE_LAW], **curves})
    return {**tables, "apart": cells[study.APART + study.ONE + "smooth", study.LAW]}


def loops_over() -> dict[str, str]:
    """Return, in words, the errors of all hypotheses together on measured wheels over those of each curve."""
    study, rows = study_of("measured_wheels"), kept("measured_wheels", keep_default_na=False)
    return {curve: study.in_words(study.over(rows.to_dict("records"), curve)) for curve in study.CURVES}


def _cell(errors: Sequence[float | None]) -> str:
    return " / ".join(f"{error:.2f}" for error in errors if error is not None and not math.isnan(error))


def traction() -> dict[str, dict[str, Any]]:
    """Return F of Table 1 on the paper's wheel in each reading, and the steepest slopes [deg] without and with R."""
    from rover_pin.effects.motion_resistance import MotionResistance
    from rover_pin.parameters import TABLE_1
    from rover_pin.rover.rover import load_rover
    from rover_pin.scenarios.scenario import scenario
    from rover_pin.soil.wheel_forces import FORMS, load_traction_factor

    wheel, readings = load_rover().wheel, {}
    for name, form in FORMS.items():
        factors = [float(load_traction_factor(S, TABLE_1, wheel, form)) for S in (0.0, 0.2, 1.0)]
        effects = scenario("flat", soil="table-1", form=name).model.effects
        held = sum(float(effect.R) for effect in effects if isinstance(effect, MotionResistance))
        slopes = [math.degrees(math.atan(factors[-1] - R)) for R in ((0.0, held) if held else (0.0,))]
        said = ", ".join(f"{slope:.1f}" for slope in slopes)
        readings[name] = {"F": factors, "R": held, "slopes": f"{said} deg" if held else f"{said} deg, -"}
    return readings
