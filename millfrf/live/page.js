"use strict";
// Everything that comes from a file or a user is set as text (textContent) or drawn on a canvas, never as HTML.

const byId = (id) => document.getElementById(id);
const figures = new Map(); // name of a figure -> its bokeh document
let socket = null;
let newest = null;
let scheduled = false;
let ended = false;

function unpacked(value) {
  if (Array.isArray(value)) return value.map(unpacked);
  if (value === null || typeof value !== "object") return value;
  const bytes = Uint8Array.from(atob(value.f4), (letter) => letter.charCodeAt(0));
  return new Float32Array(bytes.buffer);
}

function columnsOf(packed) {
  const columns = {};
  for (const [name, value] of Object.entries(packed)) columns[name] = unpacked(value);
  if ("x_of_all" in columns) {
    columns.xs = columns.ys.map(() => columns.x_of_all);
    delete columns.x_of_all;
  }
  return columns;
}

function drawFigure(doc, name, content) {
  for (const [source, packed] of Object.entries(content.sources)) {
    doc.get_model_by_name(source).data = columnsOf(packed);
  }
  const figure = doc.get_model_by_name(name);
  if ("title" in content) figure.title.text = content.title;
  const axis = figure.left[0];
  if ("y_label" in content) axis.axis_label = content.y_label;
  if ("ticks" in content) {
    axis.major_label_overrides = new Map(Object.entries(content.ticks).map(([at, text]) => [Number(at), text]));
  }
}

function drawStatus(status) {
  byId("state").textContent = status.state;
  byId("line").textContent = status.line;
  for (const name of ["start", "mark", "stop"]) byId(name).disabled = !status[name];
  byId("cut").hidden = !status.cut;
  if (status.cut) {
    byId("cut").textContent = `cut: ${status.cut.line || status.cut.state}`;
    byId("cut").className = status.cut.state;
  }
  ended = status.state === "ended";
}

function rowOf(kind, cells) {
  const row = document.createElement("tr");
  for (const cell of cells) {
    const element = document.createElement(kind);
    element.textContent = cell;
    row.append(element);
  }
  return row;
}

function drawTests(tests) {
  byId("tests").hidden = !tests;
  if (!tests) return;
  byId("advice").textContent = tests.advice;
  byId("tests").querySelector("thead").replaceChildren(rowOf("th", tests.columns));
  const rows = tests.rows.map(({ state, cells }) => {
    const row = rowOf("td", cells);
    row.className = state;
    return row;
  });
  byId("tests").querySelector("tbody").replaceChildren(...rows);
  const notes = tests.notes.map((note) => {
    const item = document.createElement("li");
    item.textContent = note;
    return item;
  });
  byId("notes").replaceChildren(...notes);
}

function draw() {
  scheduled = false;
  const told = newest;
  newest = null;
  if (!told) return;
  drawStatus(told.status);
  drawTests(told.tests);
  for (const [name, content] of Object.entries(told.figures)) {
    if (figures.has(name)) drawFigure(figures.get(name), name, content);
  }
  say({ drawn: true });
}

function say(message) {
  if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
}

function connect() {
  const address = new URL("live", location.href);
  address.protocol = "ws:";
  socket = new WebSocket(address);
  socket.onopen = choose;
  socket.onmessage = (event) => {
    newest = JSON.parse(event.data);
    if (!scheduled) {
      scheduled = true;
      // a hidden page gets no animation frames; it draws all the same, so that it stays connected
      if (document.hidden) setTimeout(draw, 0);
      else requestAnimationFrame(draw);
    }
  };
  socket.onclose = () => {
    for (const name of ["start", "mark", "stop"]) byId(name).disabled = true;
    if (ended) return;
    byId("state").textContent = "no connection";
    setTimeout(connect, 2000);
  };
}

function choose() {
  if (byId("choices").hidden) return;
  const spectra = [...byId("spectra-of").querySelectorAll("input:checked")].map((box) => Number(box.value));
  say({
    show: { response: byId("response").selectedIndex, excitation: byId("excitation").selectedIndex, spectra },
  });
}

function offer(names, first) {
  if (!names.responses.length || !names.excitations.length) return;
  for (const [id, options] of [["response", names.responses], ["excitation", names.excitations]]) {
    byId(id).replaceChildren(...options.map((name) => new Option(name)));
    byId(id).selectedIndex = first[id];
    byId(id).onchange = choose;
  }
  [...names.excitations, ...names.responses].forEach((name, number) => {
    const label = document.createElement("label");
    const box = document.createElement("input");
    box.type = "checkbox";
    box.value = number;
    box.checked = first.spectra.includes(number);
    box.onchange = choose;
    label.append(box, document.createTextNode(` ${name}`));
    byId("spectra-of").append(label);
  });
  byId("choices").hidden = false;
}

async function begin() {
  const page = await (await fetch("figures.json")).json();
  for (const [name, item] of Object.entries(page.figures)) {
    await Bokeh.embed.embed_item(item, name);
    figures.set(name, Bokeh.documents[Bokeh.documents.length - 1]);
  }
  offer(page.names, page.first);
  byId("start").onclick = () => say({ start: "" });
  byId("stop").onclick = () => say({ stop: "" });
  byId("mark").onclick = () => {
    say({ mark: byId("note").value });
    byId("note").value = "";
  };
  connect();
}

begin();
