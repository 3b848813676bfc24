"""A second implementation of the on-board slip estimate and of the monitor, in plain NumPy, as a reference for tests.

Nothing of rover_pin is imported, so that equations and numbers are independent of the package. The test passes the
table of torque factors, the table of pull factors, and the ground under the wheels, which other tests check. The random
numbers are generated as in the C code (SplitMix64 and xorshift64*), so that both implementations draw the same
particles and can be compared sample by sample.
"""

import math
from typing import NamedTuple

import numpy as np

WORD = 2**64
PARTICLES, DT = 216, 0.05
SLIP_LENGTH, HOLE_LENGTH, DEEPEST, REST = 0.031, 0.04, 0.5, 0.001
"""Travel over which slip builds up and travel over which a wheel leaves its hole [m]; depth over r beyond which a hole
does not deepen; speed below which a wheel counts as resting [m/s]."""
ROWS = ("slope", "level", "load", "ahead", "rise", "swing", "height")


class Chance:
    """A generator of random numbers in [0, 1), xorshift64* (Vigna 2016)."""

    def __init__(self, memory):
        self.memory = memory

    @classmethod
    def of_sample(cls, sample):
        """Return the generator for one sample, whose state is from SplitMix64 (Steele, Lea and Flood 2014)."""
        x = (sample + 2) * 0x9E3779B97F4A7C15 % WORD
        x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9 % WORD
        x = (x ^ (x >> 27)) * 0x94D049BB133111EB % WORD
        return cls(x ^ (x >> 31))

    def next(self):
        x = self.memory
        x ^= x >> 12
        x ^= x << 25 & (WORD - 1)
        x ^= x >> 27
        self.memory = x
        return (x * 2685821657736338717 % WORD >> 11) * 2.0**-53

    def many(self, *shape):
        return np.array([self.next() for _ in range(math.prod(shape))]).reshape(shape)


def scatter(values):
    """Return the mean distance of the values from their median."""
    return float(np.mean(np.abs(values - np.median(values))))


def at_slip(table, S):
    """Return the value of a table at slip S; the table has equal steps of slip from -1 to 1 and is linear in
    between."""
    return np.interp(S, np.linspace(-1.0, 1.0, len(table)), table)


def deepening(c_d, v, rim, r, D):
    """Return dD/dt [m/s] of a wheel's hole of depth D [m]: the rim throws out sand, and travel leads out of the
    hole."""
    crawl = REST * REST / np.hypot(REST, rim)
    return c_d * np.maximum(rim - v, 0.0) * (1.0 - D / (DEEPEST * r)) - D * v * v / np.hypot(v, crawl) / HOLE_LENGTH


def torque_density(expected, read, share):
    """Return the probability density of a measured T / (r W) for a wheel whose soil gives the factor `expected`.

    The error has the SD 0.015, and in addition a relative error of variance `share`. One wheel in ten is an outlier,
    which may read any value within a range of 2.
    """
    sd = np.sqrt(0.015**2 + share * expected**2)
    return 0.9 * np.exp(-0.5 * ((read - expected) / sd) ** 2) / (sd * math.sqrt(2.0 * math.pi)) + 0.1 / 2.0


def fold_log_density(u, rise, bend, wall):
    """Return the log of the probability density of the speed `rise` at which the wheels rise relative to each other.

    u is the speed of the rover, and `bend` the bend of the ground. `wall` is 1 if a wheel is at a wall, which the wheel
    may climb; the slopes of the wheels then differ by 0.33 more.
    """
    climbing = 0.1 + 0.9 * wall

    def density(slope):
        size = np.hypot(0.0012, u * slope)
        return np.exp(-rise / size) / size

    return np.log((1.0 - climbing) * (0.2 * density(0.0) + 0.8 * density(bend)) + climbing * density(bend + 0.33))


def still_log_density(way, change, bend):
    """Return the log of the probability density of a change of the posture, for particles that travelled `way` [m].

    `change` is the change of the wheels' heights relative to each other [m], and `bend` the bend of the ground. A rover
    that moves has a gamma density of shape 2, whose scale is half of way times bend. A rover at rest has an exponential
    density of mean 0.0007 m. The two are mixed, with more of the first as way times bend exceeds 0.0007 m.
    """
    still, bent = 0.0007, np.abs(way) * bend
    size = 0.5 * np.hypot(bent, still)
    standing = np.exp(-change / still) / still
    share = np.minimum(bent / (4.0 * still), 1.0)
    moving = change / size**2 * np.exp(-change / size)
    return np.log((1.0 - share) * standing + share * (0.95 * moving + 0.05 * standing) + 1e-12)


