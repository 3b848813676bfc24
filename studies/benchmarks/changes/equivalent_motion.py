"""Changes of the rigid rover and of its step that change no result: file, change as it is told, and the reason."""

STEP = "rover_pin/motion/native/"

MOTION: dict[tuple[str, str], str] = {
    (
        f"{STEP}step.c",
        "double total = 0.0;: 0.0 -> 0.1",
    ): "any sum is finite that begins with a finite number",
    (
        f"{STEP}springs.c",
        "if (push * over > 0.0) continue; /* leaving faster than the damper: a stop does not pull */: * -> /",
    ): "a quotient has the sign of the product",
    (
        f"{STEP}assembly.c",
        "double stiffness[4] = {0.0, 0.0, 0.0, 0.0};: 0.0 -> 0.1",
    ): "read only while a rover is set down, when it has been found",
    (
        f"{STEP}law.c",
        "if (spot->forwards > 0.0 && spot->forwards < 1.0) ask(s, index, 1, deeper);: && -> ||",
    ): "asks once more, and does not read the answer",
    (
        "rover_pin/body/symmetry.py",
        "image = axes[a] * [-1.0, 1.0, -1.0]: 1.0 -> 1.1",
    ): "only its sign along the partner's axis counts",
    (
        "rover_pin/body/driven_loads.py",
        "angle = np.arctan2(sine, 0.5 * (np.trace(turned, axis1=-2, axis2=-1) - 1.0)): -2 -> (2)",
    ): "of four axes the last but one is number 2",
    (
        "rover_pin/body/driven_loads.py",
        "return np.asarray(np.arcsin(np.clip(self.forward[:, 2], -1.0, 1.0))): 1.0 -> 1.1",
    ): "keeps round-off from an arcsine beyond 1: either bound does on unit vectors",
    (
        "rover_pin/motion/pace.py",
        "off = 0.0 if status else self.stepper.misjudged: 0.0 -> (self.stepper.misjudged)",
    ): "a step that failed is taken again or ends the drive: what it misjudged is not read",
    (
        "rover_pin/motion/resolution.py",
        "PRESSED, FIRMEST = 1e-3, 100.0: 1e-3 -> 0.0011",
    ): "a difference over a little more depth: the same slope",
}
