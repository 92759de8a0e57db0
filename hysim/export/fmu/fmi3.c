/* FMI 3.0 for co-simulation around the model. Types and signatures are those of the standard, version 3.0.2. */

#ifndef FMI3_Export
#define FMI3_Export FMU_VISIBLE
#endif
#if defined(FMI3_FUNCTION_PREFIX) && !defined(FMI3_OVERRIDE_FUNCTION_PREFIX)
#define FMI(name) FMU_JOINED(FMI3_FUNCTION_PREFIX, FMU_JOINED(fmi3, name))
#else
#define FMI(name) FMU_JOINED(fmi3, name)
#endif
#define FMI_STATUS FMI3_Export int

enum { FMI_OK, FMI_WARNING, FMI_DISCARD, FMI_ERROR, FMI_FATAL };

typedef void (*FmiLogger)(void *environment, int status, const char *category, const char *message);
typedef void (*FmiIntermediateUpdate)(void *, double, bool, bool, bool, bool, bool *, double *);
typedef const char *FmiString;
typedef const unsigned char *FmiBinary;

typedef struct {
    FmuModel model;
    FmiLogger logger;
    void *environment;
} FmiInstance;

static int fmi_status(void *component, const char *message)
{
    const FmiInstance *instance = (const FmiInstance *)component;

    if (message == NULL)
        return FMI_OK;
    if (instance->logger != NULL)
        instance->logger(instance->environment, FMI_ERROR, "logStatusError", message);
    return FMI_ERROR;
}

#define FMI_ABSENT(component) fmi_status((component), "this model has no such variables or functions")

FMI3_Export const char *FMI(GetVersion)(void)
{
    return "3.0";
}

FMI_STATUS FMI(SetDebugLogging)(void *component, bool is_on, size_t count, const FmiString categories[])
{
    return FMI_OK; /* errors are always reported, and nothing else is */
}

FMI3_Export void *FMI(InstantiateCoSimulation)(
    const char *name, const char *token, const char *resources, bool is_visible, bool is_logging, bool uses_events,
    bool may_return_early, const unsigned int intermediate[], size_t intermediate_count, void *environment,
    FmiLogger logger, FmiIntermediateUpdate update)
{
    FmiInstance *instance;

    if (token == NULL || strcmp(token, FMU_TOKEN) != 0) {
        if (logger != NULL)
            logger(environment, FMI_ERROR, "logStatusError", "the instantiation token is not the one of this model");
        return NULL;
    }
    instance = (FmiInstance *)calloc(1, sizeof *instance);
    if (instance == NULL)
        return NULL;
    instance->logger = logger;
    instance->environment = environment;
    fmu_reset(&instance->model);
    return instance;
}

FMI3_Export void *FMI(InstantiateModelExchange)(
    const char *name, const char *token, const char *resources, bool is_visible, bool is_logging, void *environment,
    FmiLogger logger)
{
    if (logger != NULL)
        logger(environment, FMI_ERROR, "logStatusError", "this model is one for co-simulation");
    return NULL;
}

FMI3_Export void *FMI(InstantiateScheduledExecution)(
    const char *name, const char *token, const char *resources, bool is_visible, bool is_logging, void *environment,
    FmiLogger logger, void (*update)(void *), void (*lock)(void), void (*unlock)(void))
{
    return FMI(InstantiateModelExchange)(name, token, resources, is_visible, is_logging, environment, logger);
}

FMI3_Export void FMI(FreeInstance)(void *component)
{
    free(component);
}

FMI_STATUS FMI(EnterInitializationMode)(
    void *component, bool has_tolerance, double tolerance, double start_time, bool has_stop_time, double stop_time)
{
    FmuModel *const model = &((FmiInstance *)component)->model;

    model->start_time = start_time;
    model->phase = FMU_INITIALIZING;
    return FMI_OK;
}

FMI_STATUS FMI(ExitInitializationMode)(void *component)
{
    return fmi_status(component, fmu_start(&((FmiInstance *)component)->model));
}

