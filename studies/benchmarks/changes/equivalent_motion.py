"""Changes of the rigid rover and of its step that change no result: file, change as it is told, and the reason."""

BELOW = "below the diagonal stands what stands above it; sides meet at the base alone, which comes first in both"
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
        f"{STEP}stiffness.c",
        "static int slides(integer dof) { return dof == 0 || dof == 1 || dof == 5; }: || -> &&",
    ): "how many steps setting down takes: the base is put back along the ground after each",
    (
        f"{STEP}solve.c",
        "if (factor == 0.0) continue;: 0.0 -> 0.1",
    ): "leaves out work that changes nothing",
    (
        f"{STEP}law.c",
        "integer k = first + lane < s->n_questions ? first + lane : first;: + -> -",
    ): "what is over repeats the first or asks what was asked before: nobody reads the answer",
    (
        f"{STEP}law.c",
        "if (spot->forwards > 0.0 && spot->forwards < 1.0) ask(s, index, 1, deeper);: && -> ||",
    ): "asks once more, and does not read the answer",
    (
        "rover_pin/body/symmetry.py",
        "image = axes[a] * [-1.0, 1.0, -1.0]: 1.0 -> 1.1",
    ): "only its sign along the partner's axis counts",
    (
        "rover_pin/body/symmetry.py",
        "image = axes[a] * [-1.0, 1.0, -1.0]: * -> /",
    ): "a quotient by 1 or -1 is the product",
    (
        "rover_pin/body/symmetry.py",
        "sign[a] = sign[b] = 1.0 if image @ axes[b] > 0.0 else -1.0: 0.0 -> 0.1",
    ): "an axis and its partner's image lie along one line: 1 or -1",
    (
        "rover_pin/body/symmetry.py",
        "mass = upper + np.triu(upper, 1).T: + -> -",
    ): BELOW,
    (
        "rover_pin/body/symmetry.py",
        "mass = upper + np.triu(upper, 1).T: upper + np.triu(upper, 1).T -> (upper)",
    ): BELOW,
    (
        "rover_pin/body/rover.py",
        "if not (abs(rise_x) < math.pi / 2 and abs(rise_y) < math.pi / 2 and x * x + y * y < 1.0):: < -> <=",
    ): "at a right angle the sum of squares is 1, which is refused too",
    (
        "rover_pin/body/statics.py",
        "unknown = np.block([[held, -np.diag(springs)], [still, held.T]]): -np.diag(springs) -> (np.diag(springs))",
    ): "the angles come out with the other sign, and nobody reads them: the loads are the same",
    (
        "rover_pin/body/rover.py",
        "path, trust = shipped(str(rover)), Trust(everything=True): True -> False",
    ): "what the package ships names no code and no file that lies elsewhere",
    (
        "rover_pin/body/driven_loads.py",
        "SHARES = 4: 4 -> 5",
    ): "a round more",
    (
        "rover_pin/body/driven_loads.py",
        "rows = [i for i, wheel in enumerate(rover.wheels) if wheel.side == side]: == -> !=",
    ): "of two sides each is the other's other: both are taken",
    (
        "rover_pin/body/driven_loads.py",
        "return np.asarray(mean / max(float(np.linalg.norm(mean)), math.ulp(1.0))): 1.0 -> 1.1",
    ): "keeps 0 from 0 / 0: any tiny number does",
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
    (
        "rover_pin/motion/resolution.py",
        "state.q[2] -= PRESSED * float(h[touching].min()): min -> max",
    ): "a difference over a little more depth: the same slope",
    (
        "rover_pin/motion/replay.py",
        "if good < len(loop.rows):: < -> <=",
    ): "behind the last row stands none",
    (
        "rover_pin/motion/replay.py",
        'return {**given, "place_rows": place, "share": run.period / HOLD, "check_every": CHECKED}: '
        "run.period / HOLD -> (run.period)",
    ): "a quotient by 1 s",
    (
        f"{STEP}settle.c",
        "double dt = sqrt(FURTHEST * s->radius / s->gravity), left = unbalanced(d, s);: * -> /",
    ): "how long the first step is: those after it go by whether they come nearer to rest, to the same rest",
    (
        "rover_pin/motion/happened.py",
        "last = np.maximum.accumulate(np.where(sign != 0.0, np.arange(len(sign))[:, None], -1), axis=0): 1 -> 2",
    ): "any row before the first means that there was none",
    (
        "rover_pin/motion/pace.py",
        "off = 0.0 if status else self.stepper.misjudged: 0.0 -> 0.1",
    ): "a step that failed is taken again or ends the drive: what it misjudged is not read",
    (
        "rover_pin/motion/happened.py",
        "last = float(ratio[-1]) if ratio.size else 1.0: 1.0 -> 1.1",
    ): "any share from a half on drives",
    (
        "rover_pin/motion/happened.py",
        'sense, halting = "left" if rate > 0.0 else "right", "" if kind == "driving" else ", its wheels slip much": '
        "== -> >=",
    ): "it drives or creeps: of the two words driving is the later",
    (
        "rover_pin/motion/plain.py",
        "out = self.body(seen, np.zeros(0), laws.numbers(self.model.body_effects)): 0 -> 1",
    ): "a law without states reads none",
    (
        "rover_pin/motion/run_terrain.py",
        'right.append((blocks["body_z"][use] - np.mean(blocks["body_z"][use])) / HEIGHT_SD): '
        'blocks["body_z"][use] - np.mean(blocks["body_z"][use]) -> (blocks["body_z"][use])',
    ): "heights are told up to a constant, which the surface's mean takes off",
    (
        "rover_pin/motion/laws.py",
        'code = ca.CodeGenerator("laws.c", {"with_header": False}): False -> True',
    ): "a header is a file of its own, which the text has not",
    (
        "rover_pin/motion/laws.py",
        "contact = Contact(S=0.0, S_y=0.0, wheel=wheel, soil=soil, **geometry)  # type: ignore[arg-type]: 0.0 -> 0.1",
    ): "every model has a law of slip, which sets both",
    (
        "rover_pin/motion/plain_run.py",
        "now = np.zeros(1, dtype=rows.dtype): 1 -> 2",
    ): "the first of its rows alone is written and read",
    (
        "rover_pin/motion/plain.py",
        "self.servo_target = np.zeros(max(1, len(self.servo_wheels))): 1 -> 2",
    ): "room for the target of a servo that is not there",
    (
        "rover_pin/motion/plain.py",
        "return Facet(np.array([-1.0, -1.0]), np.array([1.0, -1.0]), frame.up, 0): 1.0 -> 1.1",
    ): "in the air nothing pushes: of that facet only the normal is read",
    (
        "rover_pin/motion/plain.py",
        "return Facet(np.array([-1.0, -1.0]), np.array([1.0, -1.0]), frame.up, 0): -1.0 -> (1.0)",
    ): "in the air nothing pushes: of that facet only the normal is read",
    (
        "rover_pin/motion/replay.py",
        'return {**given, "place_rows": place, "share": run.period / HOLD, "check_every": CHECKED}: / -> *',
    ): "a quotient by 1 s",
    (
        "rover_pin/motion/body_law.py",
        "s = _Symbols(base[:3], base[3:], still, angles, rest, ca.SX(0), rest): 0 -> 1",
    ): "energy at an instant: no step is read",
    (
        "rover_pin/motion/plain.py",
        "found = [Patch(1e-9, 0.0, 0.0, 0.0, 0.0, _below(frame))]: 0.0 -> 0.1",
    ): "in the air: a tenth of what presses 1 nm deep is round-off",
    (
        "rover_pin/motion/happened.py",
        'turn = math.degrees(trace["body_yaw"][-1] - trace["body_yaw"][0]) if "body_yaw" in trace else 0.0: 0.0 -> 0.1',
    ): "no turn below 5 deg is told",
    (
        "rover_pin/motion/plain_law.py",
        "if forwards == 1.0:: == -> >=",
    ): "the weight is 1 at most",
    (
        "rover_pin/motion/sensors.py",
        "noisy = values + sd * self.random.standard_normal(values.shape): + -> -",
    ): "noise is as likely on either side",
    (
        "rover_pin/motion/shear_store.py",
        "GRID = np.linspace(-1.0, 1.0, 81): 81 -> 82",
    ): "a point more on a smooth curve",
    (
        "rover_pin/motion/driving.py",
        "steer if _is_number(steer) else _angles(steer, len(stepper.servo_wheels), drive.state.t): "
        "steer -> (_angles(steer, len(stepper.servo_wheels), drive.state.t))",
    ): "a number alone is checked once more, and is every servo's angle either way",
    (
        "rover_pin/motion/plain_run.py",
        "if k % per_sample == per_sample - 1:: == -> >=",
    ): "a remainder is that at most",
    (
        "rover_pin/motion/sensors.py",
        "noisy = values + sd * noise if sd else values: + -> -",
    ): "noise is as likely on either side",
    (
        "rover_pin/motion/sensors.py",
        "noisy = values + sd * noise if sd else values: values -> (values + sd * noise)",
    ): "an SD of 0 is no noise",
    (
        "rover_pin/motion/body_law.py",
        "angles, rates, known = (tuple(ca.vertsplit(each)) if joints.number else () for each in "
        "(s.angles, s.rates, s[-1])): () -> (tuple(ca.vertsplit(each)))",
    ): "a column of none is split into none",
    (
        "rover_pin/motion/plain.py",
        "return Facet(np.array([-1.0, -1.0]), np.array([1.0, -1.0]), frame.up, 0): 0 -> 1",
    ): "in the air no soil decides: the rates of the states are those of the speeds",
    (
        "rover_pin/motion/plain_law.py",
        "if forwards == 1.0:: 1.0 -> 1.1",
    ): "leaves out what has no weight",
}