class PlainBelief:
    """The particle filter of the on-board slip estimate: each particle has a speed, a mode, and slip and hole per
    wheel."""

    def __init__(self, radii, factors, softness, resistance, torque_per_current, ground, lag=0, odometry_sd=1.0):
        """Set up the filter.

        `factors` has a row and `softness` a number for each soil that is considered. `resistance` is (R, SD of R,
        relative SD of all torques). `ground` is a function of posture, its rates and torques that returns the rows of
        ROWS.
        """
        self.r, self.F, self.kappa, self.ground = np.array(radii), np.array(factors), torque_per_current, ground
        self.resistance, self.softness = resistance, np.repeat(softness, PARTICLES // len(softness))
        self.p_soil = np.full(len(softness), 1.0 / len(softness))
        self.lag, self.odometry_sd = lag, odometry_sd
        chance_source, n = Chance.of_sample(-1), len(self.r)
        begin = chance_source.many(PARTICLES, 2)
        self.share, self.stalled = 1.1 * begin[:, 0], begin[:, 1] < 0.1
        self.log_weight, self.way = -np.log(self.softness), np.zeros(PARTICLES)
        self.slip, self.hole = np.zeros((n, PARTICLES)), np.zeros((n, PARTICLES))
        self.samples, self.past, self.travels = [], [], []
        self.k, self.backwards, self.wall, self.rolled, self.no_progress = 0, False, 0.0, 0.0, False

    def sense(self, posture, rates, currents, backwards=False, late=math.nan):
        """Update the filter by one sample. Afterwards `told` holds slip, SD of the slip, hole depth and its SD of each
        wheel.
        """
        self.chance = Chance.of_sample(self.k)
        self._look(np.array(posture), np.array(rates), np.array(currents))
        self._move(backwards)
        self._turn_wheels()
        if len(self.samples) >= 6:
            rise = scatter(self.under["rise"])
            self.log_weight += DT / 0.5 * fold_log_density(self.travel, rise, self.bend, min(self.wall, 1.0))
        if self.resistance[1] > 0.0 and len(self.samples) >= 6 and not backwards and self.pace >= 0.002:
            self._balance()
        if self.k % 5 == 0:
            self._look_back()
        if self.lag:
            self.travels.append(self.travel.copy())
            if math.isfinite(late) and self.k >= self.lag:
                self.log_weight -= 0.5 * ((late - self.travels[-1 - self.lag]) / self.odometry_sd) ** 2
        self._tell()
        self.k += 1

    def _look(self, posture, rates, currents):
        self.samples = [*self.samples, (posture, rates, currents)][-16:]
        postures, wheels, amperes = (np.array(rows) for rows in zip(*self.samples, strict=True))
        t = DT * (np.arange(len(postures)) - 0.5 * (len(postures) - 1))
        slope = t @ postures / (t @ t) if len(postures) >= 6 else np.zeros(len(posture))
        torque = self.kappa * amperes[-4:].mean(axis=0)
        self.under = dict(zip(ROWS, self.ground(postures[-8:].mean(axis=0), slope, torque), strict=True))
        load = self.under["load"]
        self.rim = self.r * (wheels[-4:].mean(axis=0) + self.under["swing"])
        self.tells = (load > 0.5) & (np.abs(self.rim) > 5e-4) & (not self.backwards)
        self.factor = torque / (self.r * np.maximum(load, 0.5))
        self.bend = scatter(self.under["slope"])
        highest = max(0.0, *self.factor[self.tells]) if self.tells.any() else 0.0
        excess = max(highest / (self.p_soil @ self.F.max(axis=1)) - 1.1, 0.0) if self.bend > 0.04 else 0.0
        self.wall += -math.expm1(-DT / 0.31) * (min(excess / 0.3, 1.0) - self.wall)

    def _move(self, backwards):
        self.pace = float(np.median(self.rim))
        usual_rate, falls = max(abs(self.pace), 0.002), (0.1 + 1.0 * min(self.wall, 1.0)) * DT
        pairs = self.chance.many(PARTICLES // 2, 2)
        radius, turn = np.sqrt(-2.0 * np.log(1.0 - pairs[:, 0])), 2.0 * math.pi * pairs[:, 1]
        normal = np.array([radius * np.cos(turn), radius * np.sin(turn)]).T.ravel()
        d = self.chance.many(PARTICLES, 4).T
        share, stalled = self.share, self.stalled
        if backwards != self.backwards:
            share, stalled = 0.3 + 0.7 * d[0], d[1] < 0.1
        frees = stalled & (d[2] < 0.2 * DT)
        stalled = np.where(stalled, ~frees, d[2] < falls)
        share = np.where(frees, 0.6 * d[0], share + 0.25 * self.softness * math.sqrt(DT) * normal)
        share = np.where(~stalled & (d[3] < 0.02 * DT), -0.2 + 1.4 * d[1], share)
        self.share = np.where(stalled, 0.03 * normal, np.clip(share, -0.4, 1.4))
        self.stalled, self.backwards = stalled, backwards
        self.travel = (-usual_rate if backwards else usual_rate) * self.share
        self.way = self.way + DT * self.travel
        self.rolled += DT * max(self.pace, 0.0)

    def _turn_wheels(self):
        odds = np.ones(PARTICLES)
        share = 0.05**2 + self.bend**2 + (0.5 * self.wall) ** 2
        for w, rim in enumerate(self.rim):
            v = (self.travel + self.under["ahead"][w]) / max(self.under["level"][w], 0.3)
            rolling = np.maximum(abs(rim), np.abs(v))
            step = np.minimum(DT, SLIP_LENGTH / np.maximum(rolling, 1e-12))
            self.slip[w] += step * (rim - v - rolling * self.slip[w]) / SLIP_LENGTH
            self.hole[w] = np.maximum(self.hole[w] + DT * deepening(0.15, v, rim, self.r[w], self.hole[w]), 0.0)
            if self.tells[w]:
                blocks = zip(self.F, np.split(self.slip[w], len(self.F)), strict=True)
                expected = np.concatenate([at_slip(table, slip) for table, slip in blocks])
                odds *= torque_density(expected, self.factor[w], share)
        self.log_weight = self.log_weight + np.log(odds) * DT / 0.3

    def _balance(self):
        """Weigh the particles by thrust minus slope minus R minus the resistance of the holes, over the weight."""
        R, R_sd, torque_sd = self.resistance
        share = np.maximum(self.under["load"], 0.0)
        share = share / share.sum()
        thrust = share @ self.factor
        excess = thrust - share @ self.under["slope"] - R - share @ self.hole / HOLE_LENGTH
        excess = np.where(excess < 0.0, excess * np.minimum(np.abs(self.share) / 0.12, 1.0), excess)
        variance = 0.02**2 + R_sd**2 + (torque_sd * thrust) ** 2 + self.bend**2 + (0.5 * self.wall) ** 2
        density = np.exp(-0.5 * excess**2 / variance) / np.sqrt(2.0 * math.pi * variance)
        self.log_weight = self.log_weight + DT / 1.0 * np.log(0.9 * density + 0.1 / 2.0)

    def _look_back(self):
        """Weigh the particles by the largest relative change of the wheels' heights within 2 s and within 4 s."""
        self.past = [*self.past, (self.under["height"], self.bend, self.rolled, self.way.copy())][-17:]
        *before, (now, bend, rolled, way) = self.past
        for back in (8, 16):
            if len(before) >= back:
                window = before[-back:]
                change = max(scatter(now - heights) for heights, *_ in window)
                mean = (sum(row[1] for row in window) + bend) / (back + 1)
                self.log_weight = self.log_weight + 0.25 * still_log_density(way - window[0][3], change, mean)
        if len(before) == 16:
            turned = rolled - window[0][2]
            slow = change < max(0.3 * turned * mean, 0.0012)
            self.no_progress = mean > 0.04 and turned > 0.56 * self.r.max() and slow

    def _tell(self):
        self.log_weight = self.log_weight - self.log_weight.max()
        self.weight = np.exp(self.log_weight) / np.exp(self.log_weight).sum()
        self.speed = float(self.weight @ self.travel)
        stands = self.stalled | (self.share < 0.12)
        self.stuck = 1.0 if self.no_progress else float(self.weight[stands].sum())
        means = [table @ self.weight for table in (self.slip, self.hole)]
        sds = [
            np.sqrt(((table - mean[:, None]) ** 2) @ self.weight)
            for table, mean in zip((self.slip, self.hole), means, strict=True)
        ]
        self.told = np.array([np.clip(means[0], -1.0, 1.0), sds[0], means[1], sds[1]]).T
        self._resample()

    def _resample(self):
        """Draw the particles of each soil anew if few of them have most of its weight, and forget evidence."""
        soils, memory = len(self.F), min(25.0, 0.5 * DT * (self.k + 2))
        M = PARTICLES // soils
        self.p_soil = self.weight.reshape(soils, M).sum(axis=1)
        kept = np.log(np.maximum(self.p_soil, 0.05 * self.p_soil.max()) * soils) * (1.0 - DT / memory)
        pick, few = np.arange(PARTICLES), np.zeros(soils, dtype=bool)
        for c, weight in enumerate(self.weight.reshape(soils, M)):
            places, whole = (np.arange(M) + self.chance.next()) / M, max(weight.sum(), 1e-300)
            few[c] = whole**2 < 0.5 * M * np.sum(weight**2)
            if few[c]:
                pick[c * M : (c + 1) * M] = c * M + np.minimum(
                    np.searchsorted(np.cumsum(weight), places * whole), M - 1
                )
        with np.errstate(divide="ignore"):
            within = np.log(self.weight.reshape(soils, M) * M / np.maximum(self.p_soil, 1e-300)[:, None])
        self.log_weight = (np.where(few[:, None], 0.0, within) + kept[:, None]).ravel()
        for name in ("share", "stalled", "travel", "way"):
            setattr(self, name, getattr(self, name)[pick])
        self.slip, self.hole = self.slip[:, pick], self.hole[:, pick]
        self.past = [(*row[:3], row[3][pick]) for row in self.past]
        self.travels = [row[pick] for row in self.travels]


RATES, PRIOR = np.array([0.0, 0.05, 0.1, 0.15, 0.2]), np.array([0.5, 0.125, 0.125, 0.125, 0.125])
STEP, STEPS, DRAWS = 0.2, 20, 60


def fault_odds(duty, rate, current):
    """Return the probability that a motor is faulty, and 1 if a sensor is frozen, from the last 20 readings.

    Duty, rate and current (20, wheels) are fractions of their largest values.
    """
    p_motor, frozen = 0.0, False
    for d, w, i in zip(duty.T, rate.T, current.T, strict=True):
        frozen |= bool(np.abs(d).min() > 0.05 and (np.ptp(w) == 0.0 or np.ptp(i) == 0.0))
        sd = math.hypot(0.05 * max(abs(d.mean()), abs(w.mean()), abs(i.mean())), 0.02)
        off = (i.mean() - (d.mean() - w.mean())) / sd
        well = (1.0 - 1e-3) * math.exp(-0.5 * off**2) / (sd * math.sqrt(2.0 * math.pi))
        p_motor = max(p_motor, 0.5e-3 / (well + 0.5e-3))
    return (0.0, 1.0) if frozen else (p_motor, 0.0)


class Draws(NamedTuple):
    """Initial states of the particles in a forecast, one row for each particle."""

    rate: np.ndarray
    speed: np.ndarray
    slips: np.ndarray
    holes: np.ndarray
    excess: np.ndarray
    steeper: np.ndarray
    stalled: np.ndarray


class PlainMonitor:
    """The monitor: P(stuck) and P(buried) within 4 s from 60 particles, the causes, and the rate of digging."""

    def __init__(self, radii, pulls, sinkage, buried, no_load_rate, stall_current, gravity=9.81):
        self.r, self.pulls, self.sinkage, self.buried = np.array(radii), np.array(pulls), sinkage, buried
        self.full, self.gravity = (1.0, no_load_rate, stall_current), gravity
        slips = np.linspace(-1.0, 1.0, len(pulls))
        self.pull_slopes = np.gradient(self.pulls, slips)
        self.chance, self.rows, self.samples = Chance(1181783497276652981), [], 0
        self.holes = np.zeros((len(self.r), len(RATES)))
        self.evidence, self.by_way = np.zeros(len(RATES)), np.zeros(len(RATES))
        self.smoothed = self.p_stuck = self.p_buried = self.motor = self.sensor = 0.0
        self.alarm, self.causes = False, np.zeros(3)

    def check(self, duty, rate, current, posture):
        """Return whether all readings are finite; from 20 readings on, look for faults of motors and sensors."""
        if not all(np.isfinite(row).all() for row in (rate, current, posture)):
            self.motor, self.sensor = 0.0, 1.0
            return False
        rows = [np.array(row) / full for row, full in zip((duty, rate, current), self.full, strict=True)]
        self.rows = [*self.rows, rows][-20:]
        if len(self.rows) == 20:
            self.motor, self.sensor = fault_odds(*np.swapaxes(np.array(self.rows), 0, 1))
        return True

    def foresee(self, b):
        """Update the monitor by a belief, which is a namespace with `under`, `rim`, `told`, `weight`, `travel`, `slip`
        and others.
        """
        self._dig(b)
        if self.samples >= 10 and self.samples % 2 == 0:
            self._look_ahead(b)
        self.samples += 1
        self.smoothed += DT / 0.3 * (self.p_stuck - self.smoothed)
        self.alarm = self.smoothed > (0.375 if self.alarm else 0.75)

    def _net(self, b, slips, holes):
        """Return the pull minus the resistance of holes and slopes, divided by the weight."""
        load = np.maximum(b.under["load"], 0.0)
        return load @ (at_slip(self.pulls, slips) - holes / HOLE_LENGTH - b.under["slope"]) / max(load.sum(), 1e-9)

    def _dig(self, b):
        travel = (b.speed + b.under["ahead"]) / np.maximum(b.under["level"], 0.3)
        for r, c_d in enumerate(RATES):
            self.holes[:, r] += DT * deepening(c_d, travel, b.rim, self.r, self.holes[:, r])
        self.holes = np.maximum(self.holes, 0.0)
        if self.samples < 10:
            return
        net = np.array([self._net(b, b.told[:, 0], self.holes[:, r]) for r in range(len(RATES))])
        log = np.log(np.exp(-0.5 * net**2 / (0.03**2 + b.bend**2 + b.wall**2)) + 0.05)
        moving = min(max(b.speed / max(b.pace, 0.002), 0.0), 1.0)
        for evidence, dt in ((self.evidence, DT), (self.by_way, moving * DT)):
            evidence *= 1.0 - dt / 25.0
            evidence += log * dt / 0.5

    def rates(self, evidence):
        odds = PRIOR * np.exp(evidence - evidence.max())
        return odds / odds.sum()

    def _look_ahead(self, b):
        self.causes, self.p_buried = np.zeros(3), 0.0
        self.p_stuck = b.stuck if b.pace < -0.002 else 0.0
        if b.pace < 0.002 or not np.maximum(b.under["load"], 0.0).sum() > 0.0:
            return
        draws = self._draws(b)
        stuck, depth = self._ahead(b, draws)
        free = stuck & self._ahead(b, draws, wall=0.0)[0]
        firm = stuck & self._ahead(b, draws, wall=0.0, hole=0.0)[0]
        self.p_stuck = stuck.mean()
        under, rate = self.sinkage / self.r.min() + depth > self.buried, draws.rate
        shares, diggers = self.rates(self.by_way), rate > 0
        self.p_buried = 0.0
        for at, share in enumerate(shares):
            is_here = rate == at
            if not is_here.any():
                is_here = diggers if at else is_here
            self.p_buried += share * under[is_here].mean() if is_here.any() else 0.0
        if self.p_stuck >= 0.2:
            grip = min(firm.sum(), free.sum())
            self.causes = np.array([grip, free.sum() - grip, stuck.sum() - free.sum()]) / DRAWS

    def _draws(self, b):
        """Draw particles and rates of digging in proportion to their weights, the rates in shuffled order."""
        offset, order = self.chance.next(), list(range(DRAWS))
        for k in range(DRAWS - 1, 0, -1):
            second = int(self.chance.next() * (k + 1))
            order[k], order[second] = order[second], order[k]
        rates, draws = self.rates(self.evidence), []
        for k in range(DRAWS):
            particle = int(np.searchsorted(np.cumsum(b.weight), (k + offset) / DRAWS * b.weight.sum()))
            rate = int(np.searchsorted(np.cumsum(rates), (order[k] + offset) / DRAWS * rates.sum()))
            distant, turn = self.chance.next(), self.chance.next()
            steeper = 0.01 * math.sqrt(-2.0 * math.log(1.0 - distant)) * math.cos(2.0 * math.pi * turn)
            slips, holes = b.slip[:, particle], self.holes[:, rate]
            excess = self._net(b, slips, holes)
            stalled = bool(b.stalled[particle]) or bool(b.no_progress)
            speed = min(max(b.travel[particle], 0.0), b.pace)
            draws.append((rate, speed, slips, holes, excess, steeper, stalled))
        return Draws(*(np.array(column) for column in zip(*draws, strict=True)))

    def _ahead(self, b, draws, wall=1.0, hole=1.0):
        """Return, for each particle, whether the rover is stuck after 4 s, and the depth of its deepest hole divided by
        r.

        The method is linearly implicit Euler in speed and slips. `wall` and `hole` are factors on the resistance of the
        obstacle and on the depth of the holes.
        """
        n, rim, slope = len(self.r), b.rim, b.under["slope"]
        level, load = np.maximum(b.under["level"], 0.3), np.maximum(b.under["load"], 0.0)
        share = load / max(load.sum(), 1e-4)
        u, s, D, way = draws.speed.copy(), draws.slips.copy(), hole * draws.holes, np.zeros(DRAWS)
        dt, inside = STEP, np.arange(1, n + 1)
        for step in range(STEPS):
            v = u[:, None] / level
            rolling = np.maximum(np.abs(rim), v)
            pull, rise = at_slip(self.pulls, s), at_slip(self.pull_slopes, s)
            resisting = wall * draws.excess * np.exp(-way / self.r.mean()) + draws.steeper * dt * step
            # One linear system for the changes of the speed and of all slips: the speed changes by the pull at the new
            # slips, and each slip changes by the new speed and the new slip.
            A, right = np.zeros((DRAWS, n + 1, n + 1)), np.zeros((DRAWS, n + 1))
            right[:, 0] = dt * self.gravity * ((pull - D / HOLE_LENGTH - slope) @ share - resisting)
            right[:, 1:] = dt * (rim - v - rolling * s) / SLIP_LENGTH
            A[:, 0, 0], A[:, 0, 1:] = 1.0, -dt * self.gravity * share * rise
            A[:, 1:, 0] = dt / (SLIP_LENGTH * level)
            A[:, inside, inside] = 1.0 + dt * rolling / SLIP_LENGTH
            change = np.linalg.solve(A, right[..., None])[:, 0, 0]
            # Where the pull falls with the slip, the feedback is taken at the old speed, because its sign would undo
            # the damping.
            damped = right[:, 1:] / A[:, inside, inside]
            feedback = (rise * dt / (A[:, inside, inside] * SLIP_LENGTH * level)) @ share
            change = np.where(feedback < 0.0, right[:, 0] - np.sum(A[:, 0, 1:] * damped, axis=1), change)
            u_next = np.clip(u + change, 0.0, 1.1 * b.pace) * (1.0 - wall * draws.stalled)
            s = np.clip(s + damped - A[:, 1:, 0] / A[:, inside, inside] * (u_next - u)[:, None], -1.0, 1.0)
            c_d = hole * RATES[draws.rate][:, None]
            D = np.maximum(D + dt * deepening(c_d, u_next[:, None] / level, rim, self.r, D), 0.0)
            u, way = u_next, way + dt * u_next
        return u < 0.1 * max(b.pace, 1e-4), np.max(D / self.r, axis=1)

    @property
    def cause(self):
        """The most likely cause: 0 grip lost, 1 digging, 2 wall, 3 motor, 4 sensor, 5 cannot tell, -1 none."""
        if max(self.motor, self.sensor) > 0.5:
            return 3 if self.motor >= self.sensor else 4
        if self.p_stuck < 0.2:
            return -1
        best = int(np.argmax(self.causes))
        return best if self.causes[best] > 0.5 * self.p_stuck else 5
