// Inputs: straight lines or sines from turn to turn, with a whole number of samples on each.

const SAMPLES = 2000;

function turnsOf({ kind, amplitude, middle, cycles, smaller, reversals }) {
  if (kind === "reversals") return reversals;
  const turns = [0, 1];
  for (let k = 0; k < cycles; k++) turns.push(-1, 1);
  if (kind === "fading") {
    for (let k = smaller; k > 0; k--) turns.push(-k / (smaller + 1), k / (smaller + 1));
  }
  if (kind === "minor loops") {
    const rise = 2 / (smaller + 1), depth = 1.6 * rise;
    turns.push(-1);
    for (let k = 1; k <= smaller; k++) turns.push(-1 + k * rise, Math.max(-1, -1 + k * rise - depth));
    turns.push(1);
  }
  return turns.map((turn) => middle + amplitude * turn);
}

// Input and the places of its turns.
function generated(setting) {
  const turns = turnsOf(setting);
  const each = Math.floor(SAMPLES / (turns.length - 1));
  const u = new Float64Array(each * (turns.length - 1) + 1);
  for (let k = 0; k < u.length; k++) {
    const from = Math.min(Math.floor(k / each), turns.length - 2), part = k / each - from; // as np.interp rounds
    u[k] = setting.kind === "sine"
      ? setting.middle + setting.amplitude * Math.sin((Math.PI / 2) * ((from ? 2 * from - 1 : 0) + part * (from ? 2 : 1)))
      : turns[from] + (turns[from + 1] - turns[from]) * part;
  }
  return { u, turns, each, cycle: lastCycle(u, turningPoints(turns).map((ends) => ends.map((k) => k * each))) };
}

// First and last number of each extreme from which levels retreat by more than 1 % of their span.
function turningPoints(levels) {
  const [low, high] = range(levels), least = 0.01 * (high - low), last = levels.length - 1;
  const extremes = levels.map((_, k) => k).filter((k) => k === 0 || k === last || levels[k] > levels[k - 1] !== levels[k + 1] > levels[k]);
  const [, far] = extremes.reduce(([seen, first], k) => {
    const reached = [...seen, levels[k]], [below, above] = range(reached);
    return [reached, first ?? (above - below > least ? k : undefined)];
  }, [[], undefined]);
  let sign = levels[far] > levels[0] ? -1 : 1, ends = [0, 0];
  const points = [];
  for (const k of extremes.slice(1)) {
    const retreat = sign * (levels[ends[0]] - levels[k]);
    if (retreat === 0) ends[1] = k;
    else if (retreat > least) points.push(ends), (sign = -sign), (ends = [k, k]);
    else if (retreat < 0) ends = [k, k];
  }
  return [...points, ends];
}

// Numbers of a text, neighbours of which differ; null if they are fewer than two.
function reversalsIn(text) {
  const numbers = text.replaceAll("−", "-").split(/[\s,;]+/).filter(Boolean).map(Number);
  const turns = numbers.filter((value, k) => value !== numbers[k - 1]);
  return numbers.every(Number.isFinite) && turns.length > 1 && turns.length <= 200 ? turns : null;
}

// The last complete cycle, as hysim.loop_metrics chooses it: from one extreme to the other and back, each within 5 %.
function lastCycle(u, points) {
  const levels = points.map(([first]) => u[first]), end = points.length - 1;
  const starts = points.map(([first, last], k) => (k ? (first + last + 1) >> 1 : first));
  const stops = points.map(([first, last], k) => (k < end ? (first + last) >> 1 : last) + 1);
  const low = Math.min(...levels), high = Math.max(...levels), near = 0.05 * (high - low);
  const sides = levels.map((level) => (level >= high - near) - (level <= low + near));
  for (let k = end; k >= 2; k--) {
    if (sides[k] !== 0 && sides[k] === sides[k - 2] && sides[k] === -sides[k - 1]) {
      const halves = [[[starts[k - 2], stops[k - 1]]], [[starts[k - 1], stops[k]]]];
      const [loading, unloading] = sides[k] < 0 ? halves : halves.reverse();
      return { cuts: [], loading, unloading, path: [starts[k - 2], stops[k]] };
    }
  }
  return null;
}
