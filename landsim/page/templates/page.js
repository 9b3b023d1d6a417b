"use strict";
(() => {
  const read = (id) => JSON.parse(document.getElementById(id).textContent);
  const config = read("config");
  const plots = [];
  for (const figure of read("figures")) {
    const places = document.getElementById(`figure-${figure.name}`).querySelectorAll(".plot");
    figure.panels.forEach((panel, i) => plots.push({ place: places[i], panel }));
  }
  const draw = ({ place, panel }) => {
    panel.height = panel.layout.height; // Plotly writes into the layout
    place.style.height = `${panel.height}px`;
    return Plotly.newPlot(place, panel.data, panel.layout, config).then(() => place.classList.add("drawn"));
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

  // On paper each panel is as wide as its column there, and less high; afterwards it is as it was.
  const PAPER = 680;
  const GAP = 16;
  const LOWER = 0.6;
  const drawn = () => plots.filter(({ place }) => place.classList.contains("drawn"));
  window.addEventListener("beforeprint", () =>
    drawn().forEach(({ place, panel }) => {
      const columns = place.closest(".columns-1") ? 1 : 2;
      const height = Math.round((place.closest(".list, .grid") ? 1 : LOWER) * panel.height);
      place.style.height = `${height}px`;
      Plotly.relayout(place, { width: Math.floor((PAPER - GAP * (columns - 1)) / columns), height, autosize: false });
    }),
  );
  window.addEventListener("afterprint", () =>
    drawn().forEach(({ place, panel }) => {
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
