/* $inputs to $output; written by hysim $hysim. */

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

$functions

#define FMU_INPUTS $n_inputs
#define FMU_FIELDS $n_fields
#define FMU_PARAMETERS $n_parameters
#define FMU_STATE $n_state
#define FMU_MEMORY $memory
#define FMU_IS_TUNABLE $is_tunable
#define FMU_STEP(p, s, x) $step((p), (s), $values)
#define FMU_PACK(f, p, s) $pack
#define FMU_BEGIN(p, s, u0) $begin
#define FMU_AT_LEAST_1(n) ((n) > 0 ? (n) : 1)
#define FMU_TOKEN "$token"
#define FMU_TOKEN_NUMBERS {$numbers}
#define FMU_START_VALUE $start
$more
$tables

$model

$interface
