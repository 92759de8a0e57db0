
static void start(const double *parameters, int n_parameters, double *state, int n_state, double u0) {
    (void)parameters, (void)n_parameters, (void)state, (void)n_state, (void)u0;
}
