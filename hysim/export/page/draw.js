// Pictures on canvases, in the colours of the style sheet.

const FONT = "12px system-ui, -apple-system, 'Segoe UI', 'Helvetica Neue', Arial, sans-serif";

function colours() {
  const style = getComputedStyle(document.documentElement);
  return new Proxy({}, { get: (_, name) => style.getPropertyValue(`--${name}`).trim() });
}

function prepared(canvas) {
  const scale = window.devicePixelRatio || 1, { clientWidth: width, clientHeight: height } = canvas;
  const [w, h] = [Math.round(width * scale), Math.round(height * scale)];
  if (canvas.width !== w || canvas.height !== h) [canvas.width, canvas.height] = [w, h];
  const pen = canvas.getContext("2d");
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.font = FONT;
  pen.lineJoin = "round";
  return { pen, width, height };
}

// Round numbers between two values, about `count` of them.
function ticksOf(low, high, count) {
  const rough = (high - low) / Math.max(count, 1), power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((digit) => digit * power).find((each) => each >= rough * 0.999);
  const ticks = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) ticks.push(k * step);
  return { ticks, digits: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
}

function tickText(value, digits) {
  if (value !== 0 && (Math.abs(value) >= 1e5 || digits > 5)) return value.toExponential(1).replace("-", "−");
  return (Math.abs(value) < 1e-12 ? 0 : value).toFixed(digits).replace("-", "−");
}

function padded([low, high], share = 0.06) {
  const span = high - low || Math.abs(high) || 1;
  return [low - share * span, high + share * span];
}

// Axes with a light grid; returns the places of values on the canvas.
function axes({ pen, width, height }, xs, ys, { xlabel, ylabel, colour, countX, countY, least }) {
  const down = ticksOf(...ys, countY ?? Math.max(2, Math.floor(height / 60)));
  const widest = Math.max(...down.ticks.map((tick) => pen.measureText(tickText(tick, down.digits)).width), 20);
  const box = { left: Math.max(Math.ceil(widest) + 28, least ?? 56), right: width - 18, top: 10, bottom: height - (xlabel ? 40 : 22) };
  const across = ticksOf(...xs, countX ?? Math.max(4, Math.floor((box.right - box.left) / 80)));
  const x = (value) => box.left + ((value - xs[0]) / (xs[1] - xs[0])) * (box.right - box.left);
  const y = (value) => box.bottom - ((value - ys[0]) / (ys[1] - ys[0])) * (box.bottom - box.top);
  pen.lineWidth = 1;
  pen.strokeStyle = colour.grid;
  pen.beginPath();
  for (const tick of across.ticks) pen.moveTo(Math.round(x(tick)) + 0.5, box.top), pen.lineTo(Math.round(x(tick)) + 0.5, box.bottom);
  for (const tick of down.ticks) pen.moveTo(box.left, Math.round(y(tick)) + 0.5), pen.lineTo(box.right, Math.round(y(tick)) + 0.5);
  pen.stroke();
  pen.strokeStyle = colour.axis;
  pen.beginPath();
  pen.moveTo(box.left + 0.5, box.top), pen.lineTo(box.left + 0.5, box.bottom + 0.5), pen.lineTo(box.right, box.bottom + 0.5);
  pen.stroke();
  pen.fillStyle = colour.soft;
  pen.textAlign = "center", pen.textBaseline = "top";
  for (const tick of across.ticks) pen.fillText(tickText(tick, across.digits), x(tick), box.bottom + 6);
  pen.textAlign = "right", pen.textBaseline = "middle";
  for (const tick of down.ticks) pen.fillText(tickText(tick, down.digits), box.left - 6, y(tick));
  pen.fillStyle = colour.ink;
  pen.textAlign = "center";
  if (xlabel) pen.textBaseline = "bottom", pen.fillText(xlabel, (box.left + box.right) / 2, height - 2);
  pen.save();
  pen.translate(9, (box.top + box.bottom) / 2);
  pen.rotate(-Math.PI / 2);
  pen.textBaseline = "middle";
  pen.fillText(ylabel, 0, 0);
  pen.restore();
  const inputAt = (place) => xs[0] + ((place - box.left) / (box.right - box.left)) * (xs[1] - xs[0]);
  const outputAt = (place) => ys[0] + ((box.bottom - place) / (box.bottom - box.top)) * (ys[1] - ys[0]);
  return { x, y, box, inputAt, outputAt };
}

function line(pen, at, us, ys, from, to) {
  pen.beginPath();
  for (let k = from; k < to; k++) pen.lineTo(at.x(us[k]), at.y(ys[k]));
  pen.stroke();
}

