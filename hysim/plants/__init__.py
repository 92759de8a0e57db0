"""Plants that move in time: linear stages, the actuator as a chain of stages, the hysteretic oscillator."""
