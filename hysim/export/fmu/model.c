/* The model of a functional mock-up unit, whatever the version of FMI: its numbers, and the order in which the step's
   functions are called. All that changes stands in one struct of doubles, so that saving it is one memcpy. */

#if defined(_WIN32) || defined(__CYGWIN__)
#define FMU_VISIBLE __declspec(dllexport)
#elif defined(__GNUC__)
#define FMU_VISIBLE __attribute__((visibility("default")))
#else
#define FMU_VISIBLE
#endif
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter" /* FMI fixes the arguments of its functions */
#endif
#define FMU_JOINED_(a, b) a##b
#define FMU_JOINED(a, b) FMU_JOINED_(a, b)

/* Value references: the time, the inputs, the output, the input at the start, the sample time, the fields. */
enum {
    FMU_TIME = 0,
    FMU_FIRST_INPUT = 1,
    FMU_OUTPUT = FMU_FIRST_INPUT + FMU_INPUTS,
    FMU_START_INPUT = FMU_OUTPUT + 1,
    FMU_SAMPLE = FMU_START_INPUT + 1,
    FMU_FIRST_FIELD = FMU_SAMPLE + 1
};
enum { FMU_INSTANTIATED, FMU_INITIALIZING, FMU_STEPPING, FMU_TERMINATED };

typedef struct {
    double phase;
    double time;
    double start_time;
    double samples; /* sampling instants so far */
    double is_stale; /* a field was changed since the parameters were packed */
    double inputs[FMU_INPUTS];
    double output;
    double start_input;
    double fields[FMU_AT_LEAST_1(FMU_FIELDS)];
    double parameters[FMU_AT_LEAST_1(FMU_PARAMETERS)];
    double state[FMU_AT_LEAST_1(FMU_STATE)];
} FmuModel;

typedef struct {
    double token[2]; /* of this model: a state of another one is refused */
    FmuModel model;
} FmuSaved;

static void fmu_reset(FmuModel *m)
{
    memset(m, 0, sizeof *m);
    memcpy(m->fields, FMU_FIELD_VALUES, sizeof m->fields);
    memcpy(m->inputs, FMU_INPUT_VALUES, sizeof m->inputs);
    m->start_input = FMU_START_VALUE;
}

/* Parameters and state before the first communication step: a model has rested at the start input if it can. */
static void fmu_begin(FmuModel *m)
{
    memcpy(m->parameters, FMU_PARAMETER_VALUES, sizeof m->parameters);
    memcpy(m->state, FMU_STATE_VALUES, sizeof m->state);
    FMU_PACK(m->fields, m->parameters, m->state);
    FMU_BEGIN(m->parameters, m->state, m->start_input);
#ifdef FMU_RESTS
    (void)FMU_STEP(m->parameters, m->state, &m->start_input);
#endif
    m->samples = 0.0;
    m->is_stale = 0.0;
}

#if FMU_IS_TUNABLE
/* Changed fields become parameters; the memory stays as it is. */
static void fmu_repack(FmuModel *m)
{
    double memory[FMU_MEMORY];

    memcpy(memory, m->state, sizeof memory);
    memcpy(m->state, FMU_STATE_VALUES, sizeof m->state);
    FMU_PACK(m->fields, m->parameters, m->state);
    FMU_BEGIN(m->parameters, m->state, memory[0]);
    memcpy(m->state, memory, sizeof memory);
    m->is_stale = 0.0;
}
#endif

/* The output before the first sample is that at the first sample; the state has to begin again afterwards. */
static double fmu_first_output(FmuModel *m)
{
    fmu_begin(m);
    return FMU_STEP(m->parameters, m->state, m->inputs);
}

static const char *fmu_start(FmuModel *m)
{
    m->output = fmu_first_output(m);
    if (!isfinite(m->output))
        return "the output is not finite at the start: check the parameters and the input";
    fmu_begin(m);
    m->time = m->start_time;
    m->phase = FMU_STEPPING;
    return NULL;
}

