// The equation of y of a law, with its names and with their numbers: `output` is its right side in Python's docstring.

const POWERS = ["", "", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"];
const MOST_TERMS = 8;  // of a sum over elements; a longer one is shown as such

// Terms of a sum, each with its sign; signs inside brackets are left.
function termsOf(text) {
  let depth = 0;
  const terms = [""];
  for (const word of text.split(" ")) {
    if (!depth && word === "+") terms.push("");
    else terms.push(`${terms.pop()} ${word}`.trim());
    depth += word.split("(").length - word.split(")").length;
  }
  return terms;
}

// [number, rest] of each term.
function numbered(term, own) {
  const [, name, rest = ""] = term.match(/^(\S+?)(?: (.*))?$/), value = own[name];
  if (typeof value === "number") return [[value, rest]];
  if (/^c_?\d|^sum c_k|^\.\.\.$/.test(term)) return [];
  const [, element] = term.match(/^sum(?:_i)? [wk]_i (.*)$/) ?? [], weights = element ? own.weights ?? own.stiffness : [];
  const used = weights.flatMap((weight, k) => (weight ? [[weight, inNumbers(element.replace("_i", subscript(k)), own)]] : []));
  if (used.length && used.length <= MOST_TERMS) return used;
  return [[1, inNumbers(term, own)]];
}

const inNumbers = (term, own) => term.replace(/[A-Za-z]\w*/g, (word) => (typeof own[word] === "number" ? shortened(own[word], 3) : word));
const subscript = (k) => String(k).replace(/\d/g, (digit) => String.fromCharCode(0x2080 + Number(digit)));

function withNumbers(law, values) {
  const named = law.fields.length ? law.fields : law.named ?? [];
  const own = Object.fromEntries(named.map(([name, place]) => [name, Array.isArray(place) ? place.map((each) => values[each]) : values[place]]));
  const powers = (/\bc_?1 u|sum c_k/.test(law.output) && own.input_coefficients) || [];
  const terms = termsOf(law.output).flatMap((term, k) => [
    ...numbered(term, own), ...(k ? [] : powers.map((value, n) => [value, `u${POWERS[n + 1]}`])),
  ]);
  const text = terms.filter(([value]) => value !== 0).map(([value, rest], k) => {
    const sign = value < 0 ? (k ? "− " : "−") : k ? "+ " : "", size = Math.abs(value);
    return `${sign}${size === 1 && rest ? rest : [shortened(size, 3), rest].filter(Boolean).join(" ")}`;
  });
  return text.join(" ") || "0";
}

// Lines to show: one law has its equation first, the laws of a sum or a cascade are named.
function outputLines(node, values) {
  if (node.sum || node.cascade) {
    const laws = (node.sum || node.cascade).filter((part) => part.output);
    const names = laws.map((law) => law.name.replace("hs.", "")), widest = Math.max(...names.map((name) => name.length));
    return laws.map((law, k) => `${names[k].padEnd(widest)}  y = ${withNumbers(law, values)}`);
  }
  return node.output ? [`y = ${node.output}`, `  = ${withNumbers(node, values)}`] : [];
}
