"""Laws of structural components as rules: a point walks along segments from corner to corner.

A path is written in the coordinates of its direction s: (s x, s f). It lists the segments ahead, each by its end and
its force; what stands behind a `yield` happens where its end is passed.
"""

from math import expm1, inf

import numpy as np


class Walk:
    """A point, its energy with what was stored at first and the least so far, and what it remembers on both sides."""

    pinch_force = K = r = cap_input = 1.0
    unloading = capping_ratio = residual = s = side = S = Lambda_s = Lambda_c = Lambda_k = Lambda_a = 0.0

    def __init__(self, path, x, f, numbers):
        vars(self).update(numbers, path=path, x=x, f=f, work=f * f / 2.0, least=f * f / 2.0)
        self.X, self.F, self.R, self.last = [1.0] * 3, [1.0] * 3, [1.0] * 3, [(0.0, 0.0)] * 3

    def to(self, goal):
        s = 1 if goal > self.x else -1
        if s != self.s and goal != self.x:
            self.s, self.end, self.ahead = s, -inf, self.path(self, s, s * self.x, s * self.f)
        while goal != self.x:
            if self.end > s * self.x:
                x, f = s * min(self.end, s * goal), self.f
                self.f, run = s * self.force(s * x), x - self.x
                at_zero = self.work + run * f * f / (f - self.f) / 2.0 if f * self.f < 0.0 else inf
                self.work, self.x = self.work + run * (f + self.f) / 2.0, x
                self.least = min(self.least, self.work, at_zero)
            else:
                self.end, self.force = next(self.ahead)
        return self.f


def line(x0, f0, slope):
    return lambda x: f0 + slope * (x - x0)


def corners(x, f, points, slope):
    """Segments from (x, f) to those of the points that lie ahead, and on with a slope."""
    for px, pf in points:
        if px > x:
            yield px, line(x, f, (pf - f) / (px - x))
            x, f = px, pf
    yield inf, line(x, f, slope)


def bilinear(w, s, x, z):
    w.r = max(w.r, abs(z))
    return corners(x, z, [(x + w.r - z, w.r)], w.isotropic)


def flag(w, s, x, z):
    low = w.loss - 1.0
    above = [(low + x - z, low), (low, low), (1.0, 1.0)]
    return corners(x, z, above if z > x else [(1.0 + x - z, 1.0)], 0.0)


def rod(w, s, x, f):
    w.X[1] = max(w.X[1], s * x)
    loose = (1.0 - w.hardening_ratio) * (w.X[1] - 1.0)
    points = [(loose, 0.0), (w.X[1], w.X[1] - loose)] if s > 0 else [(-loose, 0.0)]
    return corners(x, f, points, w.hardening_ratio if s > 0 else 0.0)


def origin(w, s, x, z):
    w.X[-s] = max(w.X[-s], -x)
    return corners(x, z, [(0.0, 0.0), (w.X[s], 1.0)], 0.0)


def lost(w, K):
    energy = w.area - w.tip[1] ** 2 / (2.0 * K) if K else 0.0
    return energy if energy > 1e-12 * w.area else 0.0


def share(w, capacity, energy, spent):
    rest = capacity / w.yield_input - spent
    return 0.0 if not capacity * energy else 1.0 if energy >= rest else (energy / rest) ** w.c


def excursion(w, s, x, f):
    """The laws with peaks; X and last are the largest peak and the last one, F and R what is left of both strengths."""
    if w.side == -s:
        if -x > w.tip[0]:
            w.tip, w.area, w.X[-s] = (-x, -f), w.work - w.before, max(w.X[-s], -x)
        (tip, high), X, energy = w.tip, w.X[-s], lost(w, w.K)
        K = w.K * (1.0 - share(w, w.Lambda_k, energy, w.S + energy))
        slope = max(K, high / (tip - w.begin), high * high / (2.0 * w.area)) if high else 1.0
        slope = max(X**-w.unloading, (1.0 + w.hardening_ratio * (X - 1.0)) / X) if w.unloading else slope
        x, f = high / slope - tip, 0.0
        yield x, line(x, 0.0, slope)
        w.K, w.last[-s], energy = K, w.tip, lost(w, slope)
        w.S += energy
        beta = [share(w, capacity, energy, w.S) for capacity in (w.Lambda_s, w.Lambda_c, w.Lambda_a)]
        w.F[s], w.R[s], w.X[s] = w.F[s] * (1.0 - beta[0]), w.R[s] * (1.0 - beta[1]), w.X[s] * (1.0 + beta[2])
        if max(beta) == 1.0:
            w.path = lambda w, s, x, f: corners(x, 0.0, [], 0.0)
            yield inf, line(x, 0.0, 0.0)
    if w.side != s:
        w.side, w.begin, w.tip, w.area, w.before, w.plan = s, x, (x, 0.0), 0.0, w.work, loading(w, s, x)
    yield from corners(x, f, [w.tip, *w.plan[0]], w.plan[1])


