// The memory of laws at a moment of the input: plays above their thresholds, and relays in the plane of theirs.

// Positions of the plays of the first law that has some, after its last run.
function playsOf(node) {
  const law = lawsOf(node).find((each) => each.plays !== undefined);
  if (!law) return null;
  const { parameters, state } = law.last, n = law.sizes[1] - 1;
  const [thresholds, weights] = [0, n].map((from) => Array.from(parameters.slice(law.plays + from, law.plays + from + n)));
  return { u: state[0], z: Array.from(state.slice(1, n + 1)), thresholds, weights, cone: law.cone };
}

// Positions of plays over their thresholds; a play that is pushed lies on an edge of the cone between u - r and u + r.
function drawPlays(canvas, limits, { u, z, thresholds, weights, cone, labels }) {
  const sheet = prepared(canvas), { pen } = sheet, colour = colours();
  const used = z.map((_, k) => k).filter((k) => weights[k] !== 0).sort((a, b) => thresholds[a] - thresholds[b]);
  const widest = 1.08 * Math.max(...used.map((k) => thresholds[k]), 0) || 1;
  const at = axes(sheet, [0, widest], limits, { ...labels, colour, countX: 3, countY: 4 });
  const largest = Math.max(...used.map((k) => Math.abs(weights[k])), Number.MIN_VALUE);
  within(pen, { ...at.box, left: at.box.left - 8 }, () => {
    if (cone) {
      pen.fillStyle = colour.grid;
      pen.beginPath();
      for (const [r, edge] of [[0, u], [widest, u + widest], [widest, u - widest]]) pen.lineTo(at.x(r), at.y(edge));
      pen.fill();
    }
    pen.strokeStyle = colour.soft, pen.lineWidth = 1, pen.setLineDash([3, 3]);
    pen.beginPath();
    pen.moveTo(at.x(0), at.y(u)), pen.lineTo(at.x(widest), at.y(u));
    pen.stroke();
    pen.setLineDash([]);
    pen.strokeStyle = colour.ink, pen.lineWidth = 1.5;
    pen.beginPath();
    for (const k of used) pen.lineTo(at.x(thresholds[k]), at.y(z[k]));
    pen.stroke();
    for (const k of used) {
      pen.fillStyle = weights[k] > 0 ? colour.model : colour.measured;
      pen.beginPath();
      pen.arc(at.x(thresholds[k]), at.y(z[k]), 2 + 4 * Math.sqrt(Math.abs(weights[k]) / largest), 0, 2 * Math.PI);
      pen.fill();
    }
  });
}

// The plane of relays (a up, b down): those below the staircase that the input has left are up, and hatched.
function drawPlane(canvas, { levels, weights, u, labels }) {
  const sheet = prepared(canvas), { pen } = sheet, colour = colours();
  const low = levels[0], high = levels.at(-1), limits = [low, high];
  const at = axes(sheet, limits, limits, { ...labels, colour, countX: 3, countY: 3 });
  const largest = Math.max(...weights.map(Math.abs), Number.MIN_VALUE);
  const x = levels.map(at.x), y = levels.map(at.y);
  within(pen, at.box, () => {
    let k = 0;
    for (let i = 0; i + 1 < levels.length; i++) {
      for (let j = 0; j <= i; j++, k++) {
        pen.globalAlpha = Math.min(1, Math.abs(weights[k]) / largest);
        pen.fillStyle = weights[k] >= 0 ? colour.model : colour.measured;
        pen.fillRect(x[j], y[i + 1], x[j + 1] - x[j] + 0.5, y[i] - y[i + 1] + 0.5);
      }
    }
    pen.globalAlpha = 1;
    const stairs = staircase(u, low, high);
    hatched(pen, at, [...stairs, [low, low]], colour);
    pen.strokeStyle = colour.ink, pen.lineWidth = 2;
    pen.beginPath();
    for (const [a, b] of stairs) pen.lineTo(at.x(b), at.y(a));
    pen.stroke();
    pen.strokeStyle = colour.axis, pen.lineWidth = 1;
    pen.beginPath();
    pen.moveTo(at.x(low), at.y(low)), pen.lineTo(at.x(high), at.y(high));
    pen.stroke();
  });
}

// Lines across a polygon of corners (a, b).
function hatched(pen, { x, y, box }, corners, colour) {
  pen.save();
  pen.beginPath();
  for (const [a, b] of corners) pen.lineTo(x(b), y(a));
  pen.clip();
  pen.strokeStyle = colour.ink, pen.lineWidth = 0.75, pen.globalAlpha = 0.6;
  pen.beginPath();
  const size = box.bottom - box.top;
  for (let from = box.left - size; from < box.right; from += 7) pen.moveTo(from, box.bottom), pen.lineTo(from + size, box.top);
  pen.stroke();
  pen.restore();
}

// Corners (a, b) of the line that an input leaves in the plane of the relays, all of which were down before it.
function staircase(u, low, high) {
  const extremes = [low];
  for (const raw of u) {
    const value = Math.min(Math.max(raw, low), high);
    for (;;) {
      const n = extremes.length, last = extremes[n - 1];
      if (value === last) break;
      const rising = value > last, wasRising = n % 2 === 0;
      if (n > 1 && rising === wasRising) extremes.pop();
      else if (n > 1 && (rising ? value >= extremes[n - 2] : value <= extremes[n - 2])) extremes.splice(n - 2, 2);
      else {
        extremes.push(value);
        break;
      }
      if (!extremes.length) extremes.push(low);
    }
  }
  const corners = extremes.slice(1).map((value, k) => [Math.max(value, extremes[k]), Math.min(value, extremes[k])]);
  return [...corners, [extremes.at(-1), extremes.at(-1)]];
}
