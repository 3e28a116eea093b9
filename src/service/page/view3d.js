// The deformed surface in WebGL, coloured by λ or k: drag or arrow keys turn it, wheel or + and − bring it nearer.

import { h } from "./dom.js";
import { frameOf } from "./frame3d.js";
import { digits, plain } from "./numbers.js";

const RAMP = [
  [68, 1, 84],
  [59, 82, 139],
  [33, 145, 140],
  [94, 201, 98],
  [253, 231, 37],
].map((c) => c.map((v) => v / 255));
const VERTEX = `attribute vec3 at; attribute vec3 moved; attribute vec3 tint;
uniform mat4 view; uniform float amount; varying vec3 colour; varying vec3 place;
void main() { vec3 p = at + amount * moved; gl_Position = view * vec4(p, 1.0); colour = tint; place = p; }`;
const FRAGMENT = `#extension GL_OES_standard_derivatives : enable
precision mediump float; varying vec3 colour; varying vec3 place; uniform float plain;
void main() {
  if (plain > 0.5) { gl_FragColor = vec4(colour, 1.0); return; }
  vec3 n = normalize(cross(dFdx(place), dFdy(place)));
  float light = 0.62 + 0.38 * abs(dot(n, normalize(vec3(0.4, 0.55, 0.75))));
  gl_FragColor = vec4(colour * light, 1.0);
}`;

function colour(value, low, high) {
  if (value === null) return [0.6, 0.6, 0.6];
  const t = Math.max(0, Math.min(0.9999, (value - low) / (high - low || 1))) * (RAMP.length - 1);
  const i = Math.floor(t);
  return RAMP[i].map((c, j) => c + (t - i) * (RAMP[i + 1][j] - c));
}

/** Views of several surfaces that turn together. */
export function view3d(surfaces) {
  const state = { turn: -0.6, tilt: 0.5, zoom: 1, amount: 1, what: "stretch_amplitude" };
  const low = h("span", {});
  const high = h("span", {});
  const views = surfaces.map(
    ([surface, label]) => new View(surface, label, state, () => views.forEach((v) => v.draw())),
  );
  const recolour = () => {
    const all = surfaces.flatMap(([s]) => s[state.what].filter((v) => v !== null)).sort((a, b) => a - b);
    const range = state.what === "deformation_mode" ? [0, 1] : [all[0], all[Math.floor(0.995 * (all.length - 1))]];
    low.textContent = digits(range[0], 3);
    high.textContent = digits(range[1], 3);
    views.forEach((v) => v.tint(range));
  };
  const element = h(
    "section",
    { class: "sheet" },
    h(
      "div",
      { class: "row end" },
      h("h3", {}, "Deformed shape"),
      h(
        "div",
        { class: "row" },
        h(
          "label",
          {},
          "Colour",
          h(
            "select",
            {
              onchange: (e) => {
                state.what = e.target.value;
                recolour();
              },
            },
            h("option", { value: "stretch_amplitude" }, "stretch amplitude λ"),
            h("option", { value: "deformation_mode" }, "mode k"),
          ),
        ),
        h(
          "label",
          {},
          "Deformation",
          h("input", {
            type: "range",
            min: 0,
            max: 1,
            step: 0.05,
            value: 1,
            oninput: (e) => {
              state.amount = Number(e.target.value);
              views.forEach((v) => v.draw());
            },
          }),
        ),
      ),
    ),
    h("div", { class: "scale" }, low, h("div", { class: "ramp" }), high),
    h(
      "p",
      { class: "quiet" },
      "Lines show what holds the specimen, and an arrow where it is moved to. Drag or use the arrow keys to turn.",
    ),
    h(
      "div",
      { class: views.length > 1 ? "halves" : null },
      views.map((v) => h("figure", {}, v.canvas, h("figcaption", {}, v.label))),
    ),
  );
  requestAnimationFrame(recolour);
  const redraw = () => views.forEach((v) => v.draw());
  new ResizeObserver(redraw).observe(element);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  return element;
}

class View {
  constructor(surface, label, state, redraw) {
    Object.assign(this, { surface, label: `${label}, drive ${plain(surface.drive_mm, 3)} mm`, state });
    this.canvas = h("canvas", {
      tabindex: 0,
      role: "img",
      "aria-label": `${label}: deformed surface; arrow keys turn it`,
    });
    let last = null;
    const turn = (dx, dy) => {
      state.turn += dx;
      state.tilt = Math.max(-1.5, Math.min(1.5, state.tilt + dy));
      redraw();
    };
    const zoom = (factor) => {
      state.zoom = Math.max(0.4, Math.min(6, state.zoom * factor));
      redraw();
    };
    this.canvas.addEventListener("pointerdown", (e) => {
      last = [e.clientX, e.clientY];
      this.canvas.setPointerCapture(e.pointerId);
    });
    this.canvas.addEventListener("pointermove", (e) => {
      if (last) {
        turn((e.clientX - last[0]) / 120, (e.clientY - last[1]) / 120);
        last = [e.clientX, e.clientY];
      }
    });
    this.canvas.addEventListener("pointerup", () => {
      last = null;
    });
    this.canvas.addEventListener(
      "wheel",
      (e) => {
        e.preventDefault();
        zoom(e.deltaY < 0 ? 1.1 : 1 / 1.1);
      },
      { passive: false },
    );
    this.canvas.addEventListener("keydown", (e) => {
      const by = { ArrowLeft: [-0.15, 0], ArrowRight: [0.15, 0], ArrowUp: [0, -0.15], ArrowDown: [0, 0.15] }[e.key];
      if (by) turn(...by);
      else if (e.key === "+") zoom(1.15);
      else if (e.key === "-") zoom(1 / 1.15);
      else return;
      e.preventDefault();
    });
    this.prepare();
  }