FMI_STATUS FMI(Terminate)(void *component)
{
    ((FmiInstance *)component)->model.phase = FMU_TERMINATED;
    return FMI_OK;
}

FMI_STATUS FMI(Reset)(void *component)
{
    fmu_reset(&((FmiInstance *)component)->model);
    return FMI_OK;
}

FMI_STATUS FMI(GetFloat64)(
    void *component, const unsigned int references[], size_t count, double values[], size_t value_count)
{
    const char *message = count == value_count ? NULL : "each variable of this model is one number";
    size_t k;

    for (k = 0; k < count && message == NULL; k++)
        message = fmu_get(&((FmiInstance *)component)->model, references[k], &values[k]);
    return fmi_status(component, message);
}

FMI_STATUS FMI(SetFloat64)(
    void *component, const unsigned int references[], size_t count, const double values[], size_t value_count)
{
    const char *message = count == value_count ? NULL : "each variable of this model is one number";
    size_t k;

    for (k = 0; k < count && message == NULL; k++)
        message = fmu_set(&((FmiInstance *)component)->model, references[k], values[k]);
    return fmi_status(component, message);
}

/* Functions for variables of other types and for clocks: this model has none of them. */
#define FMI_NONE(name, arguments)                             \
    FMI_STATUS FMI(name) arguments                            \
    {                                                         \
        return count == 0 ? FMI_OK : FMI_ABSENT(component);   \
    }
