/* The driven law in plain C, as a yardstick: the exact step for n = 1 and n = 2, and Runge-Kutta 4 for any n.
   An escape to infinity is not looked for. */
#include <math.h>

typedef struct { double A, beta, gamma, n; } Law;

/* w' = a - c w over `length` from w >= 0; what is left of it at w = 0 goes to `left`. */
static double flow1(double w, double a, double c, double length, double *left) {
    *left = 0.0;
    if (a < 0.0 && a - c * w < 0.0) {
        double to_zero = c != 0.0 ? log1p(-c * w / a) / c : -w / a;
        if (length >= to_zero) {
            *left = length - to_zero;
            return 0.0;
        }
    }
    return c != 0.0 ? w - (a - c * w) * expm1(-c * length) / c : w + a * length;
}

/* w' = a - c w^2 likewise. */
static double flow2(double w, double a, double c, double length, double *left) {
    double product = a * c, root = sqrt(fabs(product)), T = length;
    *left = 0.0;
    if (a < 0.0 && a - c * w * w < 0.0) {
        double t = root * -w / a;
        double to_zero = product < 0.0 ? atan(t) / root : product > 0.0 ? atanh(t) / root : -w / a;
        if (length >= to_zero) {
            *left = length - to_zero;
            return 0.0;
        }
    }
    if (product > 0.0) T = tanh(root * length) / root;
    else if (product < 0.0) T = tan(root * length) / root;
    return w + T * (a - c * w * w) / (1.0 + c * w * T);
}

#define EXACT(name, flow)                                                                        \
    void name(const double *parameters, const double *u, long n_samples, double *out) {          \
        const double A = parameters[0], beta = parameters[1], gamma = parameters[2];             \
        double z = 0.0;                                                                          \
        out[0] = z;                                                                              \
        for (long k = 1; k < n_samples; k++) {                                                   \
            double du = u[k] - u[k - 1], left = fabs(du), w = fabs(z), side;                     \
            if (du != 0.0) {                                                                     \
                double direction = copysign(1.0, du);                                            \
                side = direction * z > 0.0 || (z == 0.0 && A > 0.0) ? 1.0 : -1.0;                \
                w = flow(w, side * A, beta + side * gamma, left, &left);                         \
                if (left > 0.0) {                                                                \
                    side = -side;                                                                \
                    w = flow(w, side * A, beta + side * gamma, left, &left);                     \
                }                                                                                \
                z = direction * side * w;                                                        \
            }                                                                                    \
            out[k] = z;                                                                          \
        }                                                                                        \
    }

EXACT(exact_1, flow1)
EXACT(exact_2, flow2)

static inline double slope(double z, double du, const Law *p) {
    double m = fabs(z), power = p->n == 1.0 ? m : p->n == 2.0 ? m * m : pow(m, p->n);
    return p->A - power * (z * du > 0.0 ? p->gamma + p->beta : p->gamma - p->beta);
}

void runge_kutta(const double *parameters, int substeps, const double *u, long n_samples, double *out) {
    const Law p = {parameters[0], parameters[1], parameters[2], parameters[3]};
    double z = 0.0;
    out[0] = z;
    for (long k = 1; k < n_samples; k++) {
        double du = (u[k] - u[k - 1]) / substeps;
        for (int j = 0; j < substeps; j++) {
            double a = slope(z, du, &p), b = slope(z + 0.5 * du * a, du, &p), c = slope(z + 0.5 * du * b, du, &p);
            z += du / 6.0 * (a + 2.0 * b + 2.0 * c + slope(z + du * c, du, &p));
        }
        out[k] = z;
    }
}
