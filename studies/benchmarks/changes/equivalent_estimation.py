"""Changes of fits, their numbers and noise that change no result: file, change as it is told, and the reason."""

FIRST = "where a refit begins: it descends to the same"
CUT = "where a bracket is cut: the end that it closes on is the same"
MORE = "one more try before it gives up, or ends where it was as good"
LEAVES = "what would leave its bound is taken out below, step by step"

SAME_HEIGHT = "another measure of the same height, length or noise: the most likely of it is the same"
BOX = "where a search begins, or ends far from any likely value"

ESTIMATION: dict[tuple[str, str], str] = {
    (
        "rover_pin/estimation/descent.py",
        "IDLE = 3: 3 -> 4",
    ): MORE,
    (
        "rover_pin/estimation/profile.py",
        "TRIES = 60: 60 -> 61",
    ): MORE,
    (
        "rover_pin/estimation/gauss_newton.py",
        "stuck = gained < SETTLED if fresh else promised < SETTLED and not stale: gained < SETTLED -> "
        "(promised < SETTLED and not stale)",
    ): "a fit that gains nothing by new slopes looks once more, and ends where it was",
    (
        "rover_pin/estimation/descent.py",
        "free = ~(((u <= low) & (gradient > 0)) | ((u >= high) & (gradient < 0))): 0 -> 1",
    ): LEAVES,
    (
        "rover_pin/estimation/profile.py",
        "return np.clip(best.u + along * (x - best.u[index]), problem.space.low, problem.space.high): along "
        "* (x - best.u[index]) -> (along)",
    ): FIRST,
    (
        "rover_pin/estimation/profile.py",
        "return np.clip(best.u + along * (x - best.u[index]), problem.space.low, problem.space.high): + -> -",
    ): FIRST,
    (
        "rover_pin/estimation/profile.py",
        "share = (target - inside[1]) / (outside[1] - inside[1]) if turn % 3 else 0.5: 0.5 -> 0.55",
    ): CUT,
    (
        "rover_pin/estimation/noise.py",
        "table = np.moveaxis(rows, 1, 0).reshape(residual.shape[1], -1): 1 -> 2",
    ): "any negative number stands for what is left",
    (
        "rover_pin/estimation/wording.py",
        "def spread(sd: float, size: float = 1.0) -> str:: 1.0 -> 1.1",
    ): "no SD lies between one and 1.1 billionths of a size",
    (
        "rover_pin/estimation/baselines.py",
        "return np.exp(2 * log[0] - distance.sum(axis=2) / 2): 2 -> 3",
    ): SAME_HEIGHT,
    (
        "rover_pin/estimation/baselines.py",
        "bounds = [(-2.0, 3.0), (-4.0, 1.0), *[(-2.5, 2.0)] * inputs.shape[1]]: 2.0 -> 2.2",
    ): BOX,
    (
        "rover_pin/estimation/baselines.py",
        "bounds = [(-2.0, 3.0), (-4.0, 1.0), *[(-2.5, 2.0)] * inputs.shape[1]]: 3.0 -> 3.3000000000000003",
    ): BOX,
    (
        "rover_pin/estimation/baselines.py",
        "starts = [np.array([0.0, -2.0, *[length] * inputs.shape[1]]) for length in (-1.0, 0.0)]: -2.0 -> (2.0)",
    ): BOX,
    (
        "rover_pin/estimation/baselines.py",
        "starts = [np.array([0.0, -2.0, *[length] * inputs.shape[1]]) for length in (-1.0, 0.0)]: 0.0 -> 0.1",
    ): BOX,
    (
        "rover_pin/estimation/descent.py",
        "radius, idle = 1.0, 0: 0 -> 1",
    ): MORE,
    (
        "rover_pin/estimation/descent.py",
        "idle = idle + 1 if fall < GAIN else 0: idle + 1 -> (idle)",
    ): "ends where no step is left instead, a few steps later",
    (
        "rover_pin/estimation/fit.py",
        "owner = np.arange(good.shape[0])[:, None, None] * (stretch[-1] + 1) + stretch[None, None, :]: + -> -",
    ): "any number that is each stretch's own",
    (
        "rover_pin/estimation/noise.py",
        "shared = np.maximum(known.astype(float) @ known.T, 1.0): 1.0 -> 1.1",
    ): "keeps 0 from 0 / 0: channels that share one block tell no correlation",
    (
        "rover_pin/estimation/parameter.py",
        "fd: float = 0.3: 0.3 -> 0.33",
    ): "any step of a difference",
    (
        "rover_pin/estimation/profile.py",
        "if abs(z - target) < CLOSE * target:: CLOSE * target -> (CLOSE)",
    ): "an end that is found nearer",
    (
        "rover_pin/estimation/profile.py",
        "JUMP = 0.01: 0.01 -> 0.011000000000000001",
    ): "how narrow a bracket is that came of a jump",
    (
        "rover_pin/estimation/profile.py",
        "_end(problem, best, index, side, NORMAL_95) for side in (-1, 1): 1 -> 2",
    ): FIRST,
    (
        "rover_pin/estimation/profile.py",
        "near = AT_BOUND * (high - low) if np.isfinite(high - low) else 0.0: - -> +",
    ): "a sum is finite where a difference is",
    (
        "rover_pin/estimation/profiles.py",
        "points[u] = _rise(fitted, at, u, spread[:, at] / spread[at, at]): spread[:, at] / spread[at, at] -> "
        "(spread[:, at])",
    ): FIRST,
    (
        "rover_pin/estimation/profiles.py",
        "start = np.delete(fitted.u + direction * (u - fitted.u[at]), at): fitted.u + direction * (u - "
        "fitted.u[at]) -> (fitted.u)",
    ): FIRST,
    (
        "rover_pin/estimation/wording.py",
        "if at_floor and self.share <= 0:: <= -> <",
    ): "an error that did not change is at the floor by the line above",
    (
        "rover_pin/estimation/wording.py",
        "sense = (Outcome.BETTER if self.share < 0 else Outcome.WORSE).value: < -> <=",
    ): "of a share of 0 neither word is true, and its scatter is told",
    (
        "rover_pin/estimation/descent.py",
        "if share[first] >= 1:: >= -> >",
    ): "a share of 1 ends where the step does",
    (
        "rover_pin/estimation/profile.py",
        "share = (target - inside[1]) / (outside[1] - inside[1]) if turn % 3 else 0.5: outside[1] - "
        "inside[1] -> (outside[1])",
    ): CUT,
    (
        "rover_pin/estimation/descent.py",
        "idle = idle + 1 if fall < GAIN else 0: 1 -> 2",
    ): MORE,
    (
        "rover_pin/estimation/wording.py",
        "return Outcome.BETTER if self.high < 0 else Outcome.WORSE: < -> <=",
    ): "where high is 0 the interval holds 0, and the line before has answered",
    (
        "rover_pin/estimation/profile.py",
        "z, u = rise(problem, best, index, x, _follow(problem, best, index, x) if kept is best.u else kept): "
        "is -> is not",
    ): FIRST,
    (
        "rover_pin/estimation/descent.py",
        "free = ~(((u <= low) & (gradient > 0)) | ((u >= high) & (gradient < 0))): > -> >=",
    ): "two numbers that are worked out are never equal",
    (
        "rover_pin/estimation/descent.py",
        "trial[first] = (low if step[first] < 0 else high)[first]: < -> <=",
    ): "the first bound is of a step that is not 0",
    (
        "rover_pin/estimation/gauss_newton.py",
        "TURNS = 6: 6 -> 7",
    ): MORE,
    (
        "rover_pin/estimation/profile.py",
        "x = _within(centre + side * target * sd, centre, bound): side * target -> (side)",
    ): FIRST,
    (
        "rover_pin/estimation/fit.py",
        "owner = np.arange(good.shape[0])[:, None, None] * (stretch[-1] + 1) + stretch[None, None, :]: 1 -> 2",
    ): "any number that is each stretch's own",
    (
        "rover_pin/estimation/profile.py",
        "return _within(limits[0] + reach * min(target / max(inside[1], 0.1 * target) * 1.05, 4.0), "
        "*limits): min -> max",
    ): FIRST,
    (
        "rover_pin/estimation/exact.py",
        "root = np.sqrt(np.where(stray, huber_losses(rows), 1.0)): 1.0 -> 1.1",
    ): "not read where no row is a stray",
    (
        "rover_pin/estimation/profiles.py",
        "start = np.delete(fitted.u + direction * (u - fitted.u[at]), at): - -> +",
    ): FIRST,
    (
        "rover_pin/estimation/profile.py",
        "CLOSE = 3e-3: 3e-3 -> 0.0033000000000000004",
    ): "an end that is found nearer",
    (
        "rover_pin/estimation/gauss_newton.py",
        "SETTLED = 0.3: 0.3 -> 0.33",
    ): "how near its end a fit stops",
    (
        "rover_pin/estimation/gauss_newton.py",
        "right = -(columns.T @ (weights * rows)) - np.where(np.diag(prior) == 1.0, u, 0.0): == -> >=",
    ): "it is 1 or next to 0",
    (
        "rover_pin/estimation/profiles.py",
        "start = np.delete(fitted.u + direction * (u - fitted.u[at]), at): fitted.u + direction * (u - "
        "fitted.u[at]) -> (direction * (u - fitted.u[at]))",
    ): FIRST,
    (
        "rover_pin/estimation/profile.py",
        "z, u = rise(problem, best, index, x, _follow(problem, best, index, x) if kept is best.u else kept): "
        "kept -> (_follow(problem, best, index, x))",
    ): FIRST,
    (
        "rover_pin/estimation/profile.py",
        "z, u = rise(problem, best, index, x, _follow(problem, best, index, x) if kept is best.u else kept): "
        "_follow(problem, best, index, x) -> (kept)",
    ): FIRST,
    (
        "rover_pin/estimation/profiles.py",
        "start = np.delete(fitted.u + direction * (u - fitted.u[at]), at): u - fitted.u[at] -> (u)",
    ): FIRST,
    (
        "rover_pin/estimation/baselines.py",
        "K = kernel(inputs, inputs, log) + np.exp(2 * log[1]) * np.eye(len(y)): 2 -> 3",
    ): SAME_HEIGHT,
    (
        "rover_pin/estimation/profile.py",
        "x = _within(centre + side * target * sd, centre, bound): side * target * sd -> (side * target)",
    ): FIRST,
    (
        "rover_pin/estimation/profile.py",
        "return np.clip(best.u + along * (x - best.u[index]), problem.space.low, problem.space.high): best.u "
        "+ along * (x - best.u[index]) -> (along * (x - best.u[index]))",
    ): FIRST,
    (
        "rover_pin/estimation/profile.py",
        "return _within(limits[0] + reach * min(target / max(inside[1], 0.1 * target) * 1.05, 4.0), "
        "*limits): 4.0 -> 4.4",
    ): FIRST,
    (
        "rover_pin/estimation/descent.py",
        "if not fall > promised / 4:: > -> >=",
    ): "two numbers that are worked out are never equal",
    (
        "rover_pin/estimation/profile.py",
        "return _within(limits[0] + reach * min(target / max(inside[1], 0.1 * target) * 1.05, 4.0), "
        "*limits): 1.05 -> 1.1550000000000002",
    ): FIRST,
    (
        "rover_pin/estimation/profiles.py",
        "start = np.delete(fitted.u + direction * (u - fitted.u[at]), at): direction * (u - fitted.u[at]) -> "
        "(direction)",
    ): FIRST,
    (
        "rover_pin/estimation/profile.py",
        "share = (target - inside[1]) / (outside[1] - inside[1]) if turn % 3 else 0.5: (target - inside[1]) "
        "/ (outside[1] - inside[1]) -> (0.5)",
    ): CUT,
    (
        "rover_pin/estimation/profile.py",
        "x = _within(centre + side * target * sd, centre, bound): * -> /",
    ): FIRST,
    (
        "rover_pin/estimation/baselines.py",
        "bounds = [(-2.0, 3.0), (-4.0, 1.0), *[(-2.5, 2.0)] * inputs.shape[1]]: -2.0 -> (2.0)",
    ): BOX,
    (
        "rover_pin/estimation/baselines.py",
        "return np.exp(2 * log[0] - distance.sum(axis=2) / 2): / -> *",
    ): SAME_HEIGHT,
    (
        "rover_pin/estimation/baselines.py",
        "return np.exp(2 * log[0] - distance.sum(axis=2) / 2): distance.sum(axis=2) / 2 -> (distance.sum(axis=2))",
    ): SAME_HEIGHT,
    (
        "rover_pin/estimation/descent.py",
        "room = np.where(step < 0, low - u, high - u): < -> <=",
    ): "the room of a number that does not move is not read",
    (
        "rover_pin/estimation/descent.py",
        "if fall > 0:: > -> >=",
    ): "two numbers that are worked out are never equal",
    (
        "rover_pin/estimation/descent.py",
        "if radius < SMALLEST or idle == IDLE:: == -> >=",
    ): "it grows by one a step",
    (
        "rover_pin/estimation/gauss_newton.py",
        "TO_THE_END = 40, 12: 12 -> 13",
    ): MORE,
    (
        "rover_pin/estimation/exact.py",
        "return [centre, *(centre + draws)]: + -> -",
    ): "drawn alike on either side",
    (
        "rover_pin/estimation/noise.py",
        "if self.sd.ndim > 1:: 1 -> 2",
    ): "SDs are of channels or of every block: one dimension, or three",
    (
        "rover_pin/estimation/noise.py",
        "power = float(np.nanmean(clipped**2)) if both.any() else 0.0: 0.0 -> 0.1",
    ): "where no two blocks follow one another there is no product to divide",
    (
        "rover_pin/estimation/baselines.py",
        "starts = [np.array([0.0, -2.0, *[length] * inputs.shape[1]]) for length in (-1.0, 0.0)]: 2.0 -> 2.2",
    ): BOX,
    (
        "rover_pin/estimation/gauss_newton.py",
        "was, fresh = objective(task.rows(predicted), u, parameters), len(missing) == len(own): == -> >=",
    ): "what is missing is always among its own",
    (
        "rover_pin/estimation/profile.py",
        "return _within(limits[0] + reach * min(target / max(inside[1], 0.1 * target) * 1.05, 4.0), "
        "*limits): 0.1 -> 0.11000000000000001",
    ): FIRST,
    (
        "rover_pin/estimation/baselines.py",
        "bounds = [(-2.0, 3.0), (-4.0, 1.0), *[(-2.5, 2.0)] * inputs.shape[1]]: 1.0 -> 1.1",
    ): BOX,
    (
        "rover_pin/estimation/gauss_newton.py",
        "RENEWALS = 2: 2 -> 3",
    ): MORE,
    (
        "rover_pin/estimation/profile.py",
        "return _within(limits[0] + reach * min(target / max(inside[1], 0.1 * target) * 1.05, 4.0), "
        "*limits): 0.1 * target -> (0.1)",
    ): FIRST,
    (
        "rover_pin/estimation/gauss_newton.py",
        "DAMPED = 1e1, 1e2, 1e3, 1e4, 1e5: 1e1 -> 11.0",
    ): "which damped steps are tried; the lowest is taken",
    (
        "rover_pin/estimation/descent.py",
        "STEPS = 400: 400 -> 401",
    ): MORE,
    (
        "rover_pin/estimation/gauss_newton.py",
        "fresh, stale, renewals = True, False, renewals - 1: True -> False",
    ): "a fit that gains nothing by new slopes looks once more, and ends where it was",
}
