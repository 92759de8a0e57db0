// The page: sliders, their setting in the address, and what follows from it.

const KINDS = ["triangle", "sine", "fading", "minor loops", "reversals"];
const SHARES = [0, 1, -1, 1, -0.4, 0.5, -0.4, 1];  // where the input turns at first if its reversals are typed
const FILM = 8;  // seconds in which an input is played

class Page {
  constructor(data, steps) {
    Object.assign(this, { data, steps, times: [], controls: [], inputs: [] });
    this.cycle = data.record && data.record.cycle ? cycleOf(data.record.u, data.record.cycle) : null;
    for (const group of new Set(data.models.map((model) => model.group))) {
      const options = data.models.flatMap((model, k) => (model.group === group ? [element("option", { value: k }, model.name)] : []));
      part("model").append(...(group ? [element("optgroup", { label: group }, ...options)] : options));
    }
    part("models").hidden = data.models.length < 2;
    part("kind").append(...[...(data.record ? ["record"] : []), ...KINDS].map((kind) =>
      element("option", { value: kind }, kind === "record" ? `measured: ${data.record.name}` : kind)));
    part("model").addEventListener("change", () => (this.choose(Number(part("model").value)), this.refit(), this.share()));
    part("kind").addEventListener("change", () => (this.showInputs(), this.refit(), this.share()));
    part("reset").addEventListener("click", () => (this.choose(this.chosen), this.refit(), this.share()));
    part("refit").addEventListener("click", () => this.refit());
    part("loop").addEventListener("dblclick", () => part("kind").value === "reversals" || this.refit());
    part("loop").addEventListener("click", (event) => this.add(this.places.loop.inputAt(event.offsetX)));
    part("input").addEventListener("click", (event) => this.add(this.places.input.outputAt(event.offsetY)));
    part("reversals").addEventListener("change", () => (this.drawReversals(), this.refit(), this.share()));
    part("shorter").addEventListener("click", () => this.turn(this.reversals.slice(0, Math.max(2, this.reversals.length - 1))));
    part("moment").addEventListener("input", () => (this.stop(), this.moveTo(part("moment").value / STEPS)));
    part("moment").addEventListener("change", () => this.share());
    part("play").addEventListener("click", () => (this.playing ? (this.stop(), this.share()) : this.play()));
    part("link").addEventListener("click", () => this.copy(location.href, part("link")));
    part("copy").addEventListener("click", () => this.copy(part("code").textContent, part("copy")));
    window.addEventListener("hashchange", () => (this.read(), this.refit()));
    new ResizeObserver(() => this.later()).observe(part("loop"));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.later());
    this.read();
    this.refit();
  }

  get model() {
    return this.data.models[this.chosen];
  }

  // A model with its sliders at their first values.
  choose(k) {
    this.chosen = k;
    const { model } = this, changed = () => (this.later(), this.share());
    part("model").value = k;
    part("about").innerHTML = model.about;
    const clauses = (line) => line.split(/(?<=, {3,})(?=\S)/).map((clause) => element("span", {}, clause));
    part("equation").replaceChildren(...model.equation.split("\n").flatMap((line) => [...clauses(line), "\n"]));
    part("equation").hidden = !model.equation;
    this.controls = model.controls.map((spec) => new Control(spec, changed));
    part("parameters").replaceChildren(...this.controls.map((control) => control.element));
    this.inputs = model.inputs.map((spec) => new Control(spec, changed));
    part("inputs").replaceChildren(...this.inputs.map((control) => control.element));
    part("kind").value = this.data.record ? "record" : model.kind;
    const [amplitude, middle] = ["amplitude", "middle"].map((name) => model.inputs.find((spec) => spec.name === name).value);
    this.reversals = this.usual = SHARES.map((share) => Number((middle + share * amplitude).toPrecision(4)));
    part("reversals").value = this.reversals.join(", ");
    part("moment").max = STEPS;
    this.stop();
    this.moveTo(1);
    this.showInputs();
  }

  // ------------------------------------------------------------------------------ reversals of the user's

  drawReversals() {
    const turns = reversalsIn(part("reversals").value);
    this.reversals = turns ?? this.reversals;
    part("reversals").setAttribute("aria-invalid", !turns);
    part("reversals-help").classList.toggle("wrong", !turns);
  }

  turn(reversals) {
    part("reversals").value = reversals.join(", ");
    this.drawReversals();
    this.later();
    this.share();
  }

  // One reversal more, where the user points.
  add(input) {
    if (part("kind").value !== "reversals") return;
    const [low, high] = this.limits[0], digits = Math.min(100, Math.max(0, 2 - Math.floor(Math.log10(high - low))));
    this.turn([...this.reversals, Number(Math.min(Math.max(input, low), high).toFixed(digits))]);
  }

  // ------------------------------------------------------------------------------ a moment of the input, and a film

  moveTo(share) {
    this.passed = share;
    part("moment").value = STEPS * share;
    this.later();
  }

  play() {
    const from = this.passed < 1 ? this.passed : 0, begin = performance.now();
    const next = (now) => {
      this.moveTo(Math.min(1, Math.max(0, from + (now - begin) / 1000 / FILM)));
      this.playing = this.passed < 1 ? requestAnimationFrame(next) : undefined;
      part("play").textContent = this.playing ? "Pause" : "Play";
      if (!this.playing) this.share();
    };
    this.playing = requestAnimationFrame(next);
  }

  stop() {
    cancelAnimationFrame(this.playing);
    this.playing = undefined;
    part("play").textContent = "Play";
  }

  showInputs() {
    const kind = part("kind").value;
    const isTyped = kind === "reversals", usual = !isTyped;
    part("typed").hidden = !isTyped;
    part("loop").classList.toggle("pointed", isTyped), part("input").classList.toggle("pointed", isTyped);
    const used = { amplitude: usual, middle: usual, cycles: usual, "smaller loops": ["fading", "minor loops"].includes(kind), period: this.model.timed };
    for (const control of this.inputs) control.element.hidden = kind === "record" ? control.spec.name !== "period" || !this.model.timed : !used[control.spec.name];
  }

  // The setting is what differs from the start, by name.
  share() {
    const setting = new URLSearchParams();
    if (this.chosen) setting.set("model", this.model.name);
    if (part("kind").value !== (this.data.record ? "record" : this.model.kind)) setting.set("input", part("kind").value);
    for (const control of [...this.controls, ...this.inputs]) {
      if (control.value !== control.spec.value) setting.set(control.spec.name, control.value);
    }
    if (part("kind").value === "reversals" && this.reversals !== this.usual) setting.set("reversals", this.reversals.join(" "));
    if (this.passed < 1) setting.set("moment", this.passed);
    const text = `${setting}`;
    try {
      history.replaceState(null, "", text ? `#${text}` : "#");
    } catch {
      location.hash = text;
    }
  }

  read() {
    const setting = new URLSearchParams(location.hash.slice(1));
    const named = this.data.models.findIndex((model) => model.name === setting.get("model"));
    this.choose(Math.max(named, 0));
    if ([...part("kind").options].some((option) => option.value === setting.get("input"))) part("kind").value = setting.get("input");
    for (const control of [...this.controls, ...this.inputs]) {
      const { name, lower, upper } = control.spec, value = Number(setting.get(name));
      if (setting.has(name) && Number.isFinite(value)) control.set(Math.min(Math.max(value, lower), upper));
    }
    if (setting.has("reversals")) {
      part("reversals").value = setting.get("reversals").split(" ").join(", ");
      this.drawReversals();
    }
    const moment = Number(setting.get("moment"));
    if (setting.has("moment") && moment >= 0 && moment <= 1) this.moveTo(moment);
    this.showInputs();
  }

  async copy(text, button) {
    const before = button.textContent;
    try {
      await navigator.clipboard.writeText(text);
    } catch {
      const area = element("textarea");
      area.value = text;
      document.body.append(area);
      area.select();
      document.execCommand("copy");
      area.remove();
    }
    button.textContent = "Copied";
    setTimeout(() => (button.textContent = before), 1200);
  }

  // ------------------------------------------------------------------------------ what follows from the setting

  numbers(controls = this.controls.map((control) => control.value)) {
    const values = Float64Array.from(this.model.values);
    this.model.controls.forEach(({ places, scale, stack }, k) => {
      for (const place of stack ? [] : places) values[place] = scale ? this.model.values[place] * controls[k] : controls[k];
    });
    const stack = Object.fromEntries(this.model.controls.map(({ stack: role, places }, k) => [role, { value: controls[k], places }]));
    if (stack.plays) {
      const plays = stack.plays.value;
      stack.reach.places.forEach((place, k) => (values[place] = Number(((stack.reach.value * (k + 1)) / plays).toPrecision(6))));
      stack.weight.places.forEach((place, k) => (values[place] = k < plays ? Number((stack.weight.value / plays).toPrecision(6)) : 0));
    }
    return values;
  }

  input() {
    const kind = part("kind").value, { record } = this.data;
    const setting = Object.fromEntries(this.inputs.map(({ spec, value }) => [spec.name === "smaller loops" ? "smaller" : spec.name, value]));
    if (kind === "reversals") setting.reversals = this.reversals;
    const key = JSON.stringify([this.chosen, kind, setting]);
    if (this.drive?.key !== key) {
      const made = kind === "record" ? { u: record.u, cycle: this.cycle } : generated({ ...setting, kind });
      if (kind !== "record") made.cycle = cycleOf(made.u, made.cycle);
      const sampleTime = kind === "record" && record.sampleTime ? record.sampleTime : setting.period / (2 * (made.each ?? SAMPLES / 2));
      this.drive = { ...made, key, kind, setting, sampleTime };
      this.drive.first = this.run(this.numbers(this.model.controls.map((control) => control.value)));
    }
    return this.drive;
  }

  run(values) {
    return response(this.model.node, values, this.drive.u, this.steps, this.drive.sampleTime);
  }

  later() {
    this.waiting ??= requestAnimationFrame(() => {
      this.waiting = undefined;
      this.draw();
    });
  }

  refit() {
    this.limits = null;
    this.draw();
  }

  draw() {
    const begin = performance.now();
    const drive = this.input(), values = this.numbers(), y = this.run(values), { record } = this.data;
    const finite = y.every(Number.isFinite), isMeasured = drive.kind === "record";
    const measures = finite ? loopMeasures(drive.cycle, y) : null;
    const fit = finite && isMeasured ? fitMeasures(record.y, y) : null;
    const outputs = [y, drive.first, ...(isMeasured ? [record.y] : [])].filter((each) => each.every(Number.isFinite));
    this.limits ??= [padded(range(drive.u)), padded(range(outputs.flatMap((each) => range(each))))];
    const isFirst = this.controls.every((control) => control.value === control.spec.value);
    const { labels } = this.model, path = drive.cycle && !drive.cycle.cuts.length ? drive.cycle.path : null;
    const moment = Math.round(this.passed * (drive.u.length - 1));
    const loop = drawLoop(part("loop"), this.limits, {
      u: drive.u, y, measures, path, moment, first: isFirst ? null : drive.first, measured: isMeasured ? record.y : null,
      labels: { xlabel: labels.u, ylabel: labels.y },
    });
    const input = drawInput(part("input"), this.limits[0], { u: drive.u, path, moment, labels: { ylabel: labels.unit.u || "u" }, least: loop.box.left });
    this.places = { loop, input };
    const memory = finite ? this.drawMemory(drive.u.slice(0, moment + 1), values) : null;
    this.state = { model: this.model.name, values, u: drive.u, y, measures, fit, moment, memory, input: { kind: drive.kind, ...drive.setting } };
    this.tell(finite, isFirst, isMeasured);
    this.times.push(performance.now() - begin);
  }

  drawMemory(u, values) {
    const { plane, node, labels } = this.model, hasPlays = lawsOf(node).some((law) => "plays" in law);
    part("memory").hidden = !plane && !hasPlays;
    if (plane) {
      const levels = plane.levels.map((place) => values[place]), weights = plane.weights.map((place) => values[place]);
      part("memory-name").textContent = "Relays";
      part("memory-key").textContent = "Darker: more weight. Hatched: up.";
      drawPlane(part("plane"), { levels, weights, u, labels: { xlabel: "down at", ylabel: "up at" } });
    }
    if (!hasPlays) return null;
    response(node, values, u, this.steps, this.drive.sampleTime);
    const plays = playsOf(node), { unit } = labels;
    part("memory-name").textContent = "Plays";
    part("memory-key").textContent = plays.cone
      ? "Larger: more weight. A play on an edge of the grey cone u ± r is pushed, one within it rests."
      : "Larger: more weight. Dashed: the input.";
    const inputs = node.cascade ? padded(range([...plays.z, plays.u])) : this.limits[0];
    drawPlays(part("plane"), inputs, { ...plays, labels: { xlabel: `threshold ${unit.u ? `[${unit.u}]` : "r"}`, ylabel: "position z" } });
    return plays;
  }

  tell(finite, isFirst, isMeasured) {
    const { measures, fit, values } = this.state, { labels, node } = this.model;
    part("warning").hidden = finite;
    part("first-key").hidden = isFirst;
    part("measured-key").hidden = !isMeasured;
    const outside = finite && [this.state.u, this.state.y].some((signal, k) => {
      const [low, high] = range(signal);
      return low < this.limits[k][0] || high > this.limits[k][1] || (high - low) < 0.3 * (this.limits[k][1] - this.limits[k][0]);
    });
    part("refit").classList.toggle("wanted", outside);
    rows(part("loop-rows"), measures ? loopRows(measures, labels.unit) : [["measures", "no complete cycle"]]);
    rows(part("fit-rows"), fit ? [["fit", `${shortened(fit.fit_percent)} %`], ["rmse", `${shortened(fit.rmse)} ${labels.unit.y}`.trim()]] : []);
    part("fit").hidden = !fit;
    const facts = factsOf(node, values);
    rows(part("law-rows"), facts);
    part("law").hidden = !facts.length;
    const output = outputLines(node, values);
    part("output").textContent = output.join("\n");
    part("output").hidden = !output.length;
    part("code").textContent = codeOf(this.model, values, this.drive, this.data.record);
    part("loop").setAttribute("aria-label", described(measures, labels));
  }
}

