"use strict";
(() => {
  const read = (id) => JSON.parse(document.getElementById(id).textContent);
  const config = read("config");
  const plots = [];
  for (const figure of read("figures")) {
    const places = document.getElementById(`figure-${figure.name}`).querySelectorAll(".plot");
    figure.panels.forEach((panel, i) => plots.push({ place: places[i], panel }));
  }
  // Between the powers of ten of a logarithmic axis there are numbers where there is room for them.
  const FEW_DECADES = 1.3;
  const logTicks = (place) => {
    const change = {};
    for (const name of ["xaxis", "yaxis"]) {
      const axis = place.layout[name];
      const dtick = Math.abs(axis.range[1] - axis.range[0]) > FEW_DECADES ? 1 : "D2";
      if (axis.type === "log" && axis.dtick !== dtick) change[`${name}.dtick`] = dtick;
    }
    if (Object.keys(change).length) Plotly.relayout(place, change);
  };

  const drawn = new Set();
  const draw = (one) => {
    const { place, panel } = one;
    if (drawn.has(one)) return Promise.resolve();
    drawn.add(one);
    panel.height = panel.layout.height; // Plotly writes into the layout
    place.style.height = `${panel.height}px`;
    return Plotly.newPlot(place, panel.data, panel.layout, config).then(() => {
      place.classList.add("drawn");
      place.on("plotly_relayout", () => logTicks(place));
    });
  };

  // What is in sight is drawn first, the rest when there is time: a page of fifty panels is there at once.
  const drawAll = async () => {
    const height = window.innerHeight;
    const near = (one) => {
      const top = one.place.getBoundingClientRect().top;
      return top > -height && top < 2 * height ? 0 : 1;
    };
    for (const one of [...plots].sort((a, b) => near(a) - near(b))) {
      await draw(one);
      await new Promise((done) => setTimeout(done));
    }
    document.body.classList.add("ready");
  };

  // On paper each panel is as wide as its column there, and less high; afterwards it is as it was.  Plotly draws before
  // it returns, so that what was still waiting for its turn is on the sheet too.
  const PAPER = 680;
  const GAP = 16;
  const LOWER = 0.6;
  window.addEventListener("beforeprint", () =>
    plots.forEach((one) => {
      draw(one);
      const { place, panel } = one;
      const columns = place.closest(".columns-1") ? 1 : 2;
      const height = Math.round((place.closest(".list, .grid") ? 1 : LOWER) * panel.height);
      place.style.height = `${height}px`;
      Plotly.relayout(place, { width: Math.floor((PAPER - GAP * (columns - 1)) / columns), height, autosize: false });
    }),
  );
  window.addEventListener("afterprint", () =>
    plots.forEach(({ place, panel }) => {
      place.style.height = `${panel.height}px`;
      Plotly.relayout(place, { width: null, height: panel.height, autosize: true });
    }),
  );

  const copy = async (button, text) => {
    try {
      await navigator.clipboard.writeText(text.textContent);
      button.textContent = "copied";
    } catch {
      const range = document.createRange();
      range.selectNodeContents(text);
      const selection = window.getSelection();
      selection.removeAllRanges();
      selection.addRange(range);
      button.textContent = "selected";
    }
    setTimeout(() => (button.textContent = "copy"), 2000);
  };
  for (const button of document.querySelectorAll("button.copy")) {
    const text = button.closest(".copied, .code").querySelector("code");
    button.addEventListener("click", () => copy(button, text));
  }

  // The section in sight is marked in the contents.
  const links = new Map([...document.querySelectorAll("nav a")].map((a) => [a.hash.slice(1), a]));
  const seen = new IntersectionObserver(
    (entries) =>
      entries
        .filter((entry) => entry.isIntersecting)
        .forEach((entry) => {
          links.forEach((link) => link.removeAttribute("aria-current"));
          links.get(entry.target.id)?.setAttribute("aria-current", "true");
        }),
    { rootMargin: "-10% 0px -80% 0px" },
  );
  document.querySelectorAll("main > section").forEach((section) => seen.observe(section));

  drawAll();
})();
