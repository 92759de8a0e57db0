/* $name at work: reads $inputs, one sample in each line, and prints $output. */
#include "$name.h"

#include <stdio.h>

int main(void) {
    static ${name}_state state;
    double $inputs;
    int begun = 0;

    while (scanf("$formats", $places) == $count) {
        if (!begun) {
            ${name}_init(&state$begin);
            begun = 1;
        }
        printf("%.17g\n", ${name}_step(&state, $inputs));
    }
    return 0;
}
