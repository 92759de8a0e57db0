/* The method "split" of hysim.kernels.oscillator for n = 1 in plain C, as a yardstick. */
#include <math.h>

typedef struct { double mobility, damping, stiffness, A, beta, gamma; } Plant;
typedef struct { double y, v, z, work, damped, taken; } State;

static double flow(double w, double a, double c, double length, double *left) {
    double slope = a - c * w, x = c * length;
    *left = 0.0;
    if (a < 0.0 && slope < 0.0) {
        double ratio = c * w / a;
        double to_zero = fabs(ratio) > 0x1p-54 ? -log1p(-ratio) / -c : -w / a;
        if (length >= to_zero) {
            *left = length - to_zero;
            return 0.0;
        }
    }
    if (fabs(x) < 0x1p-54) return w + slope * length;
    if (x < -709.0) return slope > 0.0 ? INFINITY : w;
    return w - slope * expm1(-x) / c;
}

static double relaxed(double z, double du, const Plant *p) {
    double direction = copysign(1.0, du), left;
    return direction * flow(direction * z, p->A, direction * z >= 0.0 ? p->beta + p->gamma : p->beta - p->gamma,
                            fabs(du), &left);
}

static double memory(double z, double du, const Plant *p) {
    if (du == 0.0) return z;
    double direction = copysign(1.0, du), w = fabs(z), length = fabs(du), side = 1.0;
    int loading = direction * z > 0.0 || (z == 0.0 && p->A > 0.0);
    for (int pass = 0; pass < 2; pass++) {
        side = loading ? 1.0 : -1.0;
        w = flow(w, side * p->A, loading ? p->beta + p->gamma : p->beta - p->gamma, length, &length);
        if (length == 0.0 || p->A == 0.0) break;
        loading = !loading;
    }
    return direction * side * w;
}

static double acceleration(double F, double y, double v, double z, const Plant *p) {
    return (F - p->damping * v - p->stiffness * y - z) * p->mobility;
}

static double place(double f0, double d0, double f1, double d1, double length) {
    double b = length * d0, c = 3.0 * (f1 - f0) - length * (2.0 * d0 + d1), d = 2.0 * (f0 - f1) + length * (d0 + d1);
    double side = copysign(1.0, f1), low = 0.0, high = 1.0;
    double s = f0 * side < 0.0 ? f0 / (f0 - f1) : 0.5;
    for (int k = 0; k < 30; k++) {
        double value = f0 + s * (b + s * (c + s * d)), slope = b + s * (2.0 * c + 3.0 * s * d);
        if (value * side < 0.0) low = s; else high = s;
        double target = slope != 0.0 ? s - value / slope : -1.0;
        if (!(low < target && target < high)) target = 0.5 * (low + high);
        double moved = fabs(target - s);
        s = target;
        if (moved < 1e-8) break;
    }
    return s * length;
}

static double dip(double v0, double a0, double v1, double a1, double length) {
    if (!(a0 * v0 < 0.0 && a1 * v1 > 0.0 && v0 * v1 > 0.0)) return length;
    double b = length * a0, c = 3.0 * (v1 - v0) - length * (2.0 * a0 + a1), d = 2.0 * (v0 - v1) + length * (a0 + a1);
    double root = c * c - 3.0 * b * d;
    if (root <= 0.0) return length;
    double s = -b / (c + copysign(sqrt(root), -b));
    if (!(0.0 < s && s < 1.0) || v0 * (v0 + s * (b + s * (c + s * d))) >= 0.0) return length;
    return s * length;
}

#define STAGE(i, dy, dv, dz, share)                                          \
    double y##i = x.y + q * (dy), v##i = x.v + q * (dv), z##i = x.z + q * (dz); \
    double a##i = acceleration(F + dF * (share), y##i, v##i, z##i, p), r##i = v##i * (p->A - C * side * z##i);

