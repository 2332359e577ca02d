"use strict";
(() => {
  const all = (selector, root = document) => Array.from(root.querySelectorAll(selector));
  // Dark or light: the system's choice, until a reader makes one.
  const theme = document.getElementById("theme");
  if (theme) {
    theme.hidden = false;
    theme.addEventListener("click", () => {
      const dark = document.documentElement.dataset.theme
        ? document.documentElement.dataset.theme === "dark"
        : matchMedia("(prefers-color-scheme: dark)").matches;
      document.documentElement.dataset.theme = dark ? "light" : "dark";
    });
  }
  // A deep link opens what it points at.
  const reveal = () => {
    const name = location.hash.slice(1);
    let place = name && document.getElementById(name);
    if (!place) return;
    if (place.classList.contains("off")) { all("#filter [data-by]").forEach((e) => { e.value = ""; }); sieve(); }
    for (let up = place; up; up = up.parentElement) if (up.tagName === "DETAILS") up.open = true;
    place.scrollIntoView({ block: "start" });
    // rows that were not laid out yet had a guessed height: once they are, look again
    requestAnimationFrame(() => requestAnimationFrame(() => place.scrollIntoView({ block: "start" })));
  };
  // The filter.
  const form = document.getElementById("filter");
  const rows = all("#list .ob");
  const groups = all("#list > details:not(.ob)");
  const texts = rows.map((row) => row.textContent.toLowerCase());
  const shown = document.getElementById("shown");
  const sieve = () => {
    const wanted = {};
    all("[data-by]", form).forEach((e) => { wanted[e.dataset.by] = e.value.trim(); });
    const words = (wanted.words || "").toLowerCase().split(/\s+/).filter(Boolean);
    let n = 0;
    rows.forEach((row, i) => {
      const on = ["node", "kind", "status"].every((by) => !wanted[by] || row.dataset[by] === wanted[by])
        && (!wanted.methods || row.dataset.methods.split(" ").includes(wanted.methods))
        && words.every((word) => texts[i].includes(word));
      row.classList.toggle("off", !on);
      if (on) n += 1;
    });
    groups.forEach((group) => {
      group.classList.toggle("off", !group.querySelector(".ob:not(.off)"));
      group.open = n < rows.length;
    });
    shown.textContent = (n === rows.length ? "all " : n + " of ") + rows.length;
  };
  if (form) {
    form.hidden = false;
    let pending = 0;
    form.addEventListener("input", () => { clearTimeout(pending); pending = setTimeout(sieve, 80); });
    form.addEventListener("submit", (event) => event.preventDefault());
    const unfold = document.getElementById("unfold");
    unfold.addEventListener("click", () => {
      const visible = groups.filter((group) => !group.classList.contains("off"));
      const open = !visible.every((row) => row.open);
      visible.forEach((row) => { row.open = open; });
      unfold.textContent = open ? "fold all" : "unfold all";
    });
  }
  // What scrolls sideways can be reached and scrolled with the keyboard.
  const reachable = () => all(".scroll:not([role])").forEach((box) => {
    if (box.scrollWidth > box.clientWidth + 1) box.tabIndex = 0;
    else box.removeAttribute("tabindex");
  });
  let measuring = 0;
  const measure = () => { clearTimeout(measuring); measuring = setTimeout(reachable, 150); };
  addEventListener("resize", measure);
  document.addEventListener("toggle", measure, true);
  reachable();
  // Paper has no folds: what has something to tell is opened; good news keeps to its line, logs stay on the screen.
  let folded = [];
  const good = ["proved", "checked", "tested", "monitored", "reviewed", "justified", "argued"];
  addEventListener("beforeprint", () => {
    folded = all("details:not([open])").filter((d) => !d.parentElement.closest(".ob") && !("screen" in d.dataset) && !("advice" in d.dataset)
      && !(d.classList.contains("ob") && d.dataset.kind !== "guarantee" && good.includes(d.dataset.status)));
    if (folded.length < 3000) folded.forEach((d) => { d.open = true; });
  });
  addEventListener("afterprint", () => { folded.forEach((d) => { d.open = false; }); folded = []; });
  addEventListener("hashchange", reveal);
  reveal();
})();
