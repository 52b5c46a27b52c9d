"use strict";
document.querySelectorAll("figure:has(script.moving)").forEach(figure => {
  const data = JSON.parse(figure.querySelector("script.moving").textContent);
  const image = figure.querySelector("img");
  const canvas = document.createElement("canvas"), pen = canvas.getContext("2d");
  const place = document.createElement("div"), tools = document.createElement("div");
  tools.className = "tools";
  place.className = "plot";
  canvas.tabIndex = 0;
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", `${image.alt}; arrow keys turn it, plus and minus zoom, the space bar plays`);
  place.append(canvas);
  figure.prepend(tools, place);
  figure.classList.add("zoomed");

  const axis = k => data.positions.map(p => p[k]);
  const middle = [0, 1, 2].map(k => (Math.max(...axis(k)) + Math.min(...axis(k))) / 2);
  const span = Math.max(...[0, 1, 2].map(k => Math.max(...axis(k)) - Math.min(...axis(k)))) || 1;
  const extent = [0, 1, 2].map(k => Math.max(...axis(k)) - Math.min(...axis(k)));
  const flat = 1.1 * Math.hypot(extent[0], extent[1]) || span, tall = 1.1 * Math.max(extent[2], 0.7 * Math.hypot(extent[0], extent[1])) || span;
  const moves = data.labels.length > 0;
  let heading = -1.0, height = 0.35, zoom = 1, phase = Math.PI / 2, mode = 0, share = 0.15;
  let playing = moves && !matchMedia("(prefers-reduced-motion: reduce)").matches, seen = false, wanted = false;

  function labelled(words, field) {
    const label = document.createElement("label");
    label.append(`${words} `, field);
    tools.append(label);
    return field;
  }
  let play = null;
  if (moves) {
    const list = labelled("Mode", document.createElement("select"));
    data.labels.forEach((label, k) => list.add(new Option(label, k)));
    list.addEventListener("change", () => { mode = Number(list.value); ask(); });
    const size = labelled("Exaggeration", document.createElement("input"));
    Object.assign(size, { type: "range", min: 0, max: 0.4, step: 0.01, value: share });
    size.addEventListener("input", () => { share = Number(size.value); ask(); });
    play = reportPage.button(playing ? "Pause" : "Play", "", () => {
      playing = !playing;
      play.textContent = playing ? "Pause" : "Play";
      ask();
    });
    tools.append(play);
  }
  for (const [words, h, v] of [["Front", -Math.PI / 2, 0], ["Side", 0, 0], ["Above", -Math.PI / 2, Math.PI / 2], ["Oblique", -1.0, 0.35]]) {
    tools.append(reportPage.button(words, `${words}: view of the structure`, () => { heading = h; height = v; ask(); }));
  }

  function project(p) {
    const [x, y, z] = p.map((v, k) => v - middle[k]);
    const u = -x * Math.sin(heading) + y * Math.cos(heading);
    const d = x * Math.cos(heading) + y * Math.sin(heading);
    const v = z * Math.cos(height) - d * Math.sin(height);
    const s = 0.75 * zoom * Math.min(canvas.width / flat, canvas.height / tall);
    return [canvas.width / 2 + s * u, canvas.height / 2 - s * v];
  }
  function line(a, b, colour, width) {
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    pen.beginPath();
    pen.moveTo(...project(a));
    pen.lineTo(...project(b));
    pen.stroke();
  }
  function dots(points, colour, radius, which) {
    pen.fillStyle = colour;
    points.forEach((p, k) => {
      if (which && !which(k)) return;
      pen.beginPath();
      pen.arc(...project(p), radius, 0, 7);
      pen.fill();
    });
  }
  function letters(unit) {
    const start = [0, 1, 2].map(k => Math.min(...axis(k)) - 0.06 * span);
    pen.font = `${14 * unit}px sans-serif`;
    ["x", "y", "z"].forEach((name, k) => {
      const end = [...start];
      end[k] += 0.18 * span;
      line(start, end, "#555", 1.5 * unit);
      const [u, v] = project(end);
      pen.fillStyle = "#333";
      pen.fillText(name, u + 4 * unit, v - 4 * unit);
    });
  }
  function frame() {
    wanted = false;
    const unit = Math.max(1, devicePixelRatio || 1), wide = Math.round(place.clientWidth * unit);
    if (canvas.width !== wide && wide) { canvas.width = wide; canvas.height = Math.round(Math.min(0.62 * wide, 520 * unit)); }
    if (playing) phase += 0.06;
    pen.clearRect(0, 0, canvas.width, canvas.height);
    letters(unit);
    data.lines.forEach(([a, b]) => line(data.positions[a], data.positions[b], "#c0c0c0", 4 * unit));
    dots(data.positions, "#c0c0c0", 3 * unit);
    data.axes.forEach(([a, b]) => line(a, b, "#222", 2 * unit));
    if (moves) {
      const c = share * span * Math.sin(phase), s = share * span * Math.cos(phase);
      const real = data.real[mode], imaginary = data.imaginary && data.imaginary[mode];
      const moved = data.positions.map((p, i) => p.map((v, k) => v + c * real[i][k] + (imaginary ? s * imaginary[i][k] : 0)));
      data.lines.forEach(([a, b]) => line(moved[a], moved[b], "#0072B2", 2 * unit));
      dots(moved, "#0072B2", 3.5 * unit, k => data.measured[k]);
      if (data.tip !== null) dots([moved[data.tip]], "#D55E00", 5 * unit);
    } else if (data.tip !== null) {
      dots([data.positions[data.tip]], "#D55E00", 5 * unit);
    }
    if (playing && seen) ask();
  }
  function ask() {
    if (!wanted) { wanted = true; requestAnimationFrame(frame); }
  }
  canvas.addEventListener("pointermove", event => {
    if (!event.buttons) return;
    heading -= event.movementX / 150;
    height = Math.max(-1.57, Math.min(1.57, height + event.movementY / 150));
    ask();
  });
  canvas.addEventListener("keydown", event => {
    const turns = { ArrowLeft: [0.1, 0], ArrowRight: [-0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[event.key];
    if (turns) { heading += turns[0]; height = Math.max(-1.57, Math.min(1.57, height + turns[1])); }
    else if (event.key === "+" || event.key === "=") zoom *= 1.15;
    else if (event.key === "-") zoom /= 1.15;
    else if (event.key === " " && play) play.click();
    else return;
    event.preventDefault();
    ask();
  });
  new ResizeObserver(ask).observe(place);
  new IntersectionObserver(found => { seen = found[0].isIntersecting; ask(); }).observe(place);
});
