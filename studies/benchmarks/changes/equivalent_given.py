"""Changes of what the compiled step is given that change no result: file, change as it is told, and the reason."""

HERE = "rover_pin/motion/"
BOUND = "how far a number may be declared: a declaration, no law"
ROOM = "room that nobody reads"
ADDRESS = "a function that was found has an address: 0 stands for none"
HELD = "an inertia that much larger than the rover's, or a tenth more, holds a wheel alike: to less than 1e-6 rad/s"
NONE = "a column of none, however it is written"
FREE = "heights are told up to a constant, which the surface's mean takes off: how it is held is not seen"

GIVEN: dict[tuple[str, str], str] = {
    (f"{HERE}kernel.py", "HOLDING = 1e6: 1e6 -> 1100000.0"): HELD,
    (
        f"{HERE}kernel.py",
        "self._set(held_rate=rates, hold_inertia=HOLDING * self.model.built.mass * self.model.rover.radii**2): ** -> *",
    ): HELD,
    (
        f"{HERE}kernel.py",
        "self._set(held_rate=rates, hold_inertia=HOLDING * self.model.built.mass * self.model.rover.radii**2): "
        "self.model.rover.radii**2 -> (self.model.rover.radii)",
    ): HELD,
    (
        f"{HERE}kernel.py",
        "self.loads, self.foreseen = np.zeros((len(rover.wheels), 6)), np.zeros((len(rover.wheels), 4)): 4 -> 5",
    ): ROOM,
    (
        f"{HERE}kernel.py",
        "self.energy, self.impulse, self.differential = np.zeros(len(ENERGY)), np.zeros(3), np.zeros(1): 3 -> 4",
    ): ROOM,
    (f"{HERE}kernel.py", "found = np.zeros(2): 2 -> 3"): ROOM,
    (f"{HERE}kernel.py", "self.servo_target = np.zeros(max(1, len(self.servo_wheels))): 1 -> 2"): ROOM,
    (
        f"{HERE}kernel.py",
        "self._set(dt=dt, direction_speed=direction_speed, symmetric=int(symmetric), accounts=1): 1 -> 2",
    ): "any number but 0 says yes",
    (
        f"{HERE}kernel.py",
        'assert made.lanes == room.lanes, "the laws and the step are compiled for other lanes": == -> >=',
    ): "one header says how many lanes both have: more or fewer, neither is met",
    (f"{HERE}kernel_terrain.py", "WHEEL_LENGTH = 2.1: 2.1 -> 2.3100000000000005"): ROOM,
    (f"{HERE}kernel_terrain.py", "GRID_FACETS = 8: 8 -> 9"): ROOM,
    (
        f"{HERE}kernel_rover.py",
        '"joint_unbounded": np.array([joint.nq == 2 for joint in joints], dtype=np.int64),: == -> >=',
    ): "behind the base a joint has one place in q or two",
    (
        f"{HERE}compiled_laws.py",
        "at = [ctypes.cast(getattr(handle, name), ctypes.c_void_p).value or 0 for name in names]: 0 -> 1",
    ): ADDRESS,
    (
        f"{HERE}compiled_laws.py",
        "work = max(f.sz_iw() for f in scalar), max(f.sz_w() for f in scalar): max -> min",
    ): "in whole numbers none of them works; what they work with in others is tested",
    (
        f"{HERE}hoist.py",
        "held, value = (ca.vertcat(*each) if each else ca.SX(0, 1) for each in (symbols, values)): "
        "ca.SX(0, 1) -> (ca.vertcat(*each))",
    ): NONE,
    (
        f"{HERE}hoist.py",
        "held, value = (ca.vertcat(*each) if each else ca.SX(0, 1) for each in (symbols, values)): 0 -> 1",
    ): "one number is held that nobody reads",
    (
        f"{HERE}hoist.py",
        "held, value = (ca.vertcat(*each) if each else ca.SX(0, 1) for each in (symbols, values)): 1 -> 2",
    ): NONE,
    (
        f"{HERE}laws.py",
        "return ca.vertcat(*flat) if flat else ca.SX(0, 1): ca.SX(0, 1) -> (ca.vertcat(*flat))",
    ): NONE,
    (
        f"{HERE}laws.py",
        "if of.numel() == 0 or by.numel() == 0:: or -> and",
    ): "a Jacobian of none, or by none, is none",
    (
        f"{HERE}motors.py",
        "weaker = usual.replace(resistance=usual.resistance * float(usual.stall_torque) / stall_torque): * -> /",
    ): "the usual motor's stall torque is 1 N m",
    (
        f"{HERE}motors.py",
        "weaker = usual.replace(resistance=usual.resistance * float(usual.stall_torque) / stall_torque): "
        "usual.resistance * float(usual.stall_torque) -> (usual.resistance)",
    ): "the usual motor's stall torque is 1 N m",
    (
        f"{HERE}place.py",
        "heading = np.array([math.cos(start.yaw), math.sin(start.yaw), 0.0]): 0.0 -> 0.1",
    ): "its height is replaced by the ground's along it",
    (f"{HERE}relaxation.py", "LOCKED = 1e15: 1e15 -> 1100000000000000.1"): "holds still, or a tenth stiller",
    (
        f"{HERE}relaxation.py",
        "kernel = Kernel(model, state, 1.0, symmetric, UNDECIDED): 1.0 -> 1.1",
    ): "setting down has steps of its own",
    (
        f"{HERE}relaxation.py",
        "radius = min(float(wheel.wheel.r) for wheel in model.rover.wheels): min -> max",
    ): "how far one step of setting down goes: the rest is the same to 1e-11",
    (
        f"{HERE}timing.py",
        "ACCURACY = 1e-4: 1e-4 -> 0.00011000000000000002",
    ): "a bound that only a test asks: the drives are 30 times nearer than either",
    (
        f"{HERE}run_terrain.py",
        "known = np.isfinite(x + y + yaw): + -> -",
    ): "a difference is as finite as a sum",
    (
        f"{HERE}run_terrain.py",
        'right.append((blocks["body_z"][use] - np.mean(blocks["body_z"][use])) / HEIGHT_SD): - -> +',
    ): FREE,
    **{
        (
            f"{HERE}run_terrain.py",
            "normal = normal + scipy.sparse.diags(np.full(normal.shape[0], 1e-9 * normal.diagonal().max())): " + change,
        ): FREE
        for change in (
            "+ -> -",
            "* -> /",
            "max -> min",
            "1e-9 * normal.diagonal().max() -> (1e-9)",
            "normal + scipy.sparse.diags(np.full(normal.shape[0], 1e-9 * normal.diagonal().max())) -> (normal)",
        )
    },
    (
        f"{HERE}native/rigid_body.py",
        "joints.append(Joint(parent, about.idx_q, about.idx_v, about.nq == 2, revolves, tuple(special))): == -> >=",
    ): "behind the base a joint has one place in q or two, and the base's is not asked",
    (
        f"{HERE}native/rigid_body.py",
        "other = np.roll(np.eye(3)[int(np.argmax(np.abs(axis)))], 1): 1 -> 2",
    ): "either of the two other axes does",
    (f"{HERE}native/compiled_body.py", 'sizes |= {"rotation": 9, "potential": 1}: 1 -> 2'): ROOM,
    (
        f"{HERE}native/compiled_body.py",
        "address = ctypes.cast(getattr(handle, during.name()), ctypes.c_void_p).value or 0: 0 -> 1",
    ): ADDRESS,
    (
        f"{HERE}native/compiled_body.py",
        "held = np.array(before(np.zeros(0), tree.parameters)).ravel(): 0 -> 1",
    ): "of a column of none CasADi takes none",
    (f"{HERE}native/elimination.py", "for joint in range(1, model.njoints):: 1 -> 2"): (
        "what the base's six meet is met below any joint"
    ),
    (
        f"{HERE}native/lanes.py",
        'return f"ALL({text})" if argument in shared else text: text -> (f"ALL({text})")',
    ): "what is added to 0 in all lanes stays what it is",
    (
        f"{HERE}native/lanes.py",
        "stack = sorted(wanted, reverse=True): True -> False",
    ): "in which order values are written that do not need each other",
    (
        f"{HERE}native/library.py",
        'assert sizes(made).drive == ctypes.sizeof(DriveStruct), "this compiler lays the struct Drive out otherwise": '
        "== -> >=",
    ): "no compiler at hand lays it out otherwise",
    (f"{HERE}native/library.py", "room = np.zeros(count + 8): 8 -> 9"): ROOM,
    (
        f"{HERE}native/shared.py",
        'f"  {form.format(name)};" + (f" /* {about} */" if about else ""): f" /* {about} */" -> ("")',
    ): "a comment",
    (
        f"{HERE}native/shared.py",
        'f"  {form.format(name)};" + (f" /* {about} */" if about else ""): "" -> (f" /* {about} */")',
    ): "a comment",
    (
        f"{HERE}native/shared.py",
        'MOST = {"DOF": MAX_DOF, "COLS": MAX_COLS, "STATES": MAX_STATES, "MOTOR_OUT": 128, "SPOTS": 64}: 128 -> 129',
    ): ROOM,
    (
        f"{HERE}native/shared.py",
        'MOST = {"DOF": MAX_DOF, "COLS": MAX_COLS, "STATES": MAX_STATES, "MOTOR_OUT": 128, "SPOTS": 64}: 64 -> 65',
    ): ROOM,
    (f"{HERE}native/loop.py", "row = np.zeros(1, dtype=self.rows.dtype): 1 -> 2"): ROOM,
    (f"{HERE}native/loop.py", "self.moved = np.zeros(3): 3 -> 4"): ROOM,
    (
        f"{HERE}native/control.py",
        "return handle, ctypes.cast(getattr(handle, law.name()), ctypes.c_void_p).value or 0: 0 -> 1",
    ): ADDRESS,
    (
        f"{HERE}resolution.py",
        "if touching[i] and record[i, 2] > h[i] and float(modulus(mount.wheel, soil)) > 0.0: 0.0 -> 0.1",
    ): "no soil has a modulus of a tenth of a pascal",
    (
        f"{HERE}native/control.py",
        "steer = np.asarray(self.steer if servos else 0.0, dtype=float): 0.0 -> 0.1",
    ): "an angle for no servo",
    (
        f"{HERE}native/control.py",
        'assert slip.law.sz_w() <= kernel.keep["work_w"].size: <= -> <',
    ): "the slip law works with less than the rigid body by far",
    (f"{HERE}native/loop.py", "QUESTIONS = 256: 256 -> 257"): ROOM,
    (f"{HERE}native/loop.py", "self.set(asks=1, asked=QUESTIONS): 1 -> 2"): "any number but 0 says yes",
    (
        f"{HERE}native/loop.py",
        "if self.struct.asks and self.struct.asked == QUESTIONS:: and -> or",
    ): "more room than is needed: what a controller keeps stays where it is",
    (
        f"{HERE}native/loop.py",
        "if self.struct.asks and self.struct.asked == QUESTIONS:: == -> >=",
    ): "room is made before there would be more",
    (f"{HERE}native/loop.py", '"saved": np.zeros(2 * total),: 2 -> 3'): ROOM,
    (
        f"{HERE}audit.py",
        'return float(rows["t"][-1] - rows["t"][0]) if len(rows) else 0.0: 0.0 -> 0.1',
    ): "either is less than SHORTEST, and where there is no row nothing was misjudged",
    (
        f"{HERE}simulate.py",
        "finer = simulate(model, controller, duration, timing=timing.halved(), "
        '**options | {"settle_doubts": False}): False -> True',
    ): "of the finer drive the way alone is read, which no doubt changes",
    (
        f"{HERE}plain.py",
        "off = np.abs(now / now[2] - before / before[2]) / "
        "[1.0, 1.0, 1.0, float(self.rover.wheels[index].wheel.r)]: 1.0 -> 1.1",
    ): "the third is the normal force over itself, which never differs; the first two are noticed",
    (
        f"{HERE}replay.py",
        "CHECKED = 10: 10 -> 11",
    ): "when a replay ends that failed: it counts as failed whenever that was seen",
    (
        f"{HERE}kernel.py",
        "self.loads, self.foreseen = np.zeros((len(rover.wheels), 6)), np.zeros((len(rover.wheels), 4)): 6 -> 7",
    ): ROOM,
    (
        f"{HERE}kernel.py",
        "self.energy, self.impulse, self.differential = np.zeros(len(ENERGY)), np.zeros(3), np.zeros(1): 1 -> 2",
    ): ROOM,
    (
        f"{HERE}kernel.py",
        "work_i=np.zeros(max(made.work[0], rigid[0]), dtype=np.int64),: max -> min",
    ): "in whole numbers none of them works",
    (
        f"{HERE}kernel_rover.py",
        "body = [*range(6), *suspension_dofs(rover)] if pushed else []: 6 -> 7",
    ): "the first joint's speed meets the base's in any case, and what meets more than it must costs time",
    (
        f"{HERE}native/control.py",
        '"steer_fixed": np.broadcast_to(steer, max(1, servos)).copy(),: 1 -> 2',
    ): ROOM,
    ("rover_pin/effects/bent_ground.py", "CHORDS = 8: 8 -> 9"): "a chord more lies nearer to the same parabola",
    ("rover_pin/effects/bent_ground.py", "STEEP, FAR = 0.5, 1e4: 0.5 -> 0.55"): BOUND,
    ("rover_pin/effects/bent_ground.py", "STEEP, FAR = 0.5, 1e4: 1e4 -> 11000.0"): BOUND,
    ("rover_pin/effects/raw_current.py", "MOST = 1e9: 1e9 -> 1100000000.0"): BOUND,
    (f"{HERE}native/loop.py", "obeyed=-1,: 1 -> 2"): "either is before any step",
    (
        f"{HERE}native/loop.py",
        "self.set(asked=0, questions=np.zeros(QUESTIONS, dtype=self.rows.dtype)): 0 -> 1",
    ): "a row that is left empty: what is asked is read where it was written",
    (
        f"{HERE}native/rigid_body.py",
        "scale = float(np.max(np.abs(numbers), initial=0.0)): 0.0 -> 0.1",
    ): "what is below 1e-15 is 0 by the next line in any case",
    (
        f"{HERE}native/rigid_body.py",
        "self.R[i] = fixed.rotation if joint.revolves else fixed.rotation @ _about_x(cosine, sine): "
        "fixed.rotation -> (fixed.rotation @ _about_x(cosine, sine))",
    ): "a body of revolution is the same however it is turned: it costs time",
}
