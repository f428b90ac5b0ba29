"use strict";
// The ledger's filter, and evidence that opens when a link leads to it.
(() => {
  const form = document.getElementById("filter");
  const rows = [...document.querySelectorAll(".ledger tbody tr")];

  function filter() {
    const wanted = Object.fromEntries(new FormData(form));
    const words = wanted.text.toLowerCase().split(/\s+/).filter(Boolean);
    let shown = 0;
    for (const row of rows) {
      const text = row.textContent.toLowerCase();
      const fits =
        (!wanted.verdict || row.dataset.verdict === wanted.verdict) &&
        (!wanted.section || row.dataset.section === wanted.section) &&
        words.every((word) => text.includes(word));
      row.hidden = !fits;
      shown += fits;
    }
    form.querySelector("output").textContent = `${shown} of ${rows.length} claims`;
  }

  function open() {
    const target = document.getElementById(decodeURIComponent(location.hash.slice(1)));
    if (!target) return;
    if (target.hidden) form.reset();
    if (target.tagName === "DETAILS") target.open = true;
    target.scrollIntoView();
  }

  form.addEventListener("input", filter);
  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("reset", () => setTimeout(filter));
  addEventListener("hashchange", open);
  filter();
  open();
})();
