"""The C of an exported controller, piece by piece: `hysim.kernels.tracking` and what it calls, in C99.

`hysim.control._c_export` prints the numbers of one controller as constants, and takes the pieces that it needs. In
them ``$name`` is the controller's name, and ``@`` marks what depends on its parts. A literal stands in ``R( )``, which
gives it the precision.
"""

HEADER = """\
/* $name: a sampled controller, exported by hysim $version. C99 with math.h, no allocation, no global state.

   Call ${name}_start once, then ${name}_step every ${NAME}_SAMPLE_TIME seconds, with the measurement
   of this moment and the reference ${NAME}_AHEAD samples ahead of it. What it returns is within the
   limits, to be held until the next sample.
   Compile without -ffast-math: the inverse tells rounding from a step. */
#ifndef ${NAME}_H
#define ${NAME}_H

#ifdef __cplusplus
extern "C" {
#endif

typedef $type ${name}_real;

#define ${NAME}_SAMPLE_TIME $sample_time
#define ${NAME}_AHEAD $ahead

typedef struct {
$fields
} ${name}_state;

/* At rest at the command $u0 and the displacement $y0. */
void ${name}_start(${name}_state *state);

/* The command within the limits; state->command is the one before them. */
${name}_real ${name}_step(${name}_state *state, ${name}_real reference, ${name}_real measurement);

#ifdef __cplusplus
}
#endif

#endif
"""

PRELUDE = """\
#include "$name.h"

#include <math.h>

typedef ${name}_real real;
"""

_FUNCTIONS = ("EXP", "LOG", "EXPM1", "LOG1P", "FABS", "FMAX", "FMIN")

MACROS = {
    "double": "#define R(literal) literal\n"
    + "".join(f"#define {name} {name.lower()}\n" for name in _FUNCTIONS)
    + """\
#define EPSILON 2.2204460492503131e-16 /* of 1 */
#define FLAT 1e-12                    /* no slope at all, on the way back */
#define JUST 1e-15                    /* beyond a limit */
#define TINY 1e-300
""",
    "float": "#define R(literal) literal##F\n"
    + "".join(f"#define {name} {name.lower()}f\n" for name in _FUNCTIONS)
    + """\
#define EPSILON 1.19209290e-7F /* of 1 */
#define FLAT 5e-4F             /* no slope at all, on the way back */
#define JUST 5e-7F             /* beyond a limit */
#define TINY 1e-30F
""",
}

CLAMP = """\
static real clamp(real x, real lowest, real highest)
{
    return x < lowest ? lowest : x > highest ? highest : x;
}
"""

ACCUMULATE = """\
/* Add to a sum that takes many small terms: what rounding leaves out is carried to the next. */
static void accumulate(real *sum, real *carry, real term)
{
    real corrected = term - *carry, before = *sum;

    *sum = before + corrected;
    *carry = (*sum - before) - corrected;
}
"""

PUSH = """\
/* Put a value before the others, of which the last one goes. */
static void push(real *ring, int size, real newest)
{
    int i;

    for (i = size - 1; i > 0; i--)
        ring[i] = ring[i - 1];
    ring[0] = newest;
}
"""

DOT = """\
static real dot(const real *weights, const real *values, int size)
{
    real total = R(0.0);
    int i;

    for (i = 0; i < size; i++)
        total += weights[i] * values[i];
    return total;
}
"""

PID = """\
/* Proportional to the weighted error, integral, derivative behind its filter. */
static real pid(${name}_state *s, real target, real measurement)
{
    real seen = DERIVATIVE_WEIGHT * target - measurement;
    real derivative = DERIVATIVE_KEPT * s->derivative + DERIVATIVE_RATE * (seen - s->seen);
    real command = KP * (SETPOINT_WEIGHT * target - measurement) + s->integral + derivative;

    s->derivative = derivative;
    s->seen = seen;
    accumulate(&s->integral, &s->integral_carry, KI_H * (target - measurement));
    return command;
}
"""

BIQUAD = """\
/* (b0 + b1 / z + b2 / z^2) / (1 + a1 / z + a2 / z^2) with c = (b0, b1, b2, a1, a2). */
static real biquad(const real *c, real *state, real x)
{
    real y = c[0] * x + state[0];

    state[0] = c[1] * x - c[3] * y + state[1];
    state[1] = c[2] * x - c[4] * y;
    return y;
}
"""

