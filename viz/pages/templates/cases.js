(function () {
  "use strict";
  const box = document.currentScript.parentElement;
  const columns = JSON.parse(box.querySelector('script[type="application/json"]').textContent);
  const most = Number(box.dataset.rows), body = box.querySelector("tbody"), heads = [...box.querySelectorAll("th")];
  const tools = box.querySelector(".tools"), where = box.querySelector(".where");
  const numeric = heads.map((h) => h.classList.contains("number"));
  const all = columns[0].map((_, k) => k);
  const filters = heads.map(() => "");
  let order = all.slice(), rows = all, start = 0, sorted = -1, rising = true;

  // ">12", "<=3", "2..4", "=5" for numbers; any part of a word otherwise
  function test(text, number) {
    text = text.trim();
    if (!text) return null;
    const range = /^(-?[\d.eE+-]+)\s*\.\.\s*(-?[\d.eE+-]+)$/.exec(text);
    if (number && range) {
      const low = Number(range[1]), high = Number(range[2]);
      return (v) => v !== null && v >= low && v <= high;
    }
    const sign = /^(>=|<=|>|<|=)\s*(.+)$/.exec(text);
    if (number) {
      const asked = Number(sign ? sign[2] : text), how = sign ? sign[1] : "=";
      if (Number.isNaN(asked)) return () => false;
      return (v) => v !== null && (how === ">" ? v > asked : how === "<" ? v < asked
        : how === ">=" ? v >= asked : how === "<=" ? v <= asked : v === asked);
    }
    const part = text.toLowerCase();
    return (v) => String(v === null ? "" : v).toLowerCase().includes(part);
  }

  function filter() {
    const tests = filters.map((text, j) => test(text, numeric[j]));
    rows = order.filter((k) => tests.every((t, j) => t === null || t(columns[j][k])));
    start = 0;
    draw();
  }

  function sort(j) {
    rising = sorted === j ? !rising : true;
    sorted = j;
    const values = columns[j], way = rising ? 1 : -1;
    order = all.slice().sort((a, b) => {
      const x = values[a], y = values[b];
      if (x === y) return a - b;
      if (x === null) return 1;
      if (y === null) return -1;
      return (x < y ? -1 : 1) * way;
    });
    heads.forEach((h, i) => h.setAttribute("aria-sort", i === j ? (rising ? "ascending" : "descending") : "none"));
    filter();
  }

  function draw() {
    const shown = rows.slice(start, start + most), lines = document.createDocumentFragment();
    for (const k of shown) {
      const line = document.createElement("tr");
      columns.forEach((values, j) => {
        const cell = document.createElement("td");
        if (numeric[j]) cell.className = "number";
        cell.textContent = values[k] === null ? "" : values[k];
        if (cell.textContent.length > 30) cell.title = cell.textContent;
        line.append(cell);
      });
      lines.append(line);
    }
    body.replaceChildren(lines);
    const from = rows.length ? start + 1 : 0;
    where.textContent = `${from} to ${start + shown.length} of ${rows.length}` +
      (rows.length < all.length ? `, filtered from ${all.length}` : "");
    tools.querySelector(".back").disabled = start === 0;
    tools.querySelector(".on").disabled = start + most >= rows.length;
  }

  heads.forEach((h, j) => {
    const button = document.createElement("button"), field = document.createElement("input");
    button.type = "button";
    button.textContent = h.textContent;
    button.addEventListener("click", () => sort(j));
    field.type = "search";
    field.placeholder = numeric[j] ? ">0" : "part";
    field.setAttribute("aria-label", `filter ${h.textContent}`);
    field.addEventListener("input", () => { filters[j] = field.value; filter(); });
    h.replaceChildren(button, field);
  });
  tools.querySelector(".back").addEventListener("click", () => { start = Math.max(0, start - most); draw(); });
  tools.querySelector(".on").addEventListener("click", () => { start += most; draw(); });
  tools.querySelector(".clear").addEventListener("click", () => {
    filters.fill("");
    box.querySelectorAll("input").forEach((field) => { field.value = ""; });
    filter();
  });
  tools.hidden = false;
  draw();
})();
