"""The page of a drive verdict: what stands in it for every answer, and what its tables and figures say."""

import base64
import dataclasses
import math
import re

import numpy as np
import pytest

from rover_pin.body.rover import load_rover
from rover_pin.body.shapes import flat
from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.cross_validation import loss_of, refitted_left_out
from rover_pin.discrepancy.held_out import held_out, together
from rover_pin.discrepancy.refit import Refit
from rover_pin.discrepancy.screen import Scored, Signature, fee_of
from rover_pin.discrepancy.search import Round, Search
from rover_pin.discrepancy.verdict import Side, Verdict
from rover_pin.effects.gear_friction import GearFriction
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.effects.supply_sag import SupplySag
from rover_pin.effects.torque_saturation import TorqueSaturation
from rover_pin.effects.weak_motor import WeakMotor
from rover_pin.effects.winding_heating import WindingHeating
from rover_pin.estimation.fit import Fit, Task, slopes_at
from rover_pin.estimation.noise import first_noise, noise_of
from rover_pin.estimation.numbers import numbers
from rover_pin.estimation.profile import Profile
from rover_pin.experiments.drive_log.experiment import experiment_of
from rover_pin.experiments.drive_log.extra import DriveExtra, extra_of
from rover_pin.experiments.drive_log.features import logged_run
from rover_pin.experiments.drive_log.free_runs import free_runs
from rover_pin.experiments.drive_log.model import DRIVEN_SAND
from rover_pin.experiments.drive_log.parameters import parameter
from rover_pin.experiments.unlisted.actions import FORCE, Act
from rover_pin.experiments.unlisted.regressors import Argument, Hats, Polynomial
from rover_pin.experiments.unlisted.remainder import ChannelRemainder, Remainder
from rover_pin.experiments.unlisted.term import Term
from rover_pin.measurements.finding import Finding
from rover_pin.motion.drive_log import About, DriveLog
from rover_pin.motion.model import Model, base_effects
from rover_pin.motion.motors import nexus6_motor
from rover_pin.motion.place import Start
from rover_pin.motion.replay import PERIOD, Commands, replay
from rover_pin.motion.sensors import Sensors, measured
from rover_pin.motion.trace import Trace
from rover_pin.report.drive import figures, html, sides_of, write_drive_report
from rover_pin.report.drive_cautions import cautions
from rover_pin.report.drive_rows import number_rows, refit_rows, summary_rows
from rover_pin.report.drive_runs import Sides, strayed, telling_channels, worst_runs
from rover_pin.report.drive_sensitivity import sensitivities
from rover_pin.report.page import HEADLINES
from rover_pin.soil.angles import FixedAngles
from rover_pin.soil.traction import TorqueTraction

SECONDS = 5.0


def base():
    rover = load_rover("nexus6")
    effects = base_effects(DRIVEN_SAND, rover, SoilTraction(TorqueTraction(), FixedAngles()))
    return Model(rover, flat(), (DRIVEN_SAND,), nexus6_motor(), effects=effects).having(WeakMotor(g=0.0, wheel=0))


