// Measures of a loop and of a fit, as hysim.loop_metrics, hysim.metrics.fit_percent and hysim.metrics.rmse define them.

const ROUNDING = 1e-12;

// Values at the samples, and at the places between them where a cycle begins and ends.
function withCuts(values, cuts) {
  if (!cuts.length) return values;
  const joined = [];
  let next = 0;
  for (let k = 0; k < values.length; k++) {
    joined.push(values[k]);
    for (; next < cuts.length && cuts[next] < k + 1; next++) {
      const part = cuts[next] - k;
      joined.push((1 - part) * values[k] + part * values[Math.min(k + 1, values.length - 1)]);
    }
  }
  return Float64Array.from(joined);
}

// Samples of a branch in the order of their inputs; of several with equal inputs the last.
function settled(u, ranges) {
  const samples = ranges.flatMap(([from, to]) => Array.from({ length: to - from }, (_, k) => from + k));
  samples.sort((a, b) => u[a] - u[b] || a - b);
  return samples.filter((sample, k) => k + 1 === samples.length || u[samples[k + 1]] > u[sample]);
}

function interpolated(x, xs, ys) {
  let k = 0;
  return x.map((value) => {
    if (value <= xs[0]) return ys[0];
    if (value >= xs[xs.length - 1]) return ys[xs.length - 1];
    while (xs[k + 1] < value) k++;
    return ys[k] + ((ys[k + 1] - ys[k]) / (xs[k + 1] - xs[k])) * (value - xs[k]);
  });
}

// Everything about a cycle that follows from the input alone.
function cycleOf(u, cycle) {
  if (!cycle) return null;
  const inputs = withCuts(u, cycle.cuts);
  const branches = [cycle.loading, cycle.unloading].map((ranges) => settled(inputs, ranges));
  const xs = branches.map((branch) => branch.map((sample) => inputs[sample]));
  const low = Math.max(xs[0][0], xs[1][0]), high = Math.min(xs[0].at(-1), xs[1].at(-1));
  const grid = [...new Set(xs.flat())].sort((a, b) => a - b).filter((x) => x >= low && x <= high);
  return { cuts: cycle.cuts, branches, xs, grid, path: cycle.path, u: inputs.slice(...cycle.path) };
}

function range(values) {
  let low = Infinity, high = -Infinity;
  for (const value of values) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return [low, high];
}

const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;

function loopMeasures(cycle, outputs) {
  if (!cycle) return null;
  const values = withCuts(outputs, cycle.cuts), y = values.slice(...cycle.path), { grid, u } = cycle;
  const [loading, unloading] = cycle.branches.map((branch, k) =>
    interpolated(grid, cycle.xs[k], branch.map((sample) => values[sample])));
  const width = unloading.map((value, k) => value - loading[k]), magnitude = width.map(Math.abs);
  const [lowest, highest] = range(u), span = highest - lowest, [least, most] = range(y), stroke = most - least;
  const middleU = mean(u), middleY = mean(y), n = u.length;
  let area = 0;
  for (let k = 0; k < n; k++) {
    const next = (k + 1) % n;
    area += ((u[k] - middleU) * (y[next] - middleY) - (u[next] - middleU) * (y[k] - middleY)) / 2;
  }
  const widest = range(magnitude)[1];
  const at = magnitude.findIndex((value) => value >= widest - ROUNDING * stroke);
  const stiffness = (loading.at(-1) - loading[0] + unloading.at(-1) - unloading[0]) / 2 / (grid.at(-1) - grid[0]);
  return {
    max_width: widest,
    max_width_at: grid[at],
    mean_width: Math.abs(area) / span,
    mid_width: Math.abs(interpolated([lowest + span / 2], grid, width)[0]),
    area: Math.abs(area),
    stroke,
    relative_width: stroke > 0 ? widest / stroke : NaN,
    orientation: Math.abs(area) <= ROUNDING * span * stroke ? "none" : area > 0 ? "counterclockwise" : "clockwise",
    closure_gap: y[n - 1] - y[0],
    energy: 0 - area,
    secant_stiffness: stiffness,
    equivalent_damping: stiffness > 0 ? (-2 * area) / (Math.PI * stiffness * span ** 2) : NaN,
    branches: [loading[at], unloading[at]],
  };
}

function fitMeasures(y, model) {
  const square = (values) => Math.sqrt(mean(values.map((value) => value * value)));
  const error = square(y.map((value, k) => value - model[k])), middle = mean(y);
  const spread = square(y.map((value) => value - middle));
  return { fit_percent: spread > 0 ? 100 * (1 - error / spread) : NaN, rmse: error };
}
