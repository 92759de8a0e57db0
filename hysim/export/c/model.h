/* $name: $what, exported by hysim $version. C99 with math.h, no allocation, no global state.

   Call ${name}_init once, then ${name}_step $when. The state is a struct that the
   caller holds, so that one source serves several axes. Every loop ends after a number of rounds that is known
   beforehand, or when its numbers cease to be finite.
   Compile without -ffast-math, and with -ffp-contract=off where the numbers shall be those of Python.$lacks */
#ifndef ${NAME}_H
#define ${NAME}_H

#ifdef __cplusplus
extern "C" {
#endif

#define ${NAME}_STATE $n_state /* doubles */
$defines
typedef struct {
    double x[${NAME}_STATE];
} ${name}_state;

/* $begun */
void ${name}_init(${name}_state *state$first);

/* $result */
double ${name}_step(${name}_state *state, $arguments);
$held_declared
#ifdef __cplusplus
}
#endif

#endif