  prepare() {
    const gl = (this.gl = this.canvas.getContext("webgl", { antialias: true, preserveDrawingBuffer: true }));
    if (!gl) {
      this.label += " (this browser shows no WebGL)";
      return;
    }
    gl.getExtension("OES_standard_derivatives");
    const program = (this.program = gl.createProgram());
    for (const [kind, text] of [
      [gl.VERTEX_SHADER, VERTEX],
      [gl.FRAGMENT_SHADER, FRAGMENT],
    ]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    gl.useProgram(program);
    gl.enable(gl.DEPTH_TEST);
    const corners = [0, 1, 2, 0, 2, 3];
    const spread = (values) => {
      const out = [];
      for (let q = 0; q < values.length; q += 12)
        for (const c of corners) out.push(values[q + 3 * c], values[q + 3 * c + 1], values[q + 3 * c + 2]);
      return new Float32Array(out);
    };
    const at = spread(this.surface.reference_mm);
    const moved = spread(this.surface.displacement_mm);
    // The sphere that holds the specimen at rest and deformed.
    this.size = 0;
    for (let i = 0; i < at.length; i += 3) {
      this.size = Math.max(
        this.size,
        Math.hypot(at[i], at[i + 1], at[i + 2]),
        Math.hypot(at[i] + moved[i], at[i + 1] + moved[i + 1], at[i + 2] + moved[i + 2]),
      );
    }
    this.surfaceData = { at, moved };
    this.frame = frameOf(this.surface);
  }

  put(name, data) {
    const gl = this.gl;
    const place = gl.getAttribLocation(this.program, name);
    this.buffers ??= {};
    this.buffers[name] ??= gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[name]);
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.DYNAMIC_DRAW);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 0, 0);
  }

  /** Draws triangles or lines of { at, moved, tint }. */
  shape(data, kind, isPlain) {
    const gl = this.gl;
    for (const name of ["at", "moved", "tint"]) this.put(name, data[name]);
    gl.uniform1f(gl.getUniformLocation(this.program, "plain"), isPlain ? 1 : 0);
    gl.drawArrays(kind, 0, data.at.length / 3);
  }

  /** Plates, grips and the drive, in the ink of the page. */
  drawFrame() {
    if (!this.frame) return;
    const ink = getComputedStyle(this.canvas)
      .color.match(/[\d.]+/g)
      .slice(0, 3)
      .map((v) => v / 255);
    const tint = new Float32Array(this.frame.at.length).map((_, i) => ink[i % 3]);
    this.shape({ ...this.frame, tint }, this.gl.LINES, true);
  }

  tint([low, high]) {
    if (!this.gl) return;
    const out = [];
    for (const value of this.surface[this.state.what]) {
      const c = colour(value, low, high);
      for (let i = 0; i < 6; i += 1) out.push(...c);
    }
    this.surfaceData.tint = new Float32Array(out);
    this.draw();
  }

  draw() {
    const gl = this.gl;
    if (!gl || !this.surfaceData.tint || !this.canvas.isConnected) return;
    const { canvas, state } = this;
    const ratio = Math.min(2, devicePixelRatio || 1);
    canvas.width = Math.max(1, canvas.clientWidth * ratio);
    canvas.height = Math.max(1, canvas.clientHeight * ratio);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const [ct, st, cx, sx] = [Math.cos(state.turn), Math.sin(state.turn), Math.cos(state.tilt), Math.sin(state.tilt)];
    const wide = canvas.width / canvas.height;
    const k = state.zoom / this.size;
    const [fx, fy] = wide > 1 ? [(1.15 * k) / wide, 1.15 * k] : [k, k * wide];
    const z = 0.15 * k;
    // Turn about z (the width), tilt about the screen's x; y of the specimen comes forward.
    const rows = [
      [ct, -st, 0],
      [st * sx, ct * sx, cx],
      [st * cx, ct * cx, -sx],
    ];
    const view = new Float32Array([
      rows[0][0] * fx,
      rows[1][0] * fy,
      rows[2][0] * z,
      0,
      rows[0][1] * fx,
      rows[1][1] * fy,
      rows[2][1] * z,
      0,
      rows[0][2] * fx,
      rows[1][2] * fy,
      rows[2][2] * z,
      0,
      0,
      0,
      0,
      1,
    ]);
    gl.uniformMatrix4fv(gl.getUniformLocation(this.program, "view"), false, view);
    gl.uniform1f(gl.getUniformLocation(this.program, "amount"), state.amount);
    this.shape(this.surfaceData, gl.TRIANGLES, false);
    this.drawFrame();
  }
}
