"""Changes that no test can notice, because they change no result: file, change as it is told, and the reason."""

EQUIVALENT: dict[tuple[str, str], str] = {
    (
        "rover_pin/soil/compaction.py",
        "return 0.0: 0.0 -> 0.1",
    ): "the share in use of a strength of 0",
    (
        "rover_pin/soil/sinkage.py",
        "STEPS = 3: 3 -> 4",
    ): "a step more than is needed",
    (
        "rover_pin/estimation/noise.py",
        "steps = _innovations(np.where(self.good, residual, 0.0), self.good, self.rho): 0.0 -> 0.1",
    ): "what is not compared is read by no row: a block after a gap begins anew",
    (
        "rover_pin/discrepancy/screen.py",
        "return sorted(best.values(), key=lambda row: -row.gain if row.told else 0.0): 0.0 -> 0.1",
    ): "moves what cannot be told behind what gains nothing: neither is refitted",
    (
        "rover_pin/loop/rig.py",
        "added = () if best is None else after.model.effects[len(base.model.effects) :]: () -> "
        "(after.model.effects[len(base.model.effects) :])",
    ): "where nothing was added the model after is the base model",
    (
        "rover_pin/experiments/wheel_rig/calibrate.py",
        "seed: int = 0: 0 -> 1",
    ): "any seed will do",
}