LINE = """\
static real invert(${name}_state *s, real v, real *reached)
{
    real u = (v - OFFSET) / SLOPE, within = clamp(u, LOWEST_VOLTAGE, HIGHEST_VOLTAGE);

    *reached = within;
    s->level = within == u ? v : OFFSET + SLOPE * within;
    return u;
}
"""

BOUC_WEN = """\
#ifdef __AVR__ /* whose library has no expm1 and no log1p: as exact by Kahan's quotients, which undo the rounding */
static real expm1_of(real x)
{
    real e = EXP(x);

    if (e == R(1.0))
        return x;
    return isinf(e) || e - R(1.0) == R(-1.0) ? e - R(1.0) : (e - R(1.0)) * x / LOG(e);
}

static real log1p_of(real x)
{
    real e = R(1.0) + x;

    return e == R(1.0) ? x : LOG(e) * x / (e - R(1.0));
}

#undef EXPM1
#undef LOG1P
#define EXPM1 expm1_of
#define LOG1P log1p_of
#endif

/* The law dz/du = A - |z| (gamma + beta sign(z du)), y = offset + c1 u + c2 u^2 + ... + gain z, and its inverse.
   Along one direction, H = z sign(du), each side of H = 0 has H' = A - k H, which is solved exactly. */
static real flow(real along, real k, real length)
{
    real slope = A - k * along;

    if (slope == R(0.0))
        return along;
    return along + slope * (k == R(0.0) ? length : -EXPM1(-k * length) / k);
}

/* Length from H to 0. */
static real travel(real along, real k)
{
    real x = k * along / A;

    if (FABS(x) < R(0.25) * EPSILON)
        return -along / A;
    return x < R(1.0) ? LOG1P(-x) / k : INFINITY;
}

/* Memory after the input has moved by du. */
static real advance(real z, real du)
{
    real length = FABS(du), along = du > R(0.0) ? z : -z, after;
    int loading = along > R(0.0) || (along == R(0.0) && A > R(0.0));

    if (du == R(0.0))
        return z;
    after = flow(along, loading ? K_LOADING : K_UNLOADING, length);
    if ((along > R(0.0) && after < R(0.0)) || (along < R(0.0) && after > R(0.0))) {
        length = FMAX(R(0.0), length - travel(along, loading ? K_LOADING : K_UNLOADING));
        after = flow(R(0.0), loading ? K_UNLOADING : K_LOADING, length);
    }
    return du > R(0.0) ? after : -after;
}

static real output(real u, real z)
{
    real total = R(0.0);
    int i;

    for (i = DEGREE - 1; i >= 0; i--)
        total = (total + COEFFICIENTS[i]) * u;
    return OFFSET + total + GAIN * z;
}

static real input_slope(real u)
{
    real total = R(0.0);
    int i;

    for (i = DEGREE - 1; i >= 0; i--)
        total = total * u + (real)(i + 1) * COEFFICIENTS[i];
    return total;
}

static real memory_slope(real z, real direction)
{
    real along = direction * z;

    return GAIN * (A - (along > R(0.0) ? K_LOADING : K_UNLOADING) * along);
}

/* dy/du for an input that moves in this direction, positive where the law can be inverted. */
static real slope(real u, real z, real direction)
{
    return RISING * (input_slope(u) + memory_slope(z, direction));
}

/* What one rounding of the terms of the output amounts to. */
static real rounding(real y, real u, real z)
{
    return EPSILON * (FABS(y) + (FABS(GAIN * z) + FABS(OFFSET) + FABS(u * input_slope(u))));
}

/* Lower bound of the slope from (u, z) to (end, z_end). */
static real lowest_slope(real u, real z, real end, real z_end, real direction)
{
    real memory = FMIN(RISING * memory_slope(z, direction), RISING * memory_slope(z_end, direction));
    real reach = FMAX(FABS(u), FABS(end)), bend = R(0.0);
    int i;

    if (z * z_end < R(0.0))
        memory = FMIN(memory, RISING * memory_slope(R(0.0), direction));
    for (i = DEGREE - 1; i > 0; i--)
        bend = bend * reach + (real)((i + 1) * i) * FABS(COEFFICIENTS[i]);
    return memory + R(0.5) * (RISING * (input_slope(u) + input_slope(end)) - bend * FABS(end - u));
}

static int monotone(real u, real z, real end, real z_end, real direction)
{
    int i;

    if (lowest_slope(u, z, end, z_end, direction) > R(0.0))
        return 1;
    for (i = 0; i <= 16; i++) {
        real point = u + (end - u) * ((real)i / R(16.0));

        if (!(slope(point, advance(z, point - u), direction) > R(0.0)))
            return 0;
    }
    return DEGREE > 1;
}

/* Newton's method inside a bracket: from (u, z), a gap short of y, to the (end, z_end) with the output y. */
static int solve(real u, real z, real y, real direction, real gap, real *end, real *z_end)
{
    real upward = RISING * direction, steepness = slope(u, z, direction), back = slope(u, z, -direction);
    real at_start = rounding(y, u, z), behind = u, beyond = direction * INFINITY;
    real before_last = INFINITY, last = INFINITY, target = u + direction * gap / steepness;
    int i;

    if (!(steepness > R(0.0) && back > -FLAT * steepness))
        return 0;
    for (i = 0; i < 400; i++) {
        real memory, error, noise, move, trial;
        int inside;

        if (isinf(target))
            return 0;
        memory = advance(z, target - u);
        error = upward * (output(target, memory) - y);
        steepness = slope(target, memory, direction);
        noise = FMAX(at_start, rounding(y, target, memory));
        *end = target;
        *z_end = memory;
        if (FABS(error) <= noise && noise < INFINITY)
            return 1;
        if (error < R(0.0) && steepness > R(0.0))
            behind = target;
        else
            beyond = target;
        move = steepness > R(0.0) ? -error / steepness : (real)NAN;
        trial = target + direction * move;
        inside = direction * behind <= direction * trial && direction * trial <= direction * beyond;
        if (!inside || (!isinf(beyond) && FABS(move) > R(0.5) * before_last)) {
            trial = R(0.5) * (behind + beyond);
            move = FABS(trial - target);
        }
        if (trial == behind || trial == beyond || trial == target)
            return FABS(error) <= R(16.0) * (noise + EPSILON * FABS(target) * steepness) && FABS(error) < INFINITY;
        before_last = last;
        last = FABS(move);
        target = trial;
    }
    return 0;
}

/* Input with the output y, to which the law then moves; NAN where there is none, and the law stays. */
static real undo(${name}_state *s, real y)
{
    real upward = y > s->level ? R(1.0) : R(-1.0), direction = RISING * upward;
    real gap = upward * (y - output(s->law_u, s->law_z)), end = s->law_u, z_end = s->law_z;

    if (y == s->level)
        return s->law_u;
    if (!(gap <= R(0.0)) && !(solve(s->law_u, s->law_z, y, direction, gap, &end, &z_end) &&
                             monotone(s->law_u, s->law_z, end, z_end, direction)))
        return (real)NAN;
    s->level = y;
    s->law_u = end;
    s->law_z = z_end;
    return end;
}

/* The same within the limits of the voltage; what is reached there moves the law. */
static real invert(${name}_state *s, real v, real *reached)
{
    real u_before = s->law_u, z_before = s->law_z, level_before = s->level, u = undo(s, v), beyond = u;

    *reached = u;
    if (LOWEST_VOLTAGE <= u && u <= HIGHEST_VOLTAGE)
        return u;
    if (isnan(u))
        beyond = (v > level_before) == (RISING > R(0.0)) ? INFINITY : -INFINITY;
    *reached = clamp(beyond, LOWEST_VOLTAGE, HIGHEST_VOLTAGE);
    s->law_z = advance(z_before, *reached - u_before);
    s->law_u = *reached;
    s->level = output(s->law_u, s->law_z);
    if (!isnan(u))
        return u;
    return *reached + (beyond > R(0.0) ? R(1.0) : R(-1.0)) * (JUST * FABS(*reached) + TINY);
}
"""

