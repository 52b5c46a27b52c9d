"use strict";
(() => {
  const shared = new Map();  // ranges by name; a change of one is a change of all

  function follow(range) {
    const others = shared.get(range.name) || [];
    shared.set(range.name, [...others, range]);
    if (others.length) range.setv({ start: others[0].start, end: others[0].end });
    const tell = () => shared.get(range.name).forEach(other => {
      if (other !== range && (other.start !== range.start || other.end !== range.end)) {
        other.setv({ start: range.start, end: range.end });
      }
    });
    range.properties.start.change.connect(tell);
    range.properties.end.change.connect(tell);
  }

  const decoded = text => new Float32Array(Uint8Array.from(atob(text), letter => letter.charCodeAt(0)).buffer);

  function choose(root, choice) {
    for (const [name, columns] of Object.entries(choice.sources)) {
      const source = root.find(name);
      const values = Object.fromEntries(Object.entries(columns).map(([key, text]) => [key, decoded(text)]));
      source.data = { ...Object.fromEntries(source.data instanceof Map ? source.data : Object.entries(source.data)), ...values };
    }
  }

  function move(range, shift, scale) {
    const middle = (range.start + range.end) / 2, half = (range.end - range.start) / 2;
    range.setv({ start: middle + half * (shift - scale), end: middle + half * (shift + scale) });
  }

  function untabbed(root) {  // what bokeh draws has nothing for the keyboard: the buttons beside it do
    for (const one of root.querySelectorAll("*")) {
      if (one.hasAttribute("tabindex")) one.tabIndex = -1;
      if (one.shadowRoot) untabbed(one.shadowRoot);
    }
  }

  async function unpacked(element) {
    const bytes = Uint8Array.from(atob(element.textContent), letter => letter.charCodeAt(0));
    return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
  }

  let library = null;  // the program that draws, started once, when the first figure needs it
  const started = () => library ??= unpacked(document.getElementById("library")).then(text => {
    const program = document.createElement("script");
    program.textContent = text;
    document.head.append(program);
  });

  async function draw(figure) {
    await started();
    const image = figure.querySelector("img");
    const item = JSON.parse(await unpacked(figure.querySelector("script.plot")));
    const choices = JSON.parse(await unpacked(figure.querySelector("script.choices")));
    const place = document.createElement("div");
    place.className = "plot";
    place.setAttribute("role", "group");
    place.setAttribute("aria-label", `${image.alt}; buttons move and zoom it`);
    const tools = document.createElement("div");
    tools.className = "tools";
    figure.prepend(tools, place);
    figure.classList.add("zoomed");
    const views = await Bokeh.embed.embed_item(item, place);
    untabbed(place);
    const model = [...views][0].model;
    const root = { find: name => [...model.references()].find(one => one.name === name) };
    const ranges = [...model.references()].filter(one => one.type === "Range1d" && ["frequency", "spindle speed"].includes(one.name));
    const range = ranges[0], first = { start: range.start, end: range.end };
    const yRanges = [...model.references()].filter(one => one.type === "DataRange1d");
    follow(range);
    const what = range.name;
    const control = (words, name, act) => tools.append(reportPage.button(words, name, act));
    if (choices.length > 1) {
      const list = document.createElement("select");
      choices.forEach((choice, k) => list.add(new Option(choice.label, k)));
      list.addEventListener("change", () => { choose(root, choices[list.value]); yRanges.forEach(one => one.reset()); });
      const label = document.createElement("label");
      label.append("Response / excitation ", list);
      tools.append(label);
    }
    control("+", `Zoom in on ${what}`, () => move(range, 0, 0.5));
    control("−", `Zoom out on ${what}`, () => move(range, 0, 2));
    control("←", `Lower ${what}`, () => move(range, -0.5, 1));
    control("→", `Higher ${what}`, () => move(range, 0.5, 1));
    control("All", `All: whole ${what} axis`, () => { range.setv(first); yRanges.forEach(one => one.reset()); });
    const swap = reportPage.button("Picture", "Show the picture in print form", () => {
      const shown = figure.classList.toggle("zoomed");
      swap.textContent = shown ? "Picture" : "Zoom";
      swap.setAttribute("aria-label", shown ? "Show the picture in print form" : "Show the figure that zooms");
    });
    tools.append(swap);
  }

  // A figure is drawn when it comes near the window; until then, and where it fails, its picture stands there.
  const watch = new IntersectionObserver(seen => seen.filter(one => one.isIntersecting).forEach(one => {
    watch.unobserve(one.target);
    draw(one.target).catch(error => { one.target.classList.remove("zoomed"); console.error(error); });
  }), { rootMargin: "600px" });
  document.querySelectorAll("figure:has(script.plot)").forEach(figure => watch.observe(figure));
})();
