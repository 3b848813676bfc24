"""Changes that no test can notice, because they change no result: file, change as it is told, and the reason."""

EQUIVALENT: dict[tuple[str, str], str] = {
    (
        "rover_pin/soil/compaction.py",
        "exit_depth = ca.fmax(2 * ca.sin(theta_1 - length / 2) * ca.sin(length / 2), 1e-300): "
        "1e-300 -> 1.1000000000000002e-300",
    ): "the least positive depth keeps a power finite; either is nothing",
    ("rover_pin/soil/compaction.py", "return 0.0: 0.0 -> 0.1"): "the share in use of a strength of 0",
    ("rover_pin/soil/sinkage.py", "STEPS = 3: 3 -> 4"): "a step more than is needed",
    (
        "rover_pin/soil/sinkage.py",
        "UNSOLVED = 1e-6: 1e-6 -> 1.1e-06",
    ): "a tolerance between what steps leave, 1e-9, and an error that matters",
    (
        "rover_pin/effects/side_shear.py",
        "grip = ca.if_else(j_y < 0.0, ca.expm1(j_y / soil.k), -ca.expm1(-j_y / soil.k)): < -> <=",
    ): "both branches are 0 at 0",
    (
        "rover_pin/effects/grousers.py",
        "braking = ca.if_else(faster < 1.0, S + (q - 1.0) * (1.0 + S), 1.0 - 1.0 / ca.fmax(faster, 1.0)): < -> <=",
    ): "both branches are 0 where the lugs run as fast as the travel",
    (
        "rover_pin/estimation/noise.py",
        "steps = _innovations(np.where(self.good, residual, 0.0), self.good, self.rho): 0.0 -> 0.1",
    ): "what is not compared is read by no row: a block after a gap begins anew",
    (
        "rover_pin/discrepancy/screen.py",
        'if candidate.effect is not None and candidate.effect.places and len(parameters) > 1 and "@" in '
        "candidate.name:: > -> >=",
    ): "one size alone is tried at its default either way",
    (
        "rover_pin/discrepancy/screen.py",
        "return sorted(best.values(), key=lambda row: -row.gain if row.told else 0.0): 0.0 -> 0.1",
    ): "moves what cannot be told behind what gains nothing: neither is refitted",
    (
        "rover_pin/discrepancy/screen.py",
        "return np.array(rows) if rows else np.zeros((0, *base.predicted.shape)): "
        "np.zeros((0, *base.predicted.shape)) -> (np.array(rows))",
    ): "nothing is read of an empty array, whatever its shape",
    (
        "rover_pin/loop/rig.py",
        "added = () if best is None else after.model.effects[len(base.model.effects) :]: "
        "() -> (after.model.effects[len(base.model.effects) :])",
    ): "where nothing was added the model after is the base model",
    ("rover_pin/experiments/wheel_rig/calibrate.py", "seed: int = 0: 0 -> 1"): "any seed will do",
}