#define FMI_LIST void *component, const unsigned int references[], size_t count
#define FMI_NO_VARIABLES(name, type)                                       \
    FMI_NONE(Get##name, (FMI_LIST, type values[], size_t value_count))     \
    FMI_NONE(Set##name, (FMI_LIST, const type values[], size_t value_count))

FMI_NO_VARIABLES(Float32, float)
FMI_NO_VARIABLES(Int8, int8_t)
FMI_NO_VARIABLES(UInt8, uint8_t)
FMI_NO_VARIABLES(Int16, int16_t)
FMI_NO_VARIABLES(UInt16, uint16_t)
FMI_NO_VARIABLES(Int32, int32_t)
FMI_NO_VARIABLES(UInt32, uint32_t)
FMI_NO_VARIABLES(Int64, int64_t)
FMI_NO_VARIABLES(UInt64, uint64_t)
FMI_NO_VARIABLES(Boolean, bool)
FMI_NO_VARIABLES(String, FmiString)
FMI_NONE(GetBinary, (FMI_LIST, size_t sizes[], FmiBinary values[], size_t value_count))
FMI_NONE(SetBinary, (FMI_LIST, const size_t sizes[], const FmiBinary values[], size_t value_count))
FMI_NONE(GetClock, (FMI_LIST, bool values[]))
FMI_NONE(SetClock, (FMI_LIST, const bool values[]))
FMI_NONE(GetIntervalDecimal, (FMI_LIST, double intervals[], int qualifiers[]))
FMI_NONE(GetIntervalFraction, (FMI_LIST, uint64_t counters[], uint64_t resolutions[], int qualifiers[]))
FMI_NONE(GetShiftDecimal, (FMI_LIST, double shifts[]))
FMI_NONE(GetShiftFraction, (FMI_LIST, uint64_t counters[], uint64_t resolutions[]))
FMI_NONE(SetIntervalDecimal, (FMI_LIST, const double intervals[]))
FMI_NONE(SetIntervalFraction, (FMI_LIST, const uint64_t counters[], const uint64_t resolutions[]))
FMI_NONE(SetShiftDecimal, (FMI_LIST, const double shifts[]))
FMI_NONE(SetShiftFraction, (FMI_LIST, const uint64_t counters[], const uint64_t resolutions[]))
FMI_NONE(GetOutputDerivatives, (FMI_LIST, const int32_t orders[], double values[], size_t value_count))

/* Functions of other modes, of other kinds of units, and of derivatives: none of them can be called. */
#define FMI_REFUSED(name, arguments)   \
    FMI_STATUS FMI(name) arguments     \
    {                                  \
        return FMI_ABSENT(component);  \
    }

FMI_REFUSED(EnterConfigurationMode, (void *component))
FMI_REFUSED(ExitConfigurationMode, (void *component))
FMI_REFUSED(EnterEventMode, (void *component))
FMI_REFUSED(EnterStepMode, (void *component))
FMI_REFUSED(EvaluateDiscreteStates, (void *component))
FMI_REFUSED(
    UpdateDiscreteStates,
    (void *component, bool *again, bool *ends, bool *nominals, bool *values, bool *has_next, double *next))
FMI_REFUSED(EnterContinuousTimeMode, (void *component))
FMI_REFUSED(CompletedIntegratorStep, (void *component, bool keeps_state, bool *enters_event, bool *ends))
FMI_REFUSED(SetTime, (void *component, double time))
FMI_REFUSED(SetContinuousStates, (void *component, const double states[], size_t count))
FMI_REFUSED(GetContinuousStates, (void *component, double states[], size_t count))
FMI_REFUSED(GetNominalsOfContinuousStates, (void *component, double nominals[], size_t count))
FMI_REFUSED(GetContinuousStateDerivatives, (void *component, double derivatives[], size_t count))
FMI_REFUSED(GetEventIndicators, (void *component, double indicators[], size_t count))
FMI_REFUSED(GetNumberOfContinuousStates, (void *component, size_t *count))
FMI_REFUSED(GetNumberOfEventIndicators, (void *component, size_t *count))
FMI_REFUSED(ActivateModelPartition, (void *component, unsigned int clock, double time))
FMI_REFUSED(GetNumberOfVariableDependencies, (void *component, unsigned int reference, size_t *count))
FMI_REFUSED(
    GetVariableDependencies,
    (void *component, unsigned int dependent, size_t elements[], unsigned int independents[], size_t others[],
     int kinds[], size_t count))
#define FMI_DERIVATIVE                                                                                      \
    (void *component, const unsigned int unknowns[], size_t unknown_count, const unsigned int knowns[],     \
     size_t known_count, const double seed[], size_t seed_count, double sensitivity[], size_t result_count)
FMI_REFUSED(GetDirectionalDerivative, FMI_DERIVATIVE)
FMI_REFUSED(GetAdjointDerivative, FMI_DERIVATIVE)

FMI_STATUS FMI(GetFMUState)(void *component, void **state)
{
    *state = fmu_save(&((FmiInstance *)component)->model, (FmuSaved *)*state);
    return fmi_status(component, *state == NULL ? "there is not enough memory for a state" : NULL);
}

FMI_STATUS FMI(SetFMUState)(void *component, void *state)
{
    return fmi_status(component, fmu_restore(&((FmiInstance *)component)->model, (const FmuSaved *)state));
}

FMI_STATUS FMI(FreeFMUState)(void *component, void **state)
{
    if (state != NULL) {
        free(*state);
        *state = NULL;
    }
    return FMI_OK;
}

FMI_STATUS FMI(SerializedFMUStateSize)(void *component, void *state, size_t *size)
{
    *size = sizeof(FmuSaved);
    return FMI_OK;
}

FMI_STATUS FMI(SerializeFMUState)(void *component, void *state, uint8_t bytes[], size_t size)
{
    if (state == NULL || size < sizeof(FmuSaved))
        return fmi_status(component, "there is no state, or not enough room for it");
    memcpy(bytes, state, sizeof(FmuSaved));
    return FMI_OK;
}

FMI_STATUS FMI(DeserializeFMUState)(void *component, const uint8_t bytes[], size_t size, void **state)
{
    FmuSaved *saved = (FmuSaved *)*state;
    const char *const message = fmu_from_bytes((const char *)bytes, size, &saved);

    *state = saved;
    return fmi_status(component, message);
}

FMI_STATUS FMI(DoStep)(
    void *component, double time, double h, bool keeps_state, bool *needs_event, bool *ends, bool *is_early,
    double *last_time)
{
    FmuModel *const model = &((FmiInstance *)component)->model;
    const char *const message = fmu_advance(model, time, h);

    *needs_event = *ends = *is_early = false;
    *last_time = model->time;
    return fmi_status(component, message);
}
