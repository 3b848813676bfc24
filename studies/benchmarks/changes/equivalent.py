"""Changes that no test can notice, because they change no result: file, change as it is told, and the reason."""

from changes.equivalent_body import BODY
from changes.equivalent_discrepancy import DISCREPANCY
from changes.equivalent_drive_log import DRIVE_LOG
from changes.equivalent_estimation import ESTIMATION
from changes.equivalent_given import GIVEN
from changes.equivalent_identification import IDENTIFICATION
from changes.equivalent_motion import MOTION
from changes.equivalent_step import STEP

SHIFT = "the least shift keeps a ratio finite where nothing is sheared; any other does"
NOT_ZERO = "keeps tanh(x) / x from 0 / 0 at a pivot that stands: any tiny number does"
WORDS = "how many words a hint has"
START = "where a start lies within its bounds: the descent comes to the same"

EQUIVALENT: dict[tuple[str, str], str] = {
    **BODY,
    **DISCREPANCY,
    **DRIVE_LOG,
    **ESTIMATION,
    **GIVEN,
    **IDENTIFICATION,
    **MOTION,
    **STEP,
    (
        "rover_pin/estimation/numbers.py",
        "found = fit(fitted.task, held, others, start, fitted.slopes, reuse=True): True -> False",
    ): "slopes are worked out again: slower, to the same end",
    (
        "rover_pin/estimation/numbers.py",
        "reach = np.clip([fitted.u[at] + share * half for share in SHARES], *one.bounds): + -> -",
    ): "the shares are alike on either side",
    (
        "rover_pin/effects/grousers.py",
        "faster = q * (1.0 + ca.fmin(S, 0.0)): 0.0 -> 0.1",
    ): "what is worked out of it is read where S < 0 only",
    (
        "rover_pin/effects/pivot_friction.py",
        "x = ca.sqrt((rate / self.w_s) ** 2 + TINY**2): ** -> *",
    ): NOT_ZERO,
    (
        "rover_pin/effects/pivot_friction.py",
        "x = ca.sqrt((rate / self.w_s) ** 2 + TINY**2): 2 -> 3",
    ): NOT_ZERO,
    (
        "rover_pin/effects/pivot_friction.py",
        "x = ca.sqrt((rate / self.w_s) ** 2 + TINY**2): TINY**2 -> (TINY)",
    ): NOT_ZERO,
    (
        "rover_pin/effects/soil_traction.py",
        "NODES = 12: 12 -> 13",
    ): "a node more than is needed",
    (
        "rover_pin/effects/weak_motor.py",
        "return ca.if_else(ca.fabs(drive.wheel - self.wheel) < 0.5, -self.g * torque, 0.0): 0.5 -> 0.55",
    ): "wheels are counted in whole numbers",
    (
        "rover_pin/estimation/noise.py",
        "steps = _innovations(np.where(self.good, residual, 0.0), self.good, self.rho): 0.0 -> 0.1",
    ): "what is not compared is read by no row: a block after a gap begins anew",
    (
        "rover_pin/identification/identifiability.py",
        """hint = f", which tells {', '.join(told)} only" if 0 < len(told) <= FEW else "": <= -> <""",
    ): WORDS,
    (
        "rover_pin/identification/identify.py",
        "index = problem.space.names.index(name) if name in problem.space.names else -1: 1 -> 2",
    ): "any negative number stands for none",
    (
        "rover_pin/identification/identify.py",
        "margin = 1e-6 * np.minimum(high - low, 1.0): * -> /",
    ): START,
    (
        "rover_pin/identification/identify.py",
        "margin = 1e-6 * np.minimum(high - low, 1.0): - -> +",
    ): START,
    (
        "rover_pin/identification/identify.py",
        "margin = 1e-6 * np.minimum(high - low, 1.0): 1.0 -> 1.1",
    ): START,
    (
        "rover_pin/identification/identify.py",
        "margin = 1e-6 * np.minimum(high - low, 1.0): 1e-6 * np.minimum(high - low, 1.0) -> (1e-6)",
    ): START,
    (
        "rover_pin/identification/identify.py",
        "margin = 1e-6 * np.minimum(high - low, 1.0): high - low -> (high)",
    ): START,
    (
        "rover_pin/identification/identify.py",
        "margin = 1e-6 * np.minimum(high - low, 1.0): minimum -> maximum",
    ): START,
    (
        "rover_pin/identification/identify.py",
        'return Ended(*descend(problem, np.clip(start, low + margin, high - margin)), status="settled"): + -> -',
    ): START,
    (
        "rover_pin/identification/identify.py",
        'return Ended(*descend(problem, np.clip(start, low + margin, high - margin)), status="settled"): - -> +',
    ): START,
    (
        "rover_pin/identification/identify.py",
        "return Ended(*descend(problem, np.clip(start, low + margin, high - margin)), "
        'status="settled"): high - margin -> (high)',
    ): START,
    (
        "rover_pin/identification/identify.py",
        "return Ended(*descend(problem, np.clip(start, low + margin, high - margin)), "
        'status="settled"): low + margin -> (low)',
    ): START,
    (
        "rover_pin/identification/identify.py",
        "return Ended(*descend(problem, np.clip(start, low + margin, high - margin)), "
        'status="settled"): low + margin -> (margin)',
    ): START,
    (
        "rover_pin/identification/identify.py",
        "return [centre, *np.clip(centre + draws * spread, low, high)]: + -> -",
    ): "drawn alike on either side",
    (
        "rover_pin/identification/identify.py",
        "POLISHES = 5: 5 -> 6",
    ): "one more try before it gives up",
    (
        "rover_pin/identification/identify.py",
        "for at in sorted(np.flatnonzero(side), key=lambda i: abs(wanted[i] - best.u[index])):: - -> +",
    ): "the order in which values of a profile are taken: each ends at its own least",
    (
        "rover_pin/identification/identify.py",
        "for at in sorted(np.flatnonzero(side), key=lambda i: abs(wanted[i] - best.u[index])):: "
        "wanted[i] - best.u[index] -> (wanted[i])",
    ): "the order in which values of a profile are taken: each ends at its own least",
    (
        "rover_pin/identification/identify.py",
        "seed: int = 0: 0 -> 1",
    ): "any seed will do",
    (
        "rover_pin/identification/posterior.py",
        "if not time < (chain.steps - chain.burn_in) / 10:: < -> <=",
    ): "two numbers that are worked out are never equal",
    (
        "rover_pin/identification/judge.py",
        "return float(min(1.0 / max(left @ left * best.covariance[index, index], 1.0), 1.0)): 1.0 -> 1.1",
    ): "held at 1 against rounding; 0.9 or 1.1 decides nothing at a half",
    (
        "rover_pin/identification/posterior.py",
        "burn_in: int = 200: 200 -> 201",
    ): "a step more of a chain",
    (
        "rover_pin/identification/posterior.py",
        "seed: int = 0: 0 -> 1",
    ): "any seed will do",
    (
        "rover_pin/identification/posterior.py",
        "steps: int = 1000: 1000 -> 1001",
    ): "a step more of a chain",
    (
        "rover_pin/identification/posterior.py",
        "walkers: int = 24: 24 -> 25",
    ): "a walker more",
    (
        "rover_pin/identification/soil_space.py",
        "low = max(about.low + shift, DECADES * (value + shift)): + -> -",
    ): "a modulus may be below -1e8 alone: of the two the share of the start is the greater",
    (
        "rover_pin/identification/posterior.py",
        "return np.clip(u + draws * sd, problem.space.low + margin, problem.space.high - margin): + -> -",
    ): "drawn alike on either side",
    (
        "rover_pin/identification/soil_space.py",
        "low = max(about.low + shift, DECADES * (value + shift)): about.low + shift -> (about.low)",
    ): "a modulus may be below -1e8 alone: of the two the share of the start is the greater",
    (
        "rover_pin/soil/certified.py",
        "NEWTON_STEPS = 12: 12 -> 13",
    ): "a step more than is needed",
    (
        "rover_pin/soil/certified.py",
        "cuts = _cuts(ratio, theta_1, length, wheel.r / soil.k) if is_symbolic(S) or S < 0 else (): () -> "
        "(_cuts(ratio, theta_1, length, wheel.r / soil.k))",
    ): "a driving wheel's arc is smooth: cuts cost time and change nothing",
    (
        "rover_pin/soil/certified.py",
        "cuts = _cuts(ratio, theta_1, length, wheel.r / soil.k) if is_symbolic(S) or S < 0 else (): 0 -> 1",
    ): "a driving wheel's arc is smooth: cuts cost time and change nothing",
    (
        "rover_pin/soil/certified.py",
        "cuts = _cuts(ratio, theta_1, length, wheel.r / soil.k) if is_symbolic(S) or S < 0 else (): < -> <=",
    ): "at S = 0 cuts cost time and change nothing",
    (
        "rover_pin/soil/certified.py",
        "far = far + ca.fmax(target - _mean_cosine(far, theta_1), 0.0) / ca.fmin(_mean_slope(far, theta_1), "
        "-1e-9): -1e-9 -> (1e-9)",
    ): "the slope at the far side is negative: only a slope of 0 is held off",
    (
        "rover_pin/soil/certified.py",
        "half = ca.fmax(s / 2, 1e-4): 1e-4 -> 0.00011000000000000002",
    ): "either is so near the start that the quotient is the slope there",
    (
        "rover_pin/soil/certified.py",
        "near, far = 0.0 * theta_1, 2 * theta_1: * -> /",
    ): "0 over theta_1 is 0",
    (
        "rover_pin/soil/certified.py",
        "near, far = 0.0 * theta_1, 2 * theta_1: 0.0 * theta_1 -> (0.0)",
    ): "0 times theta_1 is 0",
    (
        "rover_pin/soil/certified.py",
        "near, far = 0.0 * theta_1, 2 * theta_1: 2 -> 3",
    ): "Newton begins farther outside and comes to the same zero: the mean cosine is concave",
    (
        "rover_pin/soil/certified.py",
        "near, far = ca.fmin(near, 2 * theta_1), ca.fmax(far, 0.0): * -> /",
    ): "Newton from inside does not pass the far zero; where there is none the arc's length holds it",
    (
        "rover_pin/soil/certified.py",
        "near, far = ca.fmin(near, 2 * theta_1), ca.fmax(far, 0.0): 2 * theta_1 -> (2)",
    ): "Newton from inside does not pass the far zero; where there is none the arc's length holds it",
    (
        "rover_pin/soil/certified.py",
        "near, far = ca.fmin(near, 2 * theta_1), ca.fmax(far, 0.0): 2 -> 3",
    ): "Newton from inside does not pass the far zero; where there is none the arc's length holds it",
    (
        "rover_pin/soil/certified.py",
        "target = ca.fmin(1 / ca.fmax(ratio, 1e-30), 1.0): 1.0 -> 1.1",
    ): "a mean cosine is at most 1: neither 1 nor 1.1 is reached",
    (
        "rover_pin/soil/combined.py",
        "size = ca.sqrt(x * x + y * y + LEAST_SHIFT**2): ** -> *",
    ): SHIFT,
    (
        "rover_pin/soil/combined.py",
        "size = ca.sqrt(x * x + y * y + LEAST_SHIFT**2): 2 -> 3",
    ): SHIFT,
    (
        "rover_pin/soil/combined.py",
        "size = ca.sqrt(x * x + y * y + LEAST_SHIFT**2): LEAST_SHIFT**2 -> (LEAST_SHIFT)",
    ): SHIFT,
    (
        "rover_pin/soil/combined.py",
        "size = ca.sqrt(x * x + y * y + LEAST_SHIFT**2): x * x + y * y + LEAST_SHIFT**2 -> (x * x + y * y)",
    ): SHIFT,
    (
        "rover_pin/soil/compaction.py",
        "PRESSURE_NODES = 8: 8 -> 9",
    ): "nine nodes are hardly better than eight: 2.0e-4 for 2.1e-4",
    (
        "rover_pin/soil/compaction.py",
        "STEPS = 2: 2 -> 3",
    ): "a step more than is needed",
    (
        "rover_pin/soil/compaction.py",
        "arc = integrate(theta_1, 0.0, length, _no_shear, (0.0, 0.0, soil.n), entry_graded(PRESSURE_NODES)): "
        "0.0 -> 0.1",
    ): "strength of which nothing is in use: no shear is integrated",
    (
        "rover_pin/soil/compaction.py",
        "return 0.0: 0.0 -> 0.1",
    ): "the share in use of a strength of 0",
    (
        "rover_pin/soil/limits.py",
        "return _torque(load, 1.0, wheel, soil, sheared): 1.0 -> 1.1",
    ): "soil that is sheared in full bears the same at any slip",
    (
        "rover_pin/soil/quadrature.py",
        "CERTIFIED = 48: 48 -> 49",
    ): "a node more than is needed",
    (
        "rover_pin/soil/sinkage.py",
        "STEPS = 3: 3 -> 4",
    ): "a step more than is needed",
    (
        "rover_pin/soil/sinkage.py",
        "shape = (1 + soil.n) ** -0.55 + soil.exit_ratio: 0.55 -> 0.6050000000000001",
    ): "where Newton begins: a few percent off by either",
}