def loading(w, s, begin):
    """The corners of a path that begins at f = 0, and its last slope."""
    X, a, down, low, cap = w.X[s], w.hardening_ratio, w.capping_ratio, w.residual, w.cap_input / w.yield_input
    F, R = max(low, w.F[s]), w.R[s] * (1.0 + a * (cap - 1.0) + down * cap) if down else inf
    high = max(low, min(F * (1.0 + a * (X - F)), R - down * X))
    pinch = (1.0 - w.pinch_input) * (X - high / w.K) if w.K and w.pinch_force < 1.0 else begin
    at = (pinch, w.pinch_force * high * (pinch - begin) / (X - begin)) if begin < pinch else (begin, 0.0)
    run, rise, further = w.last[s][0] - at[0], w.last[s][1] - at[1], high - at[1]
    steeper = run > 0.0 < rise < further and rise / run > further / (X - at[0])
    points = [at, w.last[s] if steeper else at, (X, high)]
    if not down:
        return points, F * a
    cap = (R - F + a * F * F) / (F * a + down)
    return [*points, (cap, max(low, R - down * cap)), ((R - low) / down, low)], 0.0


def envelope(w, v):
    top = min(abs(v), w.peak_input)
    force = (w.knee_input + w.r_1 * top) * -expm1(-top / w.knee_input) + w.r_2 * (abs(v) - top)
    return max(0.0, force) if v > 0.0 else -max(0.0, force)


def crossing(g, low, high):
    """Where a function comes to zero from below, at most `high`."""
    for _ in range(100):
        v = (low + high) / 2.0
        low, high = (v, high) if g(v) < 0.0 else (low, v)
    return high


def nail_path(w, s):
    """The input D at which an excursion of Folz and Filiatrault comes to the envelope, and its path."""
    pinched = line(0.0, w.pinch_input, w.r_4)
    D = w.beta * w.last[s][0] or crossing(lambda v: envelope(w, v) - pinched(v), 0.0, w.peak_input)
    again = line(D, envelope(w, D), min(1.0, (w.knee_input / D) ** w.alpha)) if w.last[s][0] else pinched
    return D, lambda v: min(envelope(w, D), max(pinched(v), again(v))) if v < D else envelope(w, v)


def nail(w, s, x, f):
    D, path = nail_path(w, s)
    if w.side == 0:
        yield D, lambda v: envelope(w, v)
    elif w.side == s:
        yield w.tip[0], line(*w.tip, w.r_3)
    else:
        w.tip = max(w.tip, (-x, -f))
        down = line(-w.tip[0], -w.tip[1], w.r_3)
        far = x + (envelope(w, w.peak_input) - down(x)) / w.r_3
        yield crossing(lambda v: down(v) - path(v), x, far), down
        if w.tip[0] > nail_path(w, -s)[0]:
            w.last[-s] = w.tip
    w.side, w.tip = s, w.tip if w.side == s else (-inf, 0.0)
    yield inf, path


NAMES = [
    "Bilinear",
    "FlagShape",
    "Slack",
    "OriginOriented",
    "PeakOriented",
    "IbarraMedinaKrawinkler",
    "FolzFiliatrault",
]
PATHS = dict(zip(NAMES, (bilinear, flag, rod, origin, excursion, excursion, nail), strict=True))


def walked(law, u):
    """Output of a law by its rule, and the walks of which it is the sum."""
    n, path, walks = dict(law.scalars), PATHS[type(law).__name__], []
    n |= {"yield_input": min(n["yield_input"], n["cap_input"])} if n.get("capping_ratio", 0.0) > 0.0 else {}
    unit, k, slack = n.get("yield_input", n.get("activation", 1.0)), n.get("hardening", 0.0), n.get("slack", 0.0)
    y = n.get("offset", 0.0) + k * u
    for sign, stiffness in [(1.0, n["stiffness"]), (-1.0, n.get("opposite_stiffness"))][: 1 + (path is rod)]:
        x = ((sign * u - slack) / unit).tolist()
        begin, f = (x[0] if path is bilinear else -slack / unit), n.get("z0", 0.0)
        f = max(0.0, min(begin, 1.0 + n["hardening_ratio"] * (begin - 1.0))) if path is rod else f
        walks.append(Walk(path, begin, f, n))
        y = y + sign * (stiffness - k) * unit * np.array([walks[-1].to(each) for each in x])
    return y, walks
