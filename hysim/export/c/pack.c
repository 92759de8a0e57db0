static double @larger(double a, double b)
{
    return a >= b || a != a ? a : b;
}

static double @smaller(double a, double b)
{
    return a <= b || a != a ? a : b;
}

static int @is_negative(double x)
{
    return x < 0.0 || 1.0 / x < 0.0;
}

/* Regularised lower incomplete gamma function P(a, x), a > 0. */
static double @gamma_share(double a, double x)
{
    double shifted = a + 1.0, product = 1.0, term = 1.0, sum = 1.0;
    if (!(x > 0.0)) return x == 0.0 ? 0.0 : NAN;
    if (x - x != 0.0) return 1.0;
    while (shifted < 12.0) {
        product *= shifted;
        shifted += 1.0;
    }
    double r = 1.0 / (shifted * shifted);
    double series = (1.0 / 12.0 - r * (1.0 / 360.0 - r * (1.0 / 1260.0 - r * (1.0 / 1680.0 - r * (1.0 / 1188.0
        - r * (691.0 / 360360.0 - r / 156.0)))))) / shifted;
    double log_gamma = (shifted - 0.5) * log(shifted) - shifted + 0.91893853320467274 + series - log(product);
    double front = exp(a * log(x) - x - log_gamma);
    if (x < a + 1.0) {
        for (int k = 1; k < 10000 && term > 1e-17 * sum; k++) {
            term *= x / (a + k);
            sum += term;
        }
        return front * sum;
    }
    double b = x + 1.0 - a, c = 1e300, d = 1.0 / b, fraction = d;
    for (int k = 1; k < 10000; k++) {
        double numerator = -k * (k - a);
        b += 2.0;
        d = numerator * d + b;
        d = 1.0 / (d == 0.0 ? 1e-300 : d);
        c = b + numerator / c;
        c = c == 0.0 ? 1e-300 : c;
        fraction *= c * d;
        if (fabs(c * d - 1.0) < 1e-16) break;
    }
    return 1.0 - front * a * fraction;
}