function arrow(pen, at, us, ys, k, colour) {
  const far = Math.max(0, k - 4);
  const [x, y] = [at.x(us[k]), at.y(ys[k])], [dx, dy] = [x - at.x(us[far]), y - at.y(ys[far])];
  const length = Math.hypot(dx, dy);
  if (!(length > 0)) return;
  const [a, b] = [dx / length, dy / length];
  pen.fillStyle = colour;
  pen.beginPath();
  pen.moveTo(x + 6 * a, y + 6 * b);
  pen.lineTo(x - 5 * a - 4.5 * b, y - 5 * b + 4.5 * a);
  pen.lineTo(x - 5 * a + 4.5 * b, y - 5 * b - 4.5 * a);
  pen.fill();
}

function within(pen, { left, right, top, bottom }, draw) {
  pen.save();
  pen.beginPath();
  pen.rect(left, top, right - left, bottom - top);
  pen.clip();
  draw();
  pen.restore();
}

// Output against input: the model, the model as it was at first, the measured points, and where the loop is widest.
function drawLoop(canvas, limits, { u, y, first, measured, path, measures, moment, labels }) {
  const sheet = prepared(canvas), { pen } = sheet, colour = colours();
  const at = axes(sheet, ...limits, { ...labels, colour });
  within(pen, at.box, () => {
    if (first) {
      pen.strokeStyle = colour.ghost, pen.lineWidth = 1.5, pen.setLineDash([5, 4]);
      line(pen, at, u, first, 0, u.length);
      pen.setLineDash([]);
    }
    if (measured) drawPoints(pen, at, u, measured, colour);
    pen.strokeStyle = colour.model, pen.lineWidth = 1.25, pen.globalAlpha = path ? 0.55 : 1;
    line(pen, at, u, y, 0, u.length);
    pen.globalAlpha = 1;
    if (moment < u.length - 1) dot(pen, at.x(u[moment]), at.y(y[moment]), colour);
    if (!path) return;
    pen.lineWidth = 2.25;
    line(pen, at, u, y, ...path);
    const [from, to] = path, length = to - from;
    if (length > 20) for (const part of [0.17, 0.67]) arrow(pen, at, u, y, from + Math.floor(part * length), colour.model);
    if (measures && measures.orientation !== "none") {
      const x = at.x(measures.max_width_at), ends = measures.branches.map(at.y);
      pen.strokeStyle = colour.width, pen.lineWidth = 1.5;
      pen.beginPath();
      pen.moveTo(x, ends[0]), pen.lineTo(x, ends[1]);
      for (const end of ends) pen.moveTo(x - 4, end), pen.lineTo(x + 4, end);
      pen.stroke();
    }
  });
  return at;
}

function dot(pen, x, y, colour) {
  pen.fillStyle = colour.ink;
  pen.beginPath();
  pen.arc(x, y, 4.5, 0, 2 * Math.PI);
  pen.fill();
}

function drawPoints(pen, at, u, y, colour) {
  const many = u.length > 300;
  pen.strokeStyle = pen.fillStyle = colour.measured;
  pen.lineWidth = 1.25;
  if (many) {
    const every = Math.max(1, Math.floor(u.length / 4000));
    pen.globalAlpha = 0.6;
    for (let k = 0; k < u.length; k += every) pen.fillRect(at.x(u[k]) - 1, at.y(y[k]) - 1, 2, 2);
    pen.globalAlpha = 1;
    return;
  }
  for (let k = 0; k < u.length; k++) {
    pen.beginPath();
    pen.arc(at.x(u[k]), at.y(y[k]), 3, 0, 2 * Math.PI);
    pen.stroke();
  }
}

// Input against time, or against the number of samples; the measured cycle is drawn strongly.
function drawInput(canvas, limits, { u, path, moment, labels, least }) {
  const sheet = prepared(canvas), { pen } = sheet, colour = colours();
  const at = axes(sheet, [0, Math.max(u.length - 1, 1)], limits, { ...labels, colour, countY: 2, least });
  const places = Array.from(u, (_, k) => k);
  within(pen, { ...at.box, top: at.box.top - 4, bottom: at.box.bottom + 4 }, () => {
    pen.strokeStyle = colour.soft, pen.lineWidth = 1;
    line(pen, at, places, u, 0, u.length);
    pen.strokeStyle = colour.model, pen.lineWidth = 2;
    if (path) line(pen, at, places, u, ...path);
    if (moment < u.length - 1) dot(pen, at.x(moment), at.y(u[moment]), colour);
  });
  return at;
}