static State smooth_step(State x, double F, double dF, double h, double a1, double r1, double side, double C,
                         const Plant *p) {
    double v1 = x.v, z1 = x.z, q = h / 3.0;
    STAGE(2, v1, a1, r1, 1.0 / 3.0)
    q = h * 2.0 / 3.0;
    STAGE(3, v2, a2, r2, 2.0 / 3.0)
    q = h / 12.0;
    STAGE(4, v1 + 4.0 * v2 - v3, a1 + 4.0 * a2 - a3, r1 + 4.0 * r2 - r3, 1.0 / 3.0)
    q = h / 16.0;
    STAGE(5, 18.0 * v2 - v1 - 3.0 * v3 - 6.0 * v4, 18.0 * a2 - a1 - 3.0 * a3 - 6.0 * a4,
          18.0 * r2 - r1 - 3.0 * r3 - 6.0 * r4, 0.5)
    q = h / 8.0;
    STAGE(6, 9.0 * v2 - 3.0 * v3 - 6.0 * v4 + 4.0 * v5, 9.0 * a2 - 3.0 * a3 - 6.0 * a4 + 4.0 * a5,
          9.0 * r2 - 3.0 * r3 - 6.0 * r4 + 4.0 * r5, 0.5)
    q = h / 44.0;
    STAGE(7, 9.0 * v1 - 36.0 * v2 + 63.0 * v3 + 72.0 * v4 - 64.0 * v6,
          9.0 * a1 - 36.0 * a2 + 63.0 * a3 + 72.0 * a4 - 64.0 * a6,
          9.0 * r1 - 36.0 * r2 + 63.0 * r3 + 72.0 * r4 - 64.0 * r6, 1.0)
    q = h / 120.0;
    double halfway = F + 0.5 * dF;
    x.y += q * (11.0 * (v1 + v7) + 81.0 * (v3 + v4) - 32.0 * (v5 + v6));
    x.v += q * (11.0 * (a1 + a7) + 81.0 * (a3 + a4) - 32.0 * (a5 + a6));
    x.z += q * (11.0 * (r1 + r7) + 81.0 * (r3 + r4) - 32.0 * (r5 + r6));
    x.work += q * (11.0 * (F * v1 + (F + dF) * v7) - 32.0 * halfway * (v5 + v6) +
                   81.0 * ((F + dF * 2.0 / 3.0) * v3 + (F + dF / 3.0) * v4));
    x.damped += q * p->damping * (11.0 * (v1 * v1 + v7 * v7) + 81.0 * (v3 * v3 + v4 * v4) - 32.0 * (v5 * v5 + v6 * v6));
    x.taken += q * (11.0 * (z1 * v1 + z7 * v7) + 81.0 * (z3 * v3 + z4 * v4) - 32.0 * (z5 * v5 + z6 * v6));
    return x;
}

static State split(State x, double F, double slope, double length, const Plant *p) {
    double left = length, reach = length;
    for (int piece = 0; piece < 1000; piece++) {
        double h, shorter = reach < left ? reach : left, a = acceleration(F, x.y, x.v, x.z, p);
        double ahead = x.v + 1e-6 * shorter * a;
        double forward = copysign(1.0, ahead != 0.0 ? ahead : slope);
        ahead = x.z + 1e-3 * shorter * p->A * x.v;
        double side = copysign(1.0, ahead != 0.0 ? ahead : p->A * forward);
        double C = p->gamma + p->beta * forward * side, r = x.v * (p->A - C * side * x.z);
        int trials = piece < 999 ? 60 : 1, last = trials == 1;
        State t;
        do {
            h = shorter;
            t = smooth_step(x, F, slope * h, h, a, r, side, C, p);
            double a1 = acceleration(F + slope * h, t.y, t.v, t.z, p), r1 = t.v * (p->A - C * side * t.z);
            shorter = dip(x.v, a, t.v, a1, h);
            if (forward * t.v < -1e-6 * fabs(t.v - x.v)) shorter = place(x.v, a, t.v, a1, h);
            else if (side * t.z < -1e-3 * fabs(t.z - x.z)) shorter = place(x.z, r, t.z, r1, h);
        } while (--trials > 0 && shorter < h);
        int same_side = side * x.z >= 0.0 && side * t.z >= 0.0;
        double z = same_side ? relaxed(x.z, t.y - x.y, p) : memory(x.z, t.y - x.y, p);
        if (fabs(z - t.z) > 1e-3 * (fabs(z) + fabs(x.z)) && !last) {
            reach = 0.5 * h;
            continue;
        }
        x = t;
        x.z = z;
        if (!(h < left)) break;
        reach *= 2.0;
        F += slope * h;
        left -= h;
    }
    return x;
}

void path(const double *plant, int substeps, double sample_time, const double *force, long n_samples, double *out) {
    const Plant p = {1.0 / plant[0], plant[1], plant[2], plant[3], plant[4], plant[5]};
    State x = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    out[0] = 0.0;
    for (long k = 1; k < n_samples; k++) {
        double rise = force[k] - force[k - 1];
        for (int j = 0; j < substeps; j++)
            x = split(x, force[k - 1] + rise * j / substeps, rise / sample_time, sample_time / substeps, &p);
        out[k] = x.y;
    }
}
