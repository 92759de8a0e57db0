static double smaller(double a, double b) { return b < a ? b : a; }
static double larger(double a, double b) { return b > a ? b : a; }
static int smaller_int(int a, int b) { return b < a ? b : a; }
static int larger_int(int a, int b) { return b > a ? b : a; }
static int absolute_int(int a) { return a < 0 ? -a : a; }
static int below(int a, int b) { return a % b != 0 && (a < 0) != (b < 0); }
static int floor_quotient(int a, int b) { return a / b - below(a, b); }
static int floor_rest(int a, int b) { return a % b + below(a, b) * b; }
static double power_2(double x) { return x * x; }
static double power_3(double x) { return x * (x * x); }
static double power_4(double x) { return (x * x) * (x * x); }
