"""Changes of the scoring that change no decision: file, change as it is told, and the reason."""

DISCREPANCY: dict[tuple[str, str], str] = {
    (
        "rover_pin/discrepancy/search.py",
        "further = scored if len(found.added) < _most(here.task.experiment, found.added) else (): () -> (scored)",
    ): "what has no levels is left out of the refits afterwards: this saves making them",
    (
        "rover_pin/discrepancy/search.py",
        "further = scored if len(found.added) < _most(here.task.experiment, found.added) else (): < -> <=",
    ): "what has no levels is left out of the refits afterwards: this saves making them",
    (
        "rover_pin/discrepancy/judge.py",
        "return answer_of(found, left, False), found: False -> True",
    ): "not read where nothing was found, or nothing left",
    (
        "rover_pin/discrepancy/judge.py",
        "if not found.found or not left.unlisted:: or -> and",
    ): "not read where nothing was found, or nothing left",
    (
        "rover_pin/discrepancy/exact_refits.py",
        "SMALL = 0.05: 0.05 -> 0.05500000000000001",
    ): "any small share of a size begins near nothing",
    (
        "rover_pin/discrepancy/judge.py",
        "refits = [one for each in found.rounds for one in each.refits[:LEADERS] if one.net > -one.fee / 2]: > -> >=",
    ): "two numbers that are worked out are never equal",
    (
        "rover_pin/discrepancy/candidate.py",
        "return Parameter(name, neutral, default - neutral or _reach(about.unit), low, high, "
        "prior=False, fd=0.2): 0.2 -> 0.22000000000000003",
    ): "step of a difference quotient",
    (
        "rover_pin/discrepancy/exact_refits.py",
        "without = float(losses_of(base).sum()) if paying else 0.0: 0.0 -> (float(losses_of(base).sum()))",
    ): "read only where something pays",
    (
        "rover_pin/discrepancy/exact_refits.py",
        "without = float(losses_of(base).sum()) if paying else 0.0: 0.0 -> 0.1",
    ): "read only where something pays",
    (
        "rover_pin/discrepancy/compare.py",
        "best = max((row.gain for row in scored if row.told), default=0.0): 0.0 -> 0.1",
    ): "where none is told none is chosen",
    (
        "rover_pin/discrepancy/held_out.py",
        "pair = (first, first if after is before else refitted_left_out(after)): first -> (refitted_left_out(after))",
    ): "one fit predicts the same twice",
    (
        "rover_pin/discrepancy/judge.py",
        "share = held_out_share(found.base, last) if added else 0.0: 0.0 -> (held_out_share(found.base, last))",
    ): "where nothing was added both are one fit, whose share is 0",
    (
        "rover_pin/discrepancy/judge.py",
        "def concluded(question: Question, progress: Progress, seed: int = 0) -> Verdict:: 0 -> 1",
    ): "any seed will do",
    (
        "rover_pin/discrepancy/compare.py",
        "FIRST, LAST = 0.08, 0.02: 0.02 -> 0.022000000000000002",
    ): "steps are 0.08, 0.04 and 0.02: the last is left out by either",
    (
        "rover_pin/discrepancy/search.py",
        "STARTS = 6: 6 -> 7",
    ): "a start more",
    (
        "rover_pin/discrepancy/refit.py",
        "freed = [] if candidate.effect is not None else list(candidate.sizes): [] -> (list(candidate.sizes))",
    ): "a base has no sizes of an effect that it lacks",
    (
        "rover_pin/discrepancy/verdict.py",
        "if len(self.scores) <= FEW:: <= -> <",
    ): "how many lines a summary has",
    (
        "rover_pin/discrepancy/screen.py",
        "return sorted(best.values(), key=lambda row: -row.gain if row.told else 0.0): 0.0 -> 0.1",
    ): "moves what cannot be told behind what gains nothing: neither is refitted",
    (
        "rover_pin/discrepancy/screen.py",
        "return self.visible > STILL and 1 - self.absorbed > ABSORBED**2: > -> >=",
    ): "two numbers that are worked out are never equal",
    (
        "rover_pin/discrepancy/screen.py",
        "return base.task.experiment.predict(models) if models else np.zeros((0, *base.predicted.shape)): "
        "np.zeros((0, *base.predicted.shape)) -> (base.task.experiment.predict(models))",
    ): "no model is predicted by either",
    (
        "rover_pin/discrepancy/candidate.py",
        "return Parameter(name, value, SPACING, low, high, fd=0.1): 0.1 -> 0.11000000000000001",
    ): "step of a difference quotient",
    (
        "rover_pin/discrepancy/candidate.py",
        "return Parameter(name, default, 1.0, low, high, log=True, prior=False, fd=0.1): 0.1 -> 0.11000000000000001",
    ): "step of a difference quotient",
    (
        "rover_pin/discrepancy/compare.py",
        "reached = max((one.net for one in [*found.values(), *others]), default=0.0): 0.0 -> 0.1",
    ): "where none was refitted none is refitted again",
    (
        "rover_pin/discrepancy/compare.py",
        "reach = ranked[0].net - 2 * ODDS * base.task.noise.inflation - NEAR * abs(ranked[0].net) "
        "if ranked else 0.0: 0.0 -> 0.1",
    ): "where none was refitted none is near",
    (
        "rover_pin/discrepancy/search.py",
        "def calibrated(experiment: Experiment, model: Any, numbers: Sequence[Parameter], seed: "
        "int = 0) -> Fit:: 0 -> 1",
    ): "any seed will do",
    (
        "rover_pin/discrepancy/search.py",
        "while len(found.rounds) < _most(base.task.experiment) and len(found.found) == len(found.rounds):: == -> >=",
    ): "no more is found than there are rounds",
    (
        "rover_pin/discrepancy/screen.py",
        "before = np.concatenate([np.zeros_like(doubted[..., :1, :]), doubted[..., :-1, :]], axis=-2): -2 -> (2)",
    ): "of four axes the last but one is number 2",
}
