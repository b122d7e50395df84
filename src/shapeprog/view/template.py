"""The page of the interactive view: plain WebGL, no library and no network."""
# ruff: noqa: E501

HTML = r"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>shapeprog</title>
<style>
:root { --ink: #26282c; --faint: #7c8088; --rule: #e3e5e9; }
* { box-sizing: border-box; }
body { margin: 0; height: 100vh; display: flex; color: var(--ink); background: #fff;
  font: 14px/1.45 system-ui, -apple-system, "Segoe UI", "DejaVu Sans", sans-serif; }
#view { flex: 1; position: relative; min-width: 0; }
canvas { width: 100%; height: 100%; display: block; touch-action: none; cursor: grab; }
canvas:active { cursor: grabbing; }
#bar { position: absolute; left: 16px; top: 14px; display: flex; gap: 6px; }
button { font: inherit; font-size: 13px; padding: 4px 11px; border: 1px solid var(--rule); border-radius: 6px;
  background: #fffffff0; color: var(--faint); cursor: pointer; }
button.on { color: var(--ink); border-color: #9aa0a8; }
#tip { position: absolute; left: 16px; bottom: 14px; color: var(--faint); font-size: 12.5px; pointer-events: none; }
#side { width: min(46%, 640px); border-left: 1px solid var(--rule); padding: 20px 0; overflow: auto; }
h1 { font-size: 16px; margin: 0 22px 2px; overflow-wrap: anywhere; }
#facts { color: var(--faint); margin: 0 22px 14px; font-size: 13px; }
pre { margin: 0; font: 13px/1.6 ui-monospace, "DejaVu Sans Mono", Menlo, Consolas, monospace; }
.line { padding: 0 22px 0 60px; text-indent: -50px; cursor: default; white-space: pre-wrap; border-left: 3px solid transparent; }
.line.hot { background: #f2f4f7; border-left-color: #5b6472; }
.dot { display: inline-block; width: 9px; height: 9px; border-radius: 2px; margin-right: 9px; }
.loop { color: var(--faint); }
.number { color: #1f5fb0; }
#numbers { margin: 0 22px 14px; display: grid; grid-template-columns: max-content 1fr max-content; gap: 3px 12px; align-items: center;
  font-size: 13px; }
#numbers input { width: 100%; accent-color: #5b6472; }
#numbers output { text-align: right; font-variant-numeric: tabular-nums; }
#numbers .buttons { grid-column: 1 / -1; display: flex; gap: 6px; margin-top: 5px; }
b { font-weight: 600; }
@media (max-width: 760px) { body { flex-direction: column; } #side { width: 100%; height: 40%; border-left: 0;
  border-top: 1px solid var(--rule); } }
</style></head>
<body>
<div id="view"><canvas></canvas><div id="bar"></div><div id="tip"></div></div>
<div id="side"><h1></h1><div id="facts"></div><div id="numbers"></div><pre></pre></div>
<script type="application/json" id="data">@DATA@</script>
<script>
"use strict";
const data = JSON.parse(document.getElementById("data").textContent);
const canvas = document.querySelector("canvas"), tip = document.getElementById("tip");
const gl = canvas.getContext("webgl", { antialias: true, alpha: false, preserveDrawingBuffer: true });
document.querySelector("h1").textContent = document.title = data.title;
document.getElementById("facts").textContent = data.facts;
if (!gl) tip.textContent = "This browser has no WebGL, so only the program is shown.";

// The program: hovering a line lights its parts, hovering a part lights its line.
let hot = new Set(), pinned = null, mode = "program";
const written = {};  // Where the number of each name is written.
function piece([text, name]) {
  if (!name) return text;
  const found = document.createElement("span");
  found.className = "number";
  found.textContent = text;
  (written[name] = written[name] || []).push({ found, text });
  return found;
}
const rows = data.lines.map((line) => {
  const row = document.createElement("div"), dot = document.createElement("span");
  row.className = "line" + (line.colour ? "" : " loop");
  dot.className = "dot";
  dot.style.background = line.colour || "transparent";
  const word = document.createElement(line.colour ? "b" : "span");
  word.textContent = line.word;
  if (line.ink) word.style.color = line.ink;
  row.append(dot, ...(line.pieces ? line.pieces.map(piece) : [line.before, word, line.after]));
  row.onmouseenter = () => { if (!pinned) light(line.blocks); };
  row.onmouseleave = () => { if (!pinned) light([]); };
  row.onclick = () => { pinned = pinned === row ? null : row; light(line.blocks); };
  document.querySelector("pre").append(row);
  return row;
});
function light(blocks) {
  hot = new Set(blocks);
  data.lines.forEach((line, k) => rows[k].classList.toggle("hot", hot.size > 0 && (line.blocks.length === hot.size
    || line.blocks.length === 1) && line.blocks.every((block) => hot.has(block))));
  draw();
}
function button(name, where, act) {
  const made = document.createElement("button");
  made.textContent = name;
  made.onclick = act;
  where.append(made);
  return made;
}
const bar = document.getElementById("bar");
for (const name of data.input ? ["program", "input", "both"] : []) button(name, bar, () => { mode = name; marks(); draw(); });
function marks() { for (const b of bar.children) b.className = b.textContent === mode ? "on" : ""; }
marks();

// Numbers to drag: corners go straight between the places that the page was given for some values of each.
const panel = document.getElementById("numbers"), fine = 10 ** data.digits, short = (value) => String(Math.round(fine * value) / fine);
data.sliders.forEach((slider) => {
  const label = document.createElement("label"), input = document.createElement("input"), shown = document.createElement("output");
  label.textContent = label.htmlFor = input.id = slider.name;
  Object.assign(input, { type: "range", min: slider.low, max: slider.high, step: "any" });
  const blocks = data.parts.filter((_, k) => slider.places.some((place) => place.parts[k])).map((part) => part.block);
  slider.places = slider.places.map((place) => ({ ...place, parts: place.parts.map((part) => part && unpack(part, Float32Array)) }));
  slider.show = () => {
    input.value = slider.now;
    shown.textContent = slider.unit ? `${short(slider.now)} ${slider.unit}` : short(slider.now);
    for (const { found, text } of written[slider.name] || []) found.textContent = slider.now === slider.value ? text : short(slider.now);
  };
  input.oninput = () => { slider.now = Number(input.value); slider.show(); move(); draw(); };
  label.onmouseenter = input.onmouseenter = () => { if (!pinned) light(blocks); };
  label.onmouseleave = input.onmouseleave = () => { if (!pinned) light([]); };
  slider.now = slider.value;
  panel.append(label, input, shown);
});
if (data.sliders.length) {
  const buttons = document.createElement("div");
  buttons.className = "buttons";
  panel.append(buttons);
  button("as it was", buttons, () => { data.sliders.forEach((slider) => { slider.now = slider.value; slider.show(); }); move(); draw(); });
  const copy = button("copy the program", buttons, async () => {
    await navigator.clipboard.writeText(rows.map((row) => row.textContent).join("\n") + "\n");
    copy.textContent = "copied";
    setTimeout(() => { copy.textContent = "copy the program"; }, 1500);
  });
  data.sliders.forEach((slider) => slider.show());
}
function along(slider, part, start) {  // What is between the known places on both sides of a value; beyond them straight on.
  const known = [{ at: slider.value, corners: start }, ...slider.places.map((place) => ({ at: place.at, corners: place.parts[part] || start }))];
  known.sort((a, b) => a.at - b.at);
  let k = 0;
  while (k < known.length - 2 && slider.now > known[k + 1].at) k++;
  const [low, high] = [known[k], known[k + 1]];
  return { low: low.corners, high: high.corners, share: (slider.now - low.at) / (high.at - low.at) };
}
function move() {
  data.parts.forEach((part, k) => {
    const moving = data.sliders.filter((slider) => slider.now !== slider.value && slider.places.some((place) => place.parts[k]));
    if (!moving.length && !part.moved) return;
    part.moved = moving.length > 0;
    const start = part.start, now = Float32Array.from(start);
    for (const slider of moving) {
      const { low, high, share } = along(slider, k, start);
      for (let i = 0; i < now.length; i++) now[i] += low[i] + share * (high[i] - low[i]) - start[i];
    }
    if (gl) fill(parts[k], now);
  });
}

function unpack(text, kind) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new kind(bytes.buffer);
}
function fill(item, corners) {  // Triangles as position + normal, lines as positions.
  const lines = new Float32Array(3 * item.creases.length);
  item.creases.forEach((corner, k) => lines.set(corners.subarray(6 * corner, 6 * corner + 3), 3 * k));
  for (const [buffer, values] of [[item.triangles, corners], [item.lines, lines]]) {
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
  }
}
function load(item) {
  item.start = unpack(item.triangles, Float32Array);
  const creases = unpack(item.creases, Uint32Array);
  const made = { ...item, creases, triangles: gl.createBuffer(), lines: gl.createBuffer(), count: item.start.length / 6, ends: creases.length };
  fill(made, item.start);
  return made;
}
const shader = (kind, source) => {
  const made = gl.createShader(kind);
  gl.shaderSource(made, source);
  gl.compileShader(made);
  if (!gl.getShaderParameter(made, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(made));
  return made;
};
let program, at, eye, parts = [], input = null, picks;
function start() {
  program = gl.createProgram();
  gl.attachShader(program, shader(gl.VERTEX_SHADER, `
    attribute vec3 place, facing; uniform mat4 camera; uniform vec3 shift; varying vec3 normal;
    void main() { normal = facing; gl_Position = camera * vec4(place + shift, 1.0); }`));
  gl.attachShader(program, shader(gl.FRAGMENT_SHADER, `
    precision mediump float; varying vec3 normal; uniform vec4 colour; uniform float flat_; uniform vec3 eye;
    void main() {
      vec3 n = normalize(normal); if (dot(n, eye) < 0.0) n = -n;
      float light = 0.56 + 0.14 * n.y + 0.36 * max(0.0, dot(n, normalize(vec3(-0.45, 0.85, 0.55))));
      gl_FragColor = vec4(colour.rgb * mix(light, 1.0, flat_), colour.a); }`));
  gl.linkProgram(program);
  gl.useProgram(program);
  at = (name) => gl.getUniformLocation(program, name);
  parts = data.parts.map(load);
  input = data.input && load(data.input);
  picks = gl.createFramebuffer();
}

// The camera circles a point: drag turns, wheel or pinch zooms, right button or shift moves, double click resets.
const home = { turn: 0.62, rise: 0.44, far: data.radius * 3.9, x: 0, y: 0 };
let camera = { ...home };
function matrix(width, height) {
  const { turn, rise, far } = camera, f = 1 / Math.tan(0.27), near = Math.max(far - 2 * data.radius, far / 40), deep = far + 2 * data.radius;
  const c = Math.cos(turn), s = Math.sin(turn), cr = Math.cos(rise), sr = Math.sin(rise);
  const right = [c, 0, -s], up = [-s * sr, cr, -c * sr], back = [s * cr, sr, c * cr], m = data.middle;
  const dot = (v) => v[0] * m[0] + v[1] * m[1] + v[2] * m[2];
  const zoom = Math.min(1, width / height);
  const a = (f * height / width) * zoom, b = f * zoom, p = (deep + near) / (near - deep), q = (2 * deep * near) / (near - deep);
  const t = [camera.x - dot(right), camera.y - dot(up), -far - dot(back)];
  const out = [];
  for (let k = 0; k < 3; k++) out.push(a * right[k], b * up[k], p * back[k], -back[k]);
  return { back, values: new Float32Array([...out, a * t[0], b * t[1], p * t[2] + q, -t[2]]) };
}
function mesh(item, colour, flat) {
  gl.uniform4fv(at("colour"), colour);
  gl.uniform1f(at("flat_"), flat);
  gl.bindBuffer(gl.ARRAY_BUFFER, item.triangles);
  for (const [name, start] of [["place", 0], ["facing", 12]]) {
    const where = gl.getAttribLocation(program, name);
    gl.enableVertexAttribArray(where);
    gl.vertexAttribPointer(where, 3, gl.FLOAT, false, 24, start);
  }
  gl.drawArrays(gl.TRIANGLES, 0, item.count);
}
function outline(item, colour) {
  gl.uniform4fv(at("colour"), colour);
  gl.uniform1f(at("flat_"), 1);
  gl.uniform3fv(at("shift"), eye.map((c) => 0.07 * c));  // Lines lie a little nearer than the faces they bound.
  gl.bindBuffer(gl.ARRAY_BUFFER, item.lines);
  gl.disableVertexAttribArray(gl.getAttribLocation(program, "facing"));
  gl.vertexAttribPointer(gl.getAttribLocation(program, "place"), 3, gl.FLOAT, false, 12, 0);
  gl.drawArrays(gl.LINES, 0, item.ends);
  gl.uniform3fv(at("shift"), [0, 0, 0]);
}
function prepare(width, height) {
  gl.viewport(0, 0, width, height);
  gl.clearColor(1, 1, 1, 0);
  gl.enable(gl.DEPTH_TEST);
  gl.depthMask(true);
  gl.depthFunc(gl.LESS);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  const { back, values } = matrix(width, height);
  eye = back;
  gl.uniformMatrix4fv(at("camera"), false, values);
  gl.uniform3fv(at("eye"), eye);
}
function draw() {
  if (!gl) return;
  const ratio = Math.max(1, window.devicePixelRatio || 1);
  const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  prepare(width, height);
  gl.disable(gl.BLEND);
  const grey = [0.83, 0.843, 0.863, 1];
  gl.enable(gl.POLYGON_OFFSET_FILL);  // Of faces that lie on each other the first part's is seen.
  if (mode !== "input") parts.forEach((part, k) => {
    gl.polygonOffset(0, 256 * k);
    const pale = hot.size && !hot.has(part.block);
    mesh(part, [...part.colour.map((c) => (pale ? 0.25 * c + 0.68 : c)), 1], 0);
    outline(part, pale ? [0.7, 0.7, 0.72, 1] : [...part.colour.map((c) => 0.35 * c), 1]);
  });
  gl.disable(gl.POLYGON_OFFSET_FILL);
  if (input && mode === "input") { mesh(input, grey, 0); outline(input, [0.35, 0.36, 0.38, 1]); }
  if (input && mode === "both") {
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    outline(input, [0.1, 0.11, 0.13, 0.75]);
    gl.depthMask(false);
    mesh(input, [0.6, 0.62, 0.66, 0.3], 0);
    gl.depthMask(true);
  }
}
function pick(x, y) {  // Which part is under the pointer: every part in a colour of its own, off the screen.
  const width = canvas.width, height = canvas.height;
  if (!gl || mode === "input" || !width) return null;
  const texture = gl.createTexture(), depth = gl.createRenderbuffer();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, width, height, 0, gl.RGBA, gl.UNSIGNED_BYTE, null);
  gl.bindRenderbuffer(gl.RENDERBUFFER, depth);
  gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT16, width, height);
  gl.bindFramebuffer(gl.FRAMEBUFFER, picks);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
  gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, depth);
  prepare(width, height);
  gl.disable(gl.BLEND);
  parts.forEach((part, k) => mesh(part, [((k + 1) & 255) / 255, ((k + 1) >> 8) / 255, 0, 1], 1));
  const pixel = new Uint8Array(4), ratio = width / canvas.clientWidth;
  gl.readPixels(Math.round(x * ratio), height - 1 - Math.round(y * ratio), 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  gl.deleteTexture(texture);
  gl.deleteRenderbuffer(depth);
  return pixel[3] ? parts[pixel[0] + 256 * pixel[1] - 1] : null;
}
const help = "drag to turn, wheel to zoom, shift-drag to move, double-click to reset";
const held = new Map();
canvas.onpointerdown = (e) => { held.set(e.pointerId, e); canvas.setPointerCapture(e.pointerId); };
canvas.onpointerup = canvas.onpointercancel = (e) => held.delete(e.pointerId);
canvas.onpointermove = (e) => {
  const last = held.get(e.pointerId);
  if (!last) {
    const part = pick(e.offsetX, e.offsetY);
    tip.textContent = part ? part.name : help;
    if (!pinned) light(part ? [part.block] : []);
    return;
  }
  const dx = e.clientX - last.clientX, dy = e.clientY - last.clientY;
  if (held.size === 2) {
    const other = [...held.values()].find((p) => p.pointerId !== e.pointerId);
    const length = (p) => Math.hypot(p.clientX - other.clientX, p.clientY - other.clientY);
    camera.far *= length(last) / Math.max(1, length(e));
  } else if (e.shiftKey || e.buttons & 2) {
    const unit = (camera.far * 0.55) / canvas.clientHeight;
    camera.x += dx * unit; camera.y -= dy * unit;
  } else {
    camera.turn -= dx * 0.008;
    camera.rise = Math.max(-1.55, Math.min(1.55, camera.rise + dy * 0.008));
  }
  held.set(e.pointerId, e);
  draw();
};
canvas.onpointerleave = () => { if (!pinned) light([]); };
canvas.oncontextmenu = (e) => e.preventDefault();
canvas.ondblclick = () => { camera = { ...home }; draw(); };
canvas.addEventListener("wheel", (e) => { e.preventDefault(); camera.far *= Math.exp(e.deltaY * 0.001); draw(); }, { passive: false });
window.onresize = draw;
if (gl) { start(); tip.textContent = help; }
draw();
</script></body></html>
"""
