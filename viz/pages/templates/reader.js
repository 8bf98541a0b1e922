// figures are read off by pointing, enlarged by dragging; without this they are the pictures that are printed
(function () {
  "use strict";
  const hint = "Point at a curve to read it off; drag over a part to enlarge it, double click for the whole.";
  const shown = (v) => Number(v.toPrecision(4)).toString();
  for (const svg of document.querySelectorAll("figure svg[data-axes]")) {
    const axes = JSON.parse(svg.dataset.axes), whole = svg.getAttribute("viewBox").split(" ").map(Number);
    const says = document.createElement("p"), band = document.createElementNS(svg.namespaceURI, "rect");
    says.className = "reading";
    says.textContent = hint;
    svg.after(says);
    band.setAttribute("class", "band");
    let start = null;

    // points of a curve in the figure's own units, and whether they only go on to the right
    function points(id) {
      const drawn = svg.querySelector('[id$="-' + id + '"] path');
      const numbers = drawn ? (drawn.getAttribute("d").match(/-?[\d.]+(?:e-?\d+)?/g) || []).map(Number) : [];
      const found = [];
      for (let i = 0; i + 1 < numbers.length; i += 2) found.push([numbers[i], numbers[i + 1]]);
      return { at: found, onward: found.every((p, i) => i === 0 || p[0] >= found[i - 1][0]) };
    }
    for (const one of axes) one.lines = one.curves.map(([id, name]) => ({ name, ...points(id) }));

    function place(event) {
      const p = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
      return [p.x, p.y];
    }
    function nearest(line, x, y) {
      const far = (p) => (line.onward ? Math.abs(p[0] - x) : Math.hypot(p[0] - x, p[1] - y));
      return line.at.reduce((best, p) => (best === null || far(p) < far(best) ? p : best), null);
    }
    function read([x, y]) {
      const one = axes.find((a) => x >= a.box[0] && x <= a.box[0] + a.box[2] && y >= a.box[1] && y <= a.box[1] + a.box[3]);
      if (!one) return hint;
      const across = (v) => one.x[0] + ((v - one.box[0]) / one.box[2]) * (one.x[1] - one.x[0]);
      const up = (v) => one.y[1] - ((v - one.box[1]) / one.box[3]) * (one.y[1] - one.y[0]);
      const told = one.lines.filter((l) => l.at.length).map((l) => {
        const p = nearest(l, x, y);
        return (l.name.startsWith("_") ? "" : l.name + " ") + shown(up(p[1])) + (l.onward ? "" : " at " + shown(across(p[0])));
      });
      return one.across + ": " + shown(across(x)) + "; " + one.up + ": " + told.join(", ");
    }
    function look(box) { svg.setAttribute("viewBox", box.join(" ")); }
    function frame(to) {
      return [Math.min(start[0], to[0]), Math.min(start[1], to[1]), Math.abs(to[0] - start[0]), Math.abs(to[1] - start[1])];
    }

    svg.addEventListener("pointerdown", (event) => { start = place(event); });
    svg.addEventListener("pointermove", (event) => {
      const here = place(event);
      says.textContent = read(here);
      if (start === null || event.pointerType === "touch") return;
      ["x", "y", "width", "height"].forEach((name, i) => band.setAttribute(name, frame(here)[i]));
      svg.append(band);
    });
    svg.addEventListener("pointerup", (event) => {
      band.remove();
      if (start === null || event.pointerType === "touch") return;
      const [x, y, w, h] = frame(place(event));
      start = null;
      if (w < 6 || h < 6) return;
      const part = Math.max(w / whole[2], h / whole[3]), size = [part * whole[2], part * whole[3]];  // of the same shape
      look([x + 0.5 * (w - size[0]), y + 0.5 * (h - size[1]), ...size]);
    });
    svg.addEventListener("pointerleave", () => { start = null; band.remove(); says.textContent = hint; });
    svg.addEventListener("dblclick", () => look(whole));
    window.addEventListener("beforeprint", () => look(whole));
  }
})();