/* The model through one communication step from time t on; a message where that fails. */
static const char *fmu_advance(FmuModel *m, double t, double h)
{
    int k;

    if (m->phase != FMU_STEPPING)
        return "a step is possible after the initialization only";
    if (!(isfinite(t) && isfinite(h) && h > 0.0))
        return "the communication step must be positive and finite";
    for (k = 0; k < FMU_INPUTS; k++)
        if (!isfinite(m->inputs[k]))
            return "the input must be finite";
#if FMU_IS_TUNABLE
    if (m->is_stale != 0.0)
        fmu_repack(m);
#endif
#ifdef FMU_SAMPLE_TIME
    while (m->start_time + m->samples * FMU_SAMPLE_TIME < t + h - 1e-6 * FMU_SAMPLE_TIME) {
        m->output = FMU_STEP(m->parameters, m->state, m->inputs);
        m->samples += 1.0;
    }
#else
    m->output = FMU_STEP(m->parameters, m->state, m->inputs);
#endif
    m->time = t + h;
    return isfinite(m->output) ? NULL : "the output is not finite: the model diverges";
}

static const char *fmu_set(FmuModel *m, unsigned int reference, double value)
{
    if (reference >= FMU_FIRST_INPUT && reference < FMU_OUTPUT) {
        m->inputs[reference - FMU_FIRST_INPUT] = value;
        return NULL;
    }
#ifdef FMU_HAS_START
    if (reference == FMU_START_INPUT) {
        if (m->phase >= FMU_STEPPING)
            return "the input at the start can be set before the end of the initialization only";
        if (!isfinite(value))
            return "the input at the start must be finite";
        m->start_input = value;
        return NULL;
    }
#endif
#if FMU_FIELDS > 0
    if (reference >= FMU_FIRST_FIELD && reference - FMU_FIRST_FIELD < FMU_FIELDS) {
        const unsigned int k = reference - FMU_FIRST_FIELD;

        if (m->phase >= FMU_STEPPING && !FMU_IS_TUNABLE)
            return "a parameter can be set before the end of the initialization only";
        if (!isfinite(value))
            return "a parameter must be finite";
        m->fields[k] = value;
        m->is_stale = 1.0;
        return NULL;
    }
#endif
    return "there is no variable with this reference that can be set";
}

static const char *fmu_get(FmuModel *m, unsigned int reference, double *value)
{
    if (reference == FMU_TIME)
        *value = m->phase < FMU_STEPPING ? m->start_time : m->time;
    else if (reference < FMU_OUTPUT)
        *value = m->inputs[reference - FMU_FIRST_INPUT];
    else if (reference == FMU_OUTPUT)
        *value = m->phase < FMU_STEPPING ? fmu_first_output(m) : m->output;
#ifdef FMU_HAS_START
    else if (reference == FMU_START_INPUT)
        *value = m->start_input;
#endif
#ifdef FMU_SAMPLE_TIME
    else if (reference == FMU_SAMPLE)
        *value = FMU_SAMPLE_TIME;
#endif
#if FMU_FIELDS > 0
    else if (reference >= FMU_FIRST_FIELD && reference - FMU_FIRST_FIELD < FMU_FIELDS)
        *value = m->fields[reference - FMU_FIRST_FIELD];
#endif
    else
        return "there is no variable with this reference";
    return NULL;
}

static FmuSaved *fmu_save(const FmuModel *m, FmuSaved *saved)
{
    const double token[2] = FMU_TOKEN_NUMBERS;

    if (saved == NULL)
        saved = (FmuSaved *)malloc(sizeof *saved);
    if (saved != NULL) {
        memcpy(saved->token, token, sizeof token);
        memcpy(&saved->model, m, sizeof *m);
    }
    return saved;
}

static const char *fmu_restore(FmuModel *m, const FmuSaved *saved)
{
    const double token[2] = FMU_TOKEN_NUMBERS;

    if (saved == NULL || memcmp(saved->token, token, sizeof token) != 0)
        return "the state is not one of this model";
    memcpy(m, &saved->model, sizeof *m);
    return NULL;
}

static const char *fmu_from_bytes(const char *bytes, size_t size, FmuSaved **saved)
{
    const double token[2] = FMU_TOKEN_NUMBERS;

    if (bytes == NULL || size != sizeof **saved || memcmp(bytes, token, sizeof token) != 0)
        return "the bytes are not a state of this model";
    if (*saved == NULL)
        *saved = (FmuSaved *)malloc(sizeof **saved);
    if (*saved == NULL)
        return "there is not enough memory for a state";
    memcpy(*saved, bytes, size);
    return NULL;
}
