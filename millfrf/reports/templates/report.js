"use strict";
const reportPage = (() => {
  const say = words => { document.getElementById("said").textContent = words; };

  function button(words, name, act) {
    const made = document.createElement("button");
    made.type = "button";
    made.textContent = words;
    if (name) made.setAttribute("aria-label", name);
    made.addEventListener("click", act);
    return made;
  }

  async function toClipboard(text) {
    try {
      await navigator.clipboard.writeText(text);
      return true;
    } catch {  // a browser that gives pages from files no clipboard
      const field = document.createElement("textarea");
      field.value = text;
      document.body.append(field);
      field.select();
      const done = document.execCommand("copy");
      field.remove();
      return done;
    }
  }

  const cells = row => [...row.cells].map(cell => cell.textContent.trim().replace(/\s+/g, " ")).join("\t");

  document.querySelectorAll("div.table").forEach((place, k) => {
    const table = place.querySelector("table");
    const copy = button("Copy", `Copy table ${k + 1}`, async () => {
      const done = await toClipboard([...table.rows].map(cells).join("\n"));
      copy.textContent = done ? "Copied" : "Not copied";
      say(done ? `Table ${k + 1} is on the clipboard, ${table.tBodies[0].rows.length} rows` : "The browser forbids copying");
      setTimeout(() => { copy.textContent = "Copy"; }, 2000);
    });
    const tools = document.createElement("div");
    tools.className = "tools end copy";
    tools.append(copy);
    place.before(tools);
    // only a table that is wider than its place is scrolled, and so needs a stop of the Tab key
    new ResizeObserver(() => {
      if (place.scrollWidth > place.clientWidth) place.tabIndex = 0; else place.removeAttribute("tabindex");
    }).observe(place);
  });

  // a link to a folded section opens it
  const opened = () => document.getElementById(location.hash.slice(1))?.closest("details")?.setAttribute("open", "");
  addEventListener("hashchange", opened);
  opened();

  let closed = [];
  addEventListener("beforeprint", () => {
    closed = [...document.querySelectorAll("details:not([open])")];
    closed.forEach(one => { one.open = true; });
  });
  addEventListener("afterprint", () => closed.forEach(one => { one.open = false; }));
  return { button, say };
})();
