"""Changes of fits, their numbers and noise that change no result: file, change as it is told, and the reason."""

FIRST = "where a refit begins: it descends to the same"
MORE = "one more try before it gives up, or ends where it was as good"
LEAVES = "what would leave its bound is taken out below, step by step"
DRAWN = "where a profile is drawn: the curve is the same"

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
}