UNWIND = [
    "if (limited != given)",
    "    accumulate(&s->integral, &s->integral_carry, UNWINDING * (limited - given));",
]
INVERTED = [
    "u = invert(s, drive * THROUGH, &reached);",
    "s->command += (u - ZERO) / AMPLIFICATION;",
    "given += (reached - ZERO) / AMPLIFICATION;",
]
CREEP_INVERTED = [
    "for (i = 0; i < ELEMENTS; i++)",
    "    drive -= WEIGHTS[i] * (s->positions[i] + POSITION_DECLINES[i] * s->positions[i]);",
    INVERTED[0],
    "for (i = 0; i < ELEMENTS; i++)",
    "    accumulate(&s->positions[i], &s->positions_carry[i],",
    "               POSITION_DECLINES[i] * (s->positions[i] - s->level));",
    *INVERTED[1:],
]

MODEL = """\
/* The plant that the feedback compares with: a linear stage behind the law, and a sensor that is late. */
static real displacement(const ${name}_state *s, real oldest, real older, real newer)
{
    real total = OUTPUT[0] * newer + OUTPUT[1] * older + OUTPUT[2] * oldest;
    int i;

    for (i = 0; i < ORDER; i++)
        total += OUTPUT[3 + i] * s->x[i];
    return total;
}

/* What the model would measure now. */
static real model_reading(${name}_state *s)
{
    push(s->readings, LATE + 1, @newest);
    return s->readings[LATE];
}

static void move_model(${name}_state *s)
{
    real oldest, older, newer, following[ORDER];
    int i, j;

    push(s->past, DEAD + 3, s->level);
    oldest = s->past[DEAD + 2];
    older = s->past[DEAD + 1];
    newer = s->past[DEAD];
@within    for (i = 0; i < ORDER; i++) {
        following[i] = B[ORDER + i] * older + B[i] * newer + B[2 * ORDER + i] * oldest;
        if (i < CREEPING)
            following[i] += DECLINES[i] * s->x[i];
        else
            for (j = 0; j < ORDER; j++)
                following[i] += MOVED[(i - CREEPING) * ORDER + j] * s->x[j];
    }
    for (i = 0; i < ORDER; i++)
        if (i < CREEPING)
            accumulate(&s->x[i], &s->x_carry[i], following[i]);
        else
            s->x[i] = following[i];
}
"""

