#include "$name.h"

#include <math.h>

$functions
$table

void ${name}_init(${name}_state *state$first) {
$init}

double ${name}_step(${name}_state *state, $arguments) {
    return step(parameters, state->x, $inputs);
}
$held_defined