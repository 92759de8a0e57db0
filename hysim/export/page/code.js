// Python that computes the same loop, and facts about a law that hold for every input.

const inPython = (value) => (Object.is(value, -0) ? "0.0" : Number.isInteger(value) && Math.abs(value) < 1e16 ? `${value}.0` : String(value));

function lawInPython(law, values) {
  if (law.knots) return "hs.SingleValued(u=..., y=...)";
  if (law.base) {
    const named = law.named.map(([name, place]) => `${JSON.stringify(name)}: ${inPython(values[place])}`);
    return `${law.base}.assemble(\n${wrapped(`    {${named.join(", ")}}`)}\n)`;
  }
  let fields = law.fields.map(([name, place, start]) => {
    const own = Array.isArray(place) ? place.map((each) => values[each]) : values[place];
    return [name, own, start];
  });
  fields = law.stack ? withoutIdle(fields) : fields;
  const told = fields.filter(([, value, start]) => JSON.stringify(value) !== JSON.stringify(start));
  const texts = told.map(([name, value]) =>
    `${name}=${Array.isArray(value) ? `(${value.map(inPython).join(", ")}${value.length === 1 ? "," : ""})` : inPython(value)}`);
  if ("u0" in law) texts.push(`u0=${inPython(law.u0)}`);
  const line = `${law.name}(${texts.join(", ")})`;
  return line.length < 80 ? line : `${law.name}(\n${texts.map((text) => wrapped(`    ${text},`)).join("\n")}\n)`;
}

// Plays without the last ones, whose weights are zero.
function withoutIdle(fields) {
  const weights = fields.find(([name]) => name === "weights")[1];
  const used = weights.findLastIndex((weight) => weight !== 0) + 1;
  return fields.map(([name, value, start]) => [name, Array.isArray(value) ? value.slice(0, used) : value, start])
    .filter(([name, value]) => name !== "z0" || value.some((each) => each !== 0));
}

function wrapped(text) {
  const lines = [""];
  for (const word of text.split(/(?<=, )/)) {
    if (lines.at(-1).length + word.length > 88) lines.push("        ");
    lines.push(lines.pop() + word);
  }
  return lines.map((line) => line.trimEnd()).join("\n");
}

function nodeInPython(node, values) {
  const joined = (parts, sign) => parts.map((each) => (each.sum || each.cascade ? `(${nodeInPython(each, values)})` : nodeInPython(each, values))).join(sign);
  return node.sum ? joined(node.sum, " + ") : node.cascade ? joined(node.cascade, " >> ") : lawInPython(node, values);
}

function codeOf(model, values, drive, record) {
  const { kind, setting, turns, each } = drive;
  const lines = ["import numpy as np", "import hysim as hs", "", `law = ${nodeInPython(model.node, values)}`];
  const time = model.timed ? `, ${inPython(drive.sampleTime)}` : "";
  if (kind === "record") {
    lines.push(`record = ${record.python}`, `y = law.response(record.u${time})`, "print(hs.metrics.fit_percent(record.y, y))");
    return lines.join("\n");
  }
  if (kind === "sine") {
    const last = 2 * turns.length - 3;
    lines.push(`k = np.arange(${each * (turns.length - 1) + 1}) / ${each}`);
    lines.push(`quarters = np.interp(k, range(${turns.length}), [0, *range(1, ${last + 1}, 2)])`);
    lines.push(`u = ${inPython(setting.middle)} + ${inPython(setting.amplitude)} * np.sin(0.5 * np.pi * quarters)`);
  } else {
    lines.push(wrapped(`turns = [${turns.map(inPython).join(", ")}]`));
    lines.push(`u = np.interp(np.arange(${each} * (len(turns) - 1) + 1) / ${each}, range(len(turns)), turns)`);
  }
  lines.push(`y = law.response(u${time})`, drive.cycle ? "print(hs.loop_metrics(u, y))" : "print(y)");
  return lines.join("\n");
}

// ---------------------------------------------------------------------------------- facts

function boucWen(A, beta, gamma, n) {
  const loading = beta + gamma, unloading = beta - gamma;
  let kind = A === 0 && loading > 0 && unloading >= 0 ? "V" : "none";
  if (A > 0 && loading > 0) kind = unloading >= 0 ? "I" : beta >= 0 ? "II" : "none";
  if (A < 0 && unloading > 0) kind = loading >= 0 ? "III" : beta >= 0 ? "IV" : "none";
  const decay = A >= 0 ? loading : unloading;
  return { kind, saturation: decay > 0 ? (Math.abs(A) / decay) ** (1 / n) : Infinity };
}

function factsOf(node, values) {
  if (!node.kind || node.base) return [];
  const own = Object.fromEntries(node.fields.map(([name, place]) => [name, Array.isArray(place) ? place.map((each) => values[each]) : values[place]]));
  if (node.kind === "BoucWen") {
    const { kind, saturation } = boucWen(own.A, own.beta, own.gamma, own.n);
    return [["stability class", kind], ["passive", kind === "I" ? "yes" : "no"], ["saturation of z", Number.isFinite(saturation) ? shortened(saturation) : "none"]];
  }
  if (node.kind === "Dahl") return [["saturation of the force", shortened(own.coulomb)]];
  if (node.kind === "PrandtlIshlinskii") {
    let sum = 0;
    const sums = own.weights.map((weight) => (sum += weight));
    const has = own.thresholds[0] === 0 && sums.every((each) => each * sums[0] > 0);
    return [["saturation", "none"], ["has an inverse", has ? "yes" : "no"]];
  }
  return [];
}
