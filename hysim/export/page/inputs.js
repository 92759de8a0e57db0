// Inputs: straight lines or sines from turn to turn, with a whole number of samples on each.

const SAMPLES = 2000;

function turnsOf({ kind, amplitude, middle, cycles, smaller }) {
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
    const from = Math.min(Math.floor(k / each), turns.length - 2), part = (k - from * each) / each;
    u[k] = setting.kind === "sine"
      ? setting.middle + setting.amplitude * Math.sin((Math.PI / 2) * ((from ? 2 * from - 1 : 0) + part * (from ? 2 : 1)))
      : turns[from] + (turns[from + 1] - turns[from]) * part;
  }
  return { u, turns, each, cycle: lastCycle(u, turns.map((_, k) => k * each)) };
}

// The last complete cycle, as hysim.loop_metrics chooses it: from one extreme to the other and back, each within 5 %.
function lastCycle(u, places) {
  const levels = places.map((place) => u[place]);
  const low = Math.min(...levels), high = Math.max(...levels), near = 0.05 * (high - low);
  const sides = levels.map((level) => (level >= high - near) - (level <= low + near));
  for (let k = places.length - 1; k >= 2; k--) {
    if (sides[k] !== 0 && sides[k] === sides[k - 2] && sides[k] === -sides[k - 1]) {
      const halves = [[[places[k - 2], places[k - 1] + 1]], [[places[k - 1], places[k] + 1]]];
      const [loading, unloading] = sides[k] < 0 ? halves : halves.reverse();
      return { cuts: [], loading, unloading, path: [places[k - 2], places[k] + 1] };
    }
  }
  return null;
}
