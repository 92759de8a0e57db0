"""What the derivatives of steps need beside the steps: rules of functions, and one more step of each iteration."""
