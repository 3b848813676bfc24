"""Changes of fits, their numbers and noise that change no result: file, change as it is told, and the reason."""

FIRST = "where a refit begins: it descends to the same"
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
        "rover_pin/estimation/fit.py",
        "stuck = gained < SETTLED if fresh else promised < SETTLED and not stale: gained < SETTLED -> "
        "(promised < SETTLED and not stale)",
    ): "a fit that gains nothing by new slopes looks once more, and ends where it was",
    (
        "rover_pin/estimation/descent.py",
        "free = ~(((u <= low) & (gradient > 0)) | ((u >= high) & (gradient < 0))): 0 -> 1",
    ): LEAVES,
    (
        "rover_pin/estimation/profile.py",
        "return np.clip(best.u + along * (x - best.u[index]), problem.space.low, problem.space.high): "
        "along * (x - best.u[index]) -> (along)",
    ): FIRST,
    (
        "rover_pin/estimation/profile.py",
        "return np.clip(best.u + along * (x - best.u[index]), problem.space.low, problem.space.high): + -> -",
    ): FIRST,
    (
        "rover_pin/estimation/profile.py",
        "share = (target - inside[1]) / (outside[1] - inside[1]) if turn % 3 else 0.5: 0.5 -> 0.55",
    ): "where a bracket is cut: the end that it closes on is the same",
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
        "points[u] = _rise(fitted, at, u, spread[:, at] / spread[at, at]): "
        "spread[:, at] / spread[at, at] -> (spread[:, at])",
    ): FIRST,
    (
        "rover_pin/estimation/profiles.py",
        "start = np.delete(fitted.u + direction * (u - fitted.u[at]), at): "
        "fitted.u + direction * (u - fitted.u[at]) -> (fitted.u)",
    ): FIRST,
    (
        "rover_pin/estimation/wording.py",
        "if at_floor and self.share <= 0:: <= -> <",
    ): "an error that did not change is at the floor by the line above",
    (
        "rover_pin/estimation/wording.py",
        "sense = (Outcome.BETTER if self.share < 0 else Outcome.WORSE).value: < -> <=",
    ): "of a share of 0 neither word is true, and its scatter is told",
}
