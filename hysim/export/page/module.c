__attribute__((export_name("begin")))
void begin(const double *parameters, int n_parameters, double *state, int n_state, double u0) {
    start(parameters, n_parameters, state, n_state, u0);
}

__attribute__((export_name("run")))
void run(const double *parameters, int n_parameters, double *state, int n_state, const double *u, double *y, int n) {
    for (int k = 0; k < n; k++) y[k] = step(parameters, n_parameters, state, n_state, u[k]);
}
