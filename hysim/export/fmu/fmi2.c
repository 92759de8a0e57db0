/* FMI 2.0 for co-simulation around the model. Types and signatures are those of the standard, version 2.0.5. */

#ifndef FMI2_Export
#define FMI2_Export FMU_VISIBLE
#endif
#if defined(FMI2_FUNCTION_PREFIX) && !defined(FMI2_OVERRIDE_FUNCTION_PREFIX)
#define FMI(name) FMU_JOINED(FMI2_FUNCTION_PREFIX, FMU_JOINED(fmi2, name))
#else
#define FMI(name) FMU_JOINED(fmi2, name)
#endif
#define FMI_STATUS FMI2_Export int

enum { FMI_OK, FMI_WARNING, FMI_DISCARD, FMI_ERROR, FMI_FATAL, FMI_PENDING };
enum { FMI_MODEL_EXCHANGE, FMI_CO_SIMULATION };
enum { FMI_DO_STEP_STATUS, FMI_PENDING_STATUS, FMI_LAST_SUCCESSFUL_TIME, FMI_IS_TERMINATED };

typedef struct {
    void (*logger)(void *environment, const char *instance, int status, const char *category, const char *message, ...);
    void *(*allocate_memory)(size_t count, size_t size);
    void (*free_memory)(void *memory);
    void (*step_finished)(void *environment, int status);
    void *environment;
} FmiCallbacks;

typedef struct {
    FmuModel model;
    FmiCallbacks callbacks;
    char name[1]; /* and as many more as it has */
} FmiInstance;

static int fmi_status(void *component, const char *message)
{
    const FmiInstance *instance = (const FmiInstance *)component;

    if (message == NULL)
        return FMI_OK;
    if (instance->callbacks.logger != NULL)
        instance->callbacks.logger(
            instance->callbacks.environment, instance->name, FMI_ERROR, "logStatusError", "%s", message);
    return FMI_ERROR;
}

#define FMI_ABSENT(component) fmi_status((component), "this model has no such variables or functions")

FMI2_Export const char *FMI(GetTypesPlatform)(void)
{
    return "default";
}

FMI2_Export const char *FMI(GetVersion)(void)
{
    return "2.0";
}

FMI_STATUS FMI(SetDebugLogging)(void *component, int is_on, size_t count, const char *const categories[])
{
    return FMI_OK; /* errors are always reported, and nothing else is */
}

FMI2_Export void *FMI(Instantiate)(
    const char *name, int type, const char *token, const char *resources, const FmiCallbacks *callbacks, int is_visible,
    int is_logging)
{
    const char *const shown = name == NULL ? "" : name;
    const size_t length = strlen(shown);
    const char *message = NULL;
    FmiInstance *instance;

    if (type != FMI_CO_SIMULATION)
        message = "this model is one for co-simulation";
    else if (token == NULL || strcmp(token, FMU_TOKEN) != 0)
        message = "the GUID is not the one of this model";
    if (message != NULL) {
        if (callbacks != NULL && callbacks->logger != NULL)
            callbacks->logger(callbacks->environment, shown, FMI_ERROR, "logStatusError", "%s", message);
        return NULL;
    }
    instance = (FmiInstance *)calloc(1, sizeof *instance + length);
    if (instance == NULL)
        return NULL;
    memcpy(instance->name, shown, length + 1);
    if (callbacks != NULL)
        instance->callbacks = *callbacks;
    fmu_reset(&instance->model);
    return instance;
}

FMI2_Export void FMI(FreeInstance)(void *component)
{
    free(component);
}

FMI_STATUS FMI(SetupExperiment)(
    void *component, int has_tolerance, double tolerance, double start_time, int has_stop_time, double stop_time)
{
    ((FmiInstance *)component)->model.start_time = start_time;
    return FMI_OK;
}

