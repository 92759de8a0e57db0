// Sliders with boxes for their digits.

const STEPS = 400;  // positions of a slider

const part = (id) => document.getElementById(id);

function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (value === true) made.setAttribute(key, "");
    else if (value !== false && value !== undefined) made.setAttribute(key, value);
  }
  made.append(...children);
  return made;
}

// A number of few digits, with an exponent where it would be long.
function digitsOf(value, digits) {
  const rounded = Number(value.toPrecision(digits));
  return rounded !== 0 && Math.abs(rounded) < 1e-4 ? rounded.toExponential() : String(rounded);
}

const shortened = (value, digits = 4) => (Number.isFinite(value) ? digitsOf(value, digits).replace(/^-/, "−") : "–");

// A number with a slider and a box for its digits; `changed` is called with the new value.
class Control {
  constructor(spec, changed) {
    Object.assign(this, { spec, changed, value: spec.value });
    const id = `control-${spec.name.replace(/[^\w-]/g, "_")}`;
    this.slider = element("input", { type: "range", id, min: 0, max: spec.whole ? spec.upper - spec.lower : STEPS, step: 1, "data-name": spec.name });
    this.box = element("input", { type: "number", step: "any", "aria-label": `${spec.name}, value` });
    const label = element("label", { for: id }, spec.label ?? spec.name, ...(spec.unit ? [" ", element("small", {}, spec.unit)] : []));
    this.element = element("div", { class: "control" }, label, this.box, this.slider);
    this.slider.addEventListener("input", () => this.set(this.at(Number(this.slider.value)), true));
    this.box.addEventListener("change", () => {
      const value = this.box.valueAsNumber;
      this.set(Number.isFinite(value) ? Math.min(Math.max(value, spec.lower), spec.upper) : this.value, true);
    });
    this.show();
  }

  // Value at a position: of few digits, so that it can be read and copied.
  at(position) {
    const { lower, upper, log, whole } = this.spec;
    if (whole) return lower + position;
    if (position <= 0) return lower;
    if (position >= STEPS) return upper;
    if (log) return Number((lower * (upper / lower) ** (position / STEPS)).toPrecision(4));
    const digits = Math.min(100, Math.max(0, 2 - Math.floor(Math.log10((upper - lower) / STEPS))));
    return Number((lower + ((upper - lower) * position) / STEPS).toFixed(digits));
  }

  position() {
    const { lower, upper, log, whole } = this.spec;
    if (whole) return this.value - lower;
    return STEPS * (log ? Math.log(this.value / lower) / Math.log(upper / lower) : (this.value - lower) / (upper - lower));
  }

  set(value, tell = false) {
    this.value = value;
    this.show();
    if (tell) this.changed();
  }

  show() {
    this.slider.value = this.position();
    this.slider.setAttribute("aria-valuetext", `${shortened(this.value)} ${this.spec.unit ?? ""}`.trim());
    this.box.value = digitsOf(this.value, 6);
    this.element.classList.toggle("changed", this.value !== this.spec.value);
  }
}
