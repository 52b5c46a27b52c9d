"use strict";
(async () => {
  const byId = name => document.getElementById(name);
  const status = byId("status");
  const say = (words, wrong = false) => { status.textContent = words; status.className = wrong ? "wrong" : ""; };
  const page = await (await fetch("page.json")).json();
  byId("name").textContent = `: ${page.name}`;
  document.title = `Pick poles: ${page.name}`;
  let chosen = page.chosen.map(pair => [...pair]);
  let entry = 0, asked = 0, over = false;

  // Figures: the range of frequency is one, and sources are found by their names.
  function untabbed(root) {  // what bokeh draws has nothing for the keyboard: the buttons beside it do
    for (const one of root.querySelectorAll("*")) {
      if (one.hasAttribute("tabindex")) one.tabIndex = -1;
      if (one.shadowRoot) untabbed(one.shadowRoot);
    }
  }
  async function drawn(item, place) {
    const model = [...await Bokeh.embed.embed_item(item, byId(place))][0].model;
    untabbed(byId(place));
    return { model, all: [...model.references()], find(name) { return this.all.find(one => one.name === name); } };
  }
  const chart = await drawn(page.chart, "chart"), frf = await drawn(page.frfs, "frf");
  const ranges = [chart.find("frequency"), frf.find("frequency")];
  ranges.forEach((one, k) => {
    const tell = () => {
      const other = ranges[1 - k];
      if (other.start !== one.start || other.end !== one.end) other.setv({ start: one.start, end: one.end });
    };
    one.properties.start.change.connect(tell);
    one.properties.end.change.connect(tell);
  });
  const move = (shift, scale) => {
    const one = ranges[0], middle = (one.start + one.end) / 2, half = (one.end - one.start) / 2;
    one.setv({ start: middle + half * (shift - scale), end: middle + half * (shift + scale) });
  };
  const columnsOf = source => Object.fromEntries(source.data instanceof Map ? source.data : Object.entries(source.data));
  const decoded = text => new Float32Array(Uint8Array.from(atob(text), letter => letter.charCodeAt(0)).buffer);
  const filled = (source, columns) => {
    const values = Object.fromEntries(Object.entries(columns).map(([key, text]) => [key, decoded(text)]));
    source.data = { ...columnsOf(source), ...values };
  };

  // The choice: by chart, lists and numbers; each change is fitted at once.
  const near = ([f, zeta], [g, other]) => Math.hypot((f - g) / f, 0.3 * (zeta - other)) < 0.5 * Math.max(zeta, other, 2e-3);
  const same = ([f, zeta], [g, other]) => Math.abs(f - g) < 1e-6 * f && Math.abs(zeta - other) < 1e-6;
  const place = pole => chosen.findIndex(one => same(one, pole));
  function toggle(pole, alike = same) {
    const k = chosen.findIndex(one => alike(one, pole));
    if (k >= 0) chosen.splice(k, 1); else chosen.push([...pole]);
    changed();
  }
  function cell(row, content, tag = "td") {
    const made = document.createElement(tag);
    if (tag === "th") made.scope = "row";
    made.append(content);
    row.append(made);
  }
  function button(words, name, act) {
    const made = document.createElement("button");
    made.type = "button";
    made.textContent = words;
    made.setAttribute("aria-label", `${words}: ${name}`);
    made.addEventListener("click", act);
    return made;
  }
  function number(value, name, take) {
    const field = document.createElement("input");
    field.type = "number";
    field.step = "any";
    field.value = String(+value.toPrecision(8));
    field.setAttribute("aria-label", name);
    field.addEventListener("change", () => take(Number(field.value)));
    return field;
  }
  function list() {
    const focus = document.activeElement && document.activeElement.getAttribute("aria-label");
    const rows = byId("chosen").tBodies[0], offered = byId("offered").tBodies[0];
    rows.replaceChildren(...chosen.map((pole, k) => {
      const row = document.createElement("tr"), name = `pole ${k + 1}`;
      cell(row, String(k + 1), "th");
      cell(row, number(pole[0], `frequency of ${name}, Hz`, value => { pole[0] = value; changed(); }));
      cell(row, number(100 * pole[1], `damping ratio of ${name}, per cent`, value => { pole[1] = value / 100; changed(); }));
      cell(row, button("Drop", `${name} at ${pole[0].toFixed(2)} Hz`, () => { chosen.splice(k, 1); changed(); }));
      return row;
    }));
    offered.replaceChildren(...page.groups.map(group => {
      const row = document.createElement("tr"), pole = [group.frequency_hz, group.damping_ratio];
      cell(row, String(group.group), "th");
      [pole[0].toFixed(3), (100 * pole[1]).toFixed(3), String(group.n_orders), group.taken ? "taken" : group.reason].forEach(one => cell(row, one));
      cell(row, button(place(pole) >= 0 ? "Drop" : "Accept", `group ${group.group} at ${pole[0].toFixed(2)} Hz`, () => toggle(pole)));
      return row;
    }));
    const again = focus && [...document.querySelectorAll("button, input")].find(one => {
      const label = one.getAttribute("aria-label");
      return label === focus || (label && label.replace(/^(Drop|Accept)/, "") === focus.replace(/^(Drop|Accept)/, ""));
    });
    if (again) again.focus();
  }
  function mark() {
    const f = chosen.map(one => one[0]), zeta = chosen.map(one => 100 * one[1]);
    const top = Math.max(...page.chart_top, 1);
    chart.find("chosen").data = { f, zeta, low: f.map(() => 0), high: f.map(() => top) };
  }
  async function send(name, body) {
    const answer = await fetch(name, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) });
    if (!answer.ok) throw new Error(`the program answers ${answer.status}; is it still running?`);
    return answer.json();
  }
  async function changed() {
    chosen.sort((one, other) => one[0] - other[0]);
    list();
    mark();
    const mine = ++asked;
    say(`Fitting ${chosen.length} poles …`);
    try {
      const made = await send("fit", { poles: chosen, entry });
      if (mine !== asked) return;  // a later choice is on its way
      byId("warnings").replaceChildren(...(made.warnings || []).map(one => Object.assign(document.createElement("li"), { textContent: one })));
      if (made.error) { say(made.error, true); return; }
      filled(frf.find("fitted"), made.fitted);
      const [low, middle, high] = made.misfits.map(one => one.toPrecision(2));
      say(`${chosen.length} poles: misfit of this FRF ${made.misfit.toPrecision(2)} %, of all FRFs ${low} to ${high} % (median ${middle} %).`);
    } catch (error) {
      say(error.message, true);
    }
  }

  // A click takes the pole that is nearest on the screen, up to 14 pixels away.
  page.chart_top = [chart.find("top").end];
  const panels = ["orders", "damping"].map(name => chart.find(name));
  panels.forEach((panel, k) => panel.on_event("tap", event => {
    const wide = (panel.x_range.end - panel.x_range.start) / panel.inner_width;
    const tall = (panel.y_range.end - panel.y_range.start) / panel.inner_height;
    let best = null, least = 14;
    page.poles.forEach(([f, zeta, order]) => {
      const apart = Math.hypot((f - event.x) / wide, ((k ? 100 * zeta : order) - event.y) / tall);
      if (apart < least) { least = apart; best = [f, zeta]; }
    });
    if (best) toggle(best, near); else say("No pole is near; click nearer to a mark.", true);
  }));

  page.choices.forEach((choice, k) => byId("entry").add(new Option(choice.label, k)));
  byId("entry").addEventListener("change", event => {
    entry = Number(event.target.value);
    filled(frf.find("measured"), page.choices[entry].sources.measured);
    frf.all.filter(one => one.type === "DataRange1d").forEach(one => one.reset());
    changed();
  });
  byId("closer").addEventListener("click", () => move(0, 0.5));
  byId("farther").addEventListener("click", () => move(0, 2));
  byId("lower").addEventListener("click", () => move(-0.5, 1));
  byId("higher").addEventListener("click", () => move(0.5, 1));
  byId("all").addEventListener("click", () => ranges[0].setv({ start: page.band[0], end: page.band[1] }));
  byId("add").addEventListener("submit", event => {
    event.preventDefault();
    chosen.push([Number(byId("new-frequency").value), Number(byId("new-damping").value) / 100]);
    changed();
  });
  byId("again").addEventListener("click", () => { chosen = page.chosen.map(pair => [...pair]); changed(); });
  for (const [name, words] of [["save", "Saved. The fit goes on in the terminal; this page can be closed."], ["leave", "Left; nothing was saved. This page can be closed."]]) {
    byId(name).addEventListener("click", async () => {
      if (over) return;
      try {
        const answer = await send(name, { poles: chosen, entry });
        if (answer.error) { say(answer.error, true); return; }
        over = true;
        document.querySelectorAll("button, input, select").forEach(one => { one.disabled = true; });
        say(words);
      } catch (error) {
        say(error.message, true);
      }
    });
  }
  changed();
})().catch(error => { document.getElementById("status").textContent = `The page could not be drawn: ${error.message}`; });