FMI_STATUS FMI(EnterInitializationMode)(void *component)
{
    ((FmiInstance *)component)->model.phase = FMU_INITIALIZING;
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

FMI_STATUS FMI(GetReal)(void *component, const unsigned int references[], size_t count, double values[])
{
    const char *message = NULL;
    size_t k;

    for (k = 0; k < count && message == NULL; k++)
        message = fmu_get(&((FmiInstance *)component)->model, references[k], &values[k]);
    return fmi_status(component, message);
}

FMI_STATUS FMI(SetReal)(void *component, const unsigned int references[], size_t count, const double values[])
{
    const char *message = NULL;
    size_t k;

    for (k = 0; k < count && message == NULL; k++)
        message = fmu_set(&((FmiInstance *)component)->model, references[k], values[k]);
    return fmi_status(component, message);
}

/* Functions for variables of other types and for derivatives: this model has none of them. */
#define FMI_NONE(name, arguments)                           \
    FMI_STATUS FMI(name) arguments                          \
    {                                                       \
        return count == 0 ? FMI_OK : FMI_ABSENT(component); \
    }
#define FMI_LIST void *component, const unsigned int references[], size_t count

FMI_NONE(GetInteger, (FMI_LIST, int values[]))
FMI_NONE(SetInteger, (FMI_LIST, const int values[]))
FMI_NONE(GetBoolean, (FMI_LIST, int values[]))
FMI_NONE(SetBoolean, (FMI_LIST, const int values[]))
FMI_NONE(GetString, (FMI_LIST, const char *values[]))
FMI_NONE(SetString, (FMI_LIST, const char *const values[]))
FMI_NONE(SetRealInputDerivatives, (FMI_LIST, const int orders[], const double values[]))
FMI_NONE(GetRealOutputDerivatives, (FMI_LIST, const int orders[], double values[]))
FMI_NONE(
    GetDirectionalDerivative,
    (void *component, const unsigned int unknowns[], size_t count, const unsigned int knowns[], size_t known_count,
     const double seed[], double sensitivity[]))

FMI_STATUS FMI(GetFMUstate)(void *component, void **state)
{
    *state = fmu_save(&((FmiInstance *)component)->model, (FmuSaved *)*state);
    return fmi_status(component, *state == NULL ? "there is not enough memory for a state" : NULL);
}

FMI_STATUS FMI(SetFMUstate)(void *component, void *state)
{
    return fmi_status(component, fmu_restore(&((FmiInstance *)component)->model, (const FmuSaved *)state));
}

FMI_STATUS FMI(FreeFMUstate)(void *component, void **state)
{
    if (state != NULL) {
        free(*state);
        *state = NULL;
    }
    return FMI_OK;
}

FMI_STATUS FMI(SerializedFMUstateSize)(void *component, void *state, size_t *size)
{
    *size = sizeof(FmuSaved);
    return FMI_OK;
}

FMI_STATUS FMI(SerializeFMUstate)(void *component, void *state, char bytes[], size_t size)
{
    if (state == NULL || size < sizeof(FmuSaved))
        return fmi_status(component, "there is no state, or not enough room for it");
    memcpy(bytes, state, sizeof(FmuSaved));
    return FMI_OK;
}

FMI_STATUS FMI(DeSerializeFMUstate)(void *component, const char bytes[], size_t size, void **state)
{
    FmuSaved *saved = (FmuSaved *)*state;
    const char *const message = fmu_from_bytes(bytes, size, &saved);

    *state = saved;
    return fmi_status(component, message);
}

FMI_STATUS FMI(DoStep)(void *component, double time, double h, int keeps_state)
{
    return fmi_status(component, fmu_advance(&((FmiInstance *)component)->model, time, h));
}

FMI_STATUS FMI(CancelStep)(void *component)
{
    return FMI_ABSENT(component); /* no step is ever pending */
}

FMI_STATUS FMI(GetStatus)(void *component, int kind, int *value)
{
    if (kind != FMI_DO_STEP_STATUS)
        return FMI_DISCARD;
    *value = FMI_OK;
    return FMI_OK;
}

FMI_STATUS FMI(GetRealStatus)(void *component, int kind, double *value)
{
    if (kind != FMI_LAST_SUCCESSFUL_TIME)
        return FMI_DISCARD;
    *value = ((FmiInstance *)component)->model.time;
    return FMI_OK;
}

FMI_STATUS FMI(GetIntegerStatus)(void *component, int kind, int *value)
{
    return FMI_DISCARD;
}

FMI_STATUS FMI(GetBooleanStatus)(void *component, int kind, int *value)
{
    if (kind != FMI_IS_TERMINATED)
        return FMI_DISCARD;
    *value = 0;
    return FMI_OK;
}

FMI_STATUS FMI(GetStringStatus)(void *component, int kind, const char **value)
{
    return FMI_DISCARD;
}