function described(measures, labels) {
  if (!measures) return `Loop of ${labels.y} over ${labels.u}`;
  return `Loop of ${labels.y} over ${labels.u}, ${measures.orientation}, largest width ${shortened(measures.max_width)} at ${shortened(measures.max_width_at)}`;
}

function rows(body, pairs) {
  body.replaceChildren(...pairs.map(([name, value]) => element("tr", {}, element("th", { scope: "row" }, name), element("td", {}, value))));
}

const percent = (share) => (Number.isFinite(share) ? `${shortened(100 * share, 3)} %` : "–");

function loopRows(loop, { u, y }) {
  const both = [y, u].filter(Boolean).join(" ");
  return [
    ["largest width", `${shortened(loop.max_width)} ${y}`],
    ["at the input", `${shortened(loop.max_width_at)} ${u}`],
    ["relative width", percent(loop.relative_width)],
    ["mean width", `${shortened(loop.mean_width)} ${y}`],
    ["area", `${shortened(loop.area)} ${both}`],
    ["stroke", `${shortened(loop.stroke)} ${y}`],
    ["orientation", loop.orientation],
    ["closure gap", `${shortened(Math.abs(loop.closure_gap) < 1e-12 * loop.stroke ? 0 : loop.closure_gap, 2)} ${y}`],
    ["secant stiffness", shortened(loop.secant_stiffness)],
    ["equivalent damping", percent(Math.abs(loop.equivalent_damping))],
  ];
}

async function opened(data, packs) {
  for (const model of data.models) for (const law of lawsOf(model.node)) law.packed = packs[law.pack];
  const steps = await Step.all(data.modules, await inflated(data.code));
  if (data.record) {
    for (const signal of ["u", "y"]) data.record[signal] = new Float64Array(await inflated(data.record[signal]));
  }
  window.hysim = new Page(data, steps);
  document.documentElement.dataset.ready = "yes";
}