def log_of(truth, seed):
    t = PERIOD * np.arange(round(SECONDS / PERIOD))
    duty = np.random.default_rng(seed).uniform(0.45, 0.85, 2)[np.arange(len(t)) * 2 // len(t)]
    steer = np.zeros((len(t), sum(wheel.steer_dof is not None for wheel in truth.rover.wheels)))
    told = Commands(t, np.repeat(duty[:, None], 6, axis=1), steer, np.full((len(t), 3), np.nan), Start())
    duties = {f"duty_{wheel.name}": told.duty[:, at] for at, wheel in enumerate(truth.rover.wheels)}
    attrs = {"start": dataclasses.asdict(told.start), "file": f"run_{seed}.csv"}
    trace = measured(Trace({**replay(truth, told).channels, **duties}), Sensors(), seed, truth.sensor_effects)
    return dataclasses.replace(trace, attrs=attrs)


def fitted(task, model, parameters):
    """A fit that is where it starts."""
    u = np.array([one.u(SupplySag().R_b) if one.name == "SupplySag.R_b" else 0.0 for one in parameters])
    predicted = task.experiment.predict([model])[0]
    return Fit(task, model, tuple(parameters), u, predicted, slopes_at(task, model, parameters, u))


@pytest.fixture(scope="module")
def made():
    """Two logged runs of a sagging supply, with the fits before and after it is added."""
    model, truth = base(), base().having(SupplySag())
    traces = tuple(log_of(truth, seed) for seed in (1, 2))
    experiment = experiment_of([logged_run(trace, model.rover) for trace in traces], model)
    left = experiment.observed - experiment.predict([truth])[0]
    least = np.full(len(experiment.channels), 1e-4)
    task = Task(experiment, noise_of(left, first_noise(left, least).good, least))
    free = [parameter(model, "soil.phi", math.radians(2.0)), parameter(model, "WeakMotor[0].g", 0.02)]
    before = fitted(task, model, free)
    after = fitted(task, truth, [*free, SAG.size("SupplySag.R_b")])
    return DriveLog("nowhere", About("small", source="made here"), traces), before, after


SAG = Candidate("SupplySag", SupplySag(), ("SupplySag.R_b",), ("SupplySag.tau",))


def scored(candidate, base, sizes, gain, visible, absorbed):
    neutral = candidate.effect.neutral if candidate.effect else {"g": 0.0}
    own = {name: neutral[name.rpartition(".")[2]] for name in sizes}
    return Scored(candidate, Signature(candidate, sizes, base.predicted, own), gain, 1.0, visible, absorbed)


def looked(before, after):
    """One look that found the sag, and one that found no more."""
    friction = Candidate("GearFriction", GearFriction(), ("GearFriction.tau_c",))
    heating = Candidate("WindingHeating", WindingHeating(), ("WindingHeating.R_th",))
    saturation = Candidate("TorqueSaturation", TorqueSaturation(), ("TorqueSaturation.i_max",))
    motor = Candidate("WeakMotor", None, ("WeakMotor[0].g",), place="0")
    rows = (
        scored(SAG, before, {"SupplySag.R_b": 2.0}, 400.0, 2 * math.sqrt(fee_of(SAG, 5)), 0.3),
        scored(saturation, before, {"TorqueSaturation.i_max": 0.03}, 9.0, 50.0, 0.2),
        scored(friction, before, {"GearFriction.tau_c": 0.02}, 5.0, 20.0, 0.99),
        scored(motor, before, {"WeakMotor[0].g": 0.02}, 3.0, 1.0, 0.5),
        scored(heating, before, {"WindingHeating.R_th": 100.0}, 0.0, 0.1, 0.5),
    )
    found = Refit(SAG, after, 390.0, 14.0, 300.0)
    chance = Refit(motor, before, 4.0, 14.0, 1.0)
    return Search(before, (Round(rows, (found, chance)), Round(rows[1:], (chance,))), ())


def term(argument, size, gain=200.0):
    size = np.array(size)
    return Term(
        Act(FORCE, "", "N", ()), argument, ("run_1", "run_2"), size, 0.01 * np.eye(len(size)), gain, 3, 12.0,
        None if argument.own else 150.0,
    )  # fmt: skip


def left(gain=200.0):
    """A remainder that a force along the way describes."""
    place = Argument("place", "m", lambda scene, run, part: 0, Polynomial(0.0, 1.0, 2))
    moment = Argument("moment", "s", lambda scene, run, part: 0, Hats((0.0, 2.5, 5.0)), own=True)
    run = Argument("run", "", lambda scene, run, part: 0, Polynomial(0.0, 1.0, 0), own=True)
    channel = ChannelRemainder("path", 2.0, 0.1, 1.0, {"duty": 0.4, "slip": -0.1}, "run_1", 2.0, 0.3)
    terms = (term(place, [1.0, 0.2, 0.1], gain), term(moment, range(6), gain), term(run, [1.0, 2.0], gain))
    return Remainder(terms, (channel, channel._replace(name="drift", rms=1.0)), ("run_1", "run_2"), ("fl", "fr"))


@pytest.fixture(scope="module")
def verdict(made):
    _, before, after = made
    held = held_out(before, after, before.task.noise, 0)
    return Verdict(
        kind="drive-log",
        answer=Answer.NAMED,
        name="small",
        sentence="the log is consistent with SupplySag, which takes 99% of it.",
        model=after.model,
        alike=("SupplySag",),
        effects=tuple(one for one in after.model.all_effects if isinstance(one, SupplySag)),
        named=("SupplySag",),
        share=0.99,
        before=Side(before.model, numbers(before), before.misfit, before),
        after=Side(after.model, numbers(after), after.misfit, after),
        scores=held.channels,
        runs=held.runs,
        extra=DriveExtra(free_runs(before.task.experiment, before.model, after.model), left()),
        findings=(Finding("no low duty", "small", "add one"),),
        experiments=(),
        search=looked(before, after),
        provenance={"command": "rover-pin close-loop small", "seconds": 1.0, "seed": 0, "versions": {"numpy": "2"}},
    )


def poor(verdict):
    """A verdict on data that do not suffice: everything is empty."""
    empty = dict.fromkeys(("alike", "effects", "named", "scores", "experiments"), ())
    none = dict.fromkeys(("before", "after", "extra", "search"))
    return dataclasses.replace(verdict, answer=Answer.CANNOT_TELL, provenance={}, **empty, **none)


def answered(verdict, answer):
    search = verdict.search
    none = Search(search.base, (Round(search.rounds[0].scored, search.rounds[1].refits),), ())
    return {
        Answer.NAMED: verdict,
        Answer.SET: dataclasses.replace(verdict, answer=answer, alike=("SupplySag", "PeakStress")),
        Answer.NONE_NEEDED: dataclasses.replace(
            verdict,
            answer=answer,
            effects=(),
            named=(),
            alike=(),
            after=verdict.before,
            search=none,
            model=search.base.model,
        ),
        Answer.NONE_FITS: dataclasses.replace(
            verdict, answer=answer, effects=(), named=(), after=verdict.before, model=search.base.model
        ),
        Answer.CANNOT_TELL: poor(verdict),
    }[answer]


# --- the page --------------------------------------------------------------------------------------------------------

SECTIONS = (
    "The data check", "Where the model is wrong", "Which effect", "Error on runs that were not fitted",
    "Driven freely", "Fitted numbers", "What is left", "What could not be told, and what to drive next",
    "The physics of what was added", "Warnings", "To repeat it",
)  # fmt: skip


def headings(page):
    return re.findall(r"<h2>(.*?)</h2>", page)


def test_the_page_holds_everything_and_needs_nothing_else(made, verdict, tmp_path):
    files = write_drive_report(verdict, made[0], tmp_path)
    page = files[0].read_text(encoding="utf-8")
    assert files[0] == tmp_path / "report.html"
    assert verdict.sentence in page
    assert headings(page) == list(SECTIONS)
    assert "http" not in page
    assert "<link" not in page
    assert "<script" not in page
    assert "href" not in page
    images = re.findall(r'<img src="data:image/png;base64,([^"]*)"', page)
    assert page.count("<img") == len(images) == len(files) - 1
    assert {base64.b64decode(image) for image in images} == {file.read_bytes() for file in files[1:]}
    for said in ("no low duty", "made here", "SupplySag.R_b", "GearFriction", "seed 0", "numpy 2", "ohmic source"):
        assert said in page


@pytest.mark.parametrize("answer", [one for one in Answer if one not in (Answer.LIKE, Answer.INADEQUATE)])
def test_every_answer_has_its_page_and_figures(made, verdict, answer):
    one = answered(verdict, answer)
    page = html(one, made[0], dict.fromkeys(figures(one), "data:,"))
    headline = HEADLINES[answer].format(names="SupplySag", alike="SupplySag / PeakStress")
    assert f"<h1>{headline}</h1>" in page
    assert "What may be claimed" in page
    assert ("<th>after</th>" in page) == (answer in (Answer.NAMED, Answer.SET))
    assert ("draft_effect" in page) == (answer is Answer.NONE_FITS)
    added = "the model with SupplySag" in page
    assert added == (answer in (Answer.NAMED, Answer.SET))
    assert ("nothing was added" in page) == (answer in (Answer.NONE_NEEDED, Answer.NONE_FITS))
    assert "+0%" not in page
    assert ("no run of the menu tells SupplySag from PeakStress" in page) == (answer is Answer.SET)


def test_a_page_of_poor_data_has_nothing_but_the_check(made, verdict):
    assert not figures(poor(verdict))
    assert headings(html(poor(verdict), made[0], {})) == ["The data check", "Warnings"]


def test_without_a_remainder_nothing_is_said_of_it(made, verdict):
    one = dataclasses.replace(verdict, extra=DriveExtra(extra_of(verdict).free))
    assert "terms" not in figures(one)
    assert "What is left" not in headings(html(one, made[0], {}))


def test_a_remainder_that_is_noise_has_no_curves(made, verdict):
    one = dataclasses.replace(verdict, extra=DriveExtra(extra_of(verdict).free, left(gain=13.0)))
    assert "terms" not in figures(one)
    assert "Nothing is left that any term describes" in html(one, made[0], {})


def test_names_are_text_whatever_they_hold(made, verdict, tmp_path):
    log, before, _ = made
    odd = "a_$x^$ <i>b</i>"
    experiment = before.task.experiment
    named = dataclasses.replace(experiment, runs=tuple(dataclasses.replace(run, name=odd) for run in experiment.runs))
    task = dataclasses.replace(before.task, experiment=named)
    search = verdict.search
    base_fit = dataclasses.replace(before, task=task)
    one = dataclasses.replace(
        verdict,
        name="<b>small</b>",
        extra=DriveExtra(tuple(free._replace(run=odd) for free in extra_of(verdict).free), left()),
        search=dataclasses.replace(search, base=base_fit),
    )
    page = write_drive_report(one, log, tmp_path)[0].read_text(encoding="utf-8")
    assert "&lt;b&gt;small&lt;/b&gt;" in page
    assert "&lt;i&gt;b&lt;/i&gt;" in page
    assert "<b>small" not in page
    assert "<i>b" not in page


def test_a_later_candidate_must_gain_a_share_of_what_was_taken_before(verdict):
    """The mark in the figure is the fee that decides: the second look's stands by 1 % of the first gain further out."""
    looks = figures(verdict)["candidates"].axes
    marks = [sorted(line.get_xdata()[0] for line in look.lines if line.get_linestyle() == "-") for look in looks]
    (taken,) = (one.gain for one in verdict.search.found)
    assert marks[1][0] == pytest.approx(marks[0][0] + 0.01 * taken)


def test_profiles_are_drawn_where_there_are_any(made, verdict):
    shape = Profile("SupplySag.R_b", "ohm", (1.8, 2.0, 2.2), (4.0, 0.0, 4.0))
    one = dataclasses.replace(verdict, profiles=(shape,))
    found = figures(one)
    assert "profiles" in found
    assert "profiles" not in figures(verdict)
    assert "Rise of chi2" in html(one, made[0], dict.fromkeys(found, "data:,"))


def test_every_run_left_out_has_its_line(made, verdict):
    """The misfit of all runs is that of their blocks, and falls with the effect; the interval holds the change."""
    _, before, after = made
    assert [one.run for one in verdict.runs] == [run.name for run in before.task.experiment.runs]
    was, now = together(verdict.runs)
    count = sum(one.blocks for one in verdict.runs)
    assert count == before.task.noise.count
    assert was * count == pytest.approx(loss_of(before, refitted_left_out(before)))
    assert now * count == pytest.approx(loss_of(after, refitted_left_out(after)))
    assert now < was
    for one in verdict.runs:
        assert one.low <= one.after / one.before - 1 <= one.high
    page = html(verdict, made[0], dict.fromkeys(figures(verdict), "data:,"))
    assert all(f"<td>{one.run}</td>" in page for one in verdict.runs)


# --- what it says ----------------------------------------------------------------------------------------------------


def test_adding_what_was_hidden_lowers_every_number_at_the_top(verdict):
    for row in summary_rows(verdict, sides_of(verdict))[:2]:
        before, after = (float(cell) for cell in row.cells[1:])
        assert after < 0.5 * before


def test_numbers_that_drifted_or_lie_at_a_bound_stand_first(made, verdict):
    sides = sides_of(verdict)
    moved = tuple(one._replace(drift=4.0) if one.name == "soil.phi" else one for one in verdict.after.numbers)
    rows = number_rows(dataclasses.replace(verdict, after=verdict.after._replace(numbers=moved)), sides)
    assert [row.cells[0] for row in rows] == ["soil.phi", "SupplySag.R_b", "WeakMotor[0].g"]
    assert rows[0].cells[3:] == ("30 deg \u00b1 2 deg", "+4.00", "+4.0 SD from what was declared")
    assert rows[1].cells[1] == "not in the model"
    u = sides.after.u.copy()
    u[-1] = sides.after.parameters[-1].bounds[1]
    at_end = Sides(sides.before, dataclasses.replace(sides.after, u=u))
    assert "at its bound" in number_rows(verdict, at_end)[0].cells[-1]
    assert any("lies at its bound" in said for said in cautions(verdict, at_end))


@pytest.mark.parametrize(
    ("gain", "held_out", "said"),
    [
        (50.0, 5.0, "accepted"),
        (10.0, 5.0, "gains no more than chance"),
        (50.0, -5.0, "no better on runs left out"),
        (-50.0, -5.0, "its refit did not settle"),
    ],
)
def test_what_a_refit_is_worth(made, gain, held_out, said):
    one = Refit(SAG, made[2], gain, 14.0, held_out)
    (row,) = refit_rows([one], [])
    assert row.cells[-1] == said
    assert row.cells[5].startswith("R_b = 2 ohm [")


def test_sizes_that_would_show(verdict):
    found = {one.name: one for one in sensitivities(verdict.search)}
    assert found["SupplySag"].told
    assert found["SupplySag"].size == "R_b = 1 ohm"
    assert found["SupplySag"].usual == "0.5"
    assert found["TorqueSaturation"].size == "i_max near 0.03 A"
    assert found["TorqueSaturation"].usual == ""
    assert found["GearFriction"].why == "the uncertain numbers imitate 99.0% of what it does"
    assert found["WeakMotor"].why.startswith("would show from 4.6 times")
    assert found["WeakMotor"].size.startswith("g off")
    assert found["WindingHeating"].why == "moves nothing that was measured here"
    assert found["WindingHeating"].size.endswith("beyond its bounds")


# --- what is drawn ---------------------------------------------------------------------------------------------------


def test_the_run_that_is_missed_most_comes_first(made):
    _, before, _ = made
    for run in (0, 1):
        off = before.predicted.copy()
        off[run] += 50 * before.task.noise.sd[:, None]
        assert worst_runs(dataclasses.replace(before, predicted=off))[0] == run


def test_the_channels_that_changed_most_are_of_different_kinds(made):
    _, before, after = made
    names = [before.task.experiment.channels[row] for row in telling_channels(Sides(before, after))]
    assert "battery_V" in names
    assert sum(name.startswith("wheel_rate_") for name in names) <= 2
    assert len(names) == 5


def test_free_runs_are_as_far_off_as_the_table_says(made, verdict):
    """But for the tracker's noise, which half-second means leave out."""
    _, before, _ = made
    for one, off in zip(extra_of(verdict).free, strayed(before.task.experiment, before.model), strict=True):
        rms = float(np.sqrt(np.nanmean(off**2)))
        assert 0.5 * one.before < rms < one.before