AT_SAMPLES = {"@newest": "displacement(s, s->past[DEAD + 1], s->past[DEAD], R(0.0))", "@within": ""}
WITHIN = {
    "@newest": "s->readings[LATE + 1]",
    "@within": "    s->readings[LATE + 1] = displacement(s, oldest, older, newer);\n",
}

START = """\
void ${name}_start(${name}_state *state)
{
    static const ${name}_state rest = {
@rest
    };

    *state = rest;
}
"""

STEP = """\
${name}_real ${name}_step(${name}_state *s, ${name}_real reference, ${name}_real measurement)
{
@body
}
"""

SKETCH = """\
/* Arduino sketch around $name. Analogue pins, scales and the reference are placeholders: put in your own. */
#include "$name.h"

static const int SENSOR_PIN = A0;
static const int DRIVE_PIN = DAC0;
static const ${name}_real DISPLACEMENT_PER_COUNT = 1.0; /* [unit of y] */
static const ${name}_real COUNTS_PER_COMMAND = 1.0;     /* [1 / unit of u] */
static const int HIGHEST_COUNT = 4095;
static const unsigned long PERIOD = $period; /* microseconds */

static ${name}_state state;
static unsigned long due, sample;

/* The reference at a sample, [unit of y]. */
static ${name}_real reference_at(unsigned long k)
{
    (void)k;
    return 0.0;
}

/* One sample. Polling micros() jitters: for a steady tick call this from the interrupt of a hardware timer
   with the period above, and make sure that it ends before the next. */
static void tick(void)
{
    ${name}_real measurement = DISPLACEMENT_PER_COUNT * (${name}_real)analogRead(SENSOR_PIN);
    ${name}_real command = ${name}_step(&state, reference_at(sample + ${NAME}_AHEAD), measurement);
    ${name}_real count = COUNTS_PER_COMMAND * command;

    analogWrite(DRIVE_PIN, count > 0 ? count < HIGHEST_COUNT ? (int)count : HIGHEST_COUNT : 0);
    sample++;
}

void setup(void)
{
    ${name}_start(&state);
    due = micros();
}

void loop(void)
{
    if ((long)(micros() - due) < 0)
        return;
    due += PERIOD;
    tick();
}
"""
