// A law's step in WebAssembly, and models made of laws: sums, cascades.

async function inflated(text) {
  const bytes = Uint8Array.from(atob(text), (sign) => sign.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

class Step {
  constructor(instance) {
    this.exports = instance.exports;
    if (this.exports._initialize) this.exports._initialize();
  }

  // The steps of modules by their names; `sizes` of the modules in the code, which stand one behind the other.
  static async all(sizes, code) {
    const ends = Object.values(sizes).map((_, k, all) => all.slice(0, k + 1).reduce((sum, size) => sum + size));
    return Object.fromEntries(await Promise.all(Object.entries(sizes).map(async ([name, size], k) =>
      [name, new Step((await WebAssembly.instantiate(code.slice(ends[k] - size, ends[k]))).instance)])));
  }

  // Outputs at the inputs u, and the state after them; memory is the front of the state before the first sample, its
  // first place that of u.
  outputs(parameters, memory, work, u) {
    const { memory: linear, __heap_base: base, begin, run } = this.exports;
    const sizes = [parameters.length, memory.length + work, u.length, u.length];
    const total = sizes.reduce((sum, size) => sum + size, 0);
    const first = Math.ceil(base.value / 8) * 8;
    const lacking = first + 8 * total - linear.buffer.byteLength;
    if (lacking > 0) linear.grow(Math.ceil(lacking / 65536));
    const room = new Float64Array(linear.buffer, first, total);
    const places = sizes.map((_, k) => sizes.slice(0, k).reduce((sum, size) => sum + size, 0));
    room.set(parameters, 0);
    room.fill(0, places[1], places[2]);
    room.set(memory, places[1]);
    room.set(u, places[2]);
    const [p, s, x, y] = places.map((place) => first + 8 * place);
    begin(p, sizes[0], s, sizes[1], u[0]);
    run(p, sizes[0], s, sizes[1], x, y, u.length);
    return { y: room.slice(places[3]), state: room.slice(places[1], places[2]) };
  }
}

// Output of a law, a sum or a cascade; values are the numbers of all its laws.
function response(node, values, u, steps, sampleTime) {
  if (node.sum) {
    const terms = node.sum.map((part) => response(part, values, u, steps, sampleTime));
    return terms[0].map((_, k) => terms.reduce((total, term) => total + term[k], 0));
  }
  if (node.cascade) {
    return node.cascade.reduce((signal, stage) => response(stage, values, signal, steps, sampleTime), u);
  }
  if (node.knots) return Float64Array.from(u, (value) => interpolated([value], ...node.knots)[0]);
  const { first, free, clock, sizes } = node;
  const number = (place) => (place === clock ? sampleTime : values[first + place]);
  const fields = free.map(number);
  const [parameters, memory] = sizes.map((size) => new Float64Array(size));
  node.packed(fields, parameters, memory);
  const begun = "u0" in node; // the memory holds at u0, before the first sample
  const { y, state } = steps[node.module].outputs(parameters, memory, node.work, begun ? [node.u0, ...u] : u);
  node.last = { parameters, state };
  return begun ? y.slice(1) : y;
}

function lawsOf(node) {
  const parts = node.sum || node.cascade;
  return parts ? parts.flatMap(lawsOf) : "pack" in node ? [node] : [];
}
