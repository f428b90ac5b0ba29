"use strict";
// The gauge explorer: controls, four drawings and the numbers. gaugeMath computes, d3 draws.
const gaugeExplorer = (() => {
  const element = (id) => document.getElementById(id);
  if (!element("explorer-data")) return null;
  const style = getComputedStyle(document.documentElement);
  const colour = (name) => style.getPropertyValue(`--${name}`).trim();
  // The figures' palette.
  const COLOURS = { fix: colour("fix"), prior: colour("prior"), free: colour("free"), motion: colour("free"), keyframe: colour("keyframe"), centroid: colour("centroid") };
  const HELD = [240, 228, 66];
  const GREY = "#8C8C8C";
  const FIX = { kind: "fix" };
  const NOTES = {
    fix: "Gauge fixation: the first position and heading cannot move, so their rows are zero (yellow).",
    keyframe: "The position and heading of one keyframe are held; its ellipse is a point.",
    centroid: "The mean position and the mean heading of all keyframes are held.",
    motion: "Nothing is held: of all gauges that constrain the motion alone, this one has the least trace, all three added.",
    free: "The free gauge of the paper, the pseudo-inverse of the whole Hessian. Landmarks hold it as well, so the motion has four degrees of freedom more, and its NEES and log det are not those of the others.",
    prior: "Fixation, and on top the freedom that the prior leaves along the orbit.",
  };
  const data = JSON.parse(element("explorer-data").textContent);
  const loaded = new Map();
  const form = element("gauge-form");
  const orbitForm = element("orbit-form");
  const pair = [element("pair-i"), element("pair-j")];
  let clicked = 0;

  function estimate(index) {
    if (!loaded.has(index)) {
      const e = gaugeMath.estimate(data[index]);
      e.fixed = results(e, FIX);
      e.free = gaugeMath.covariance(e, { kind: "motion" });
      loaded.set(index, e);
    }
    return loaded.get(index);
  }

  function results(e, gauge) {
    const C = gaugeMath.covariance(e, gauge);
    const found = gaugeMath.consistency(e, gauge);
    const worse = gaugeMath.consistency(e, gauge, "_noisier");
    return { C, traces: gaugeMath.traces(e, C), ...found, logDetDifference: worse.logDet - found.logDet, slope: gaugeMath.slope(e, gauge) };
  }

  function chosen() {
    return {
      kind: form.elements.kind.value,
      keyframe: Number(form.elements.keyframe.value),
      weight: 10 ** Number(form.elements.weight.value),
      reading: form.elements.reading.value,
    };
  }

  const sigma = (e, C, k) => Math.sqrt([0, 1, 2].reduce((sum, axis) => sum + Math.max(0, C[(3 * k + axis) * (e.n + 1)]), 0));
  const short = (value) => {
    if (!Number.isFinite(value)) return "not known";
    const size = Math.abs(value);
    return size !== 0 && (size < 1e-3 || size >= 1e6) ? value.toExponential(5) : Number(value.toPrecision(6)).toString();
  };

  function ellipse(e, C, k) {
    const [a, b, c] = [C[3 * k * (e.n + 1)], C[3 * k * e.n + 3 * k + 1], C[(3 * k + 1) * (e.n + 1)]];
    const [mean, half] = [(a + c) / 2, Math.hypot((a - c) / 2, b)];
    const root = (value) => Math.sqrt(Math.max(0, value));
    return { major: root(mean + half), minor: root(mean - half), angle: (Math.atan2(2 * b, a - c) / 2) * (180 / Math.PI) };
  }

  // A covariance is linear. A turn leaves its tangent by half its angle (rad): a share of 9 % at this limit.
  const YAW_LIMIT = 10;

  // Where the linear covariance says nothing any more about errors, in words; empty elsewhere.
  function tooLarge(e, C) {
    const keyframes = d3.range(e.N);
    const yaw = (180 / Math.PI) * d3.max(keyframes, (k) => Math.sqrt(Math.max(0, C[(3 * e.N + 3 * k + 2) * (e.n + 1)])));
    const position = d3.max(keyframes, (k) => ellipse(e, C, k).major);
    const reach = d3.max(keyframes, (k) => Math.hypot(e.p_W[3 * k] - e.p_W[0], e.p_W[3 * k + 1] - e.p_W[1]));
    const found = [];
    if (yaw > YAW_LIMIT) found.push(`the yaw has a standard deviation of ${yaw.toPrecision(3)}°, and above ${YAW_LIMIT}° a turn bends away from its tangent by more than 9 % of its length`);
    if (position > reach) found.push(`a position has one of ${position.toPrecision(3)} m, and the flight reaches only ${reach.toPrecision(3)} m from its start`);
    return found.length ? `Too large for a linear covariance: ${found.join("; ")}. Ellipses and traces here say that this freedom is open, not how large errors are.` : "";
  }

  // The largest of 1, 2, 5, 10, ... that keeps the largest ellipse within a share of the flight.
  function enlargement(extent, largest, share) {
    const steps = [...Array(6).keys()].flatMap((power) => [1, 2, 5].map((step) => step * 10 ** power));
    return Math.max(1, ...steps.filter((step) => step * largest <= share * extent));
  }

  function drawTop(e, now, tint) {
    const [width, height, margin] = [520, 400, 46];
    const x = Array.from({ length: e.N }, (_, k) => e.p_W[3 * k]);
    const y = Array.from({ length: e.N }, (_, k) => e.p_W[3 * k + 1]);
    const extent = Math.max(d3.max(x) - d3.min(x), d3.max(y) - d3.min(y));
    const ellipses = x.map((_, k) => ellipse(e, now.C, k));
    const fixed = d3.max(x.map((_, k) => ellipse(e, e.fixed.C, k).major));
    const largest = d3.max(ellipses, (one) => one.major);
    const usual = enlargement(extent, fixed, 0.2);
    const scale = Math.min(usual, enlargement(extent, largest, 0.4));
    // Metres are as long in y as in x.
    const perMetre = Math.min((width - 2 * margin) / (1.3 * (d3.max(x) - d3.min(x)) + 1e-9), (height - 2 * margin) / (1.3 * (d3.max(y) - d3.min(y)) + 1e-9));
    const middle = [(d3.max(x) + d3.min(x)) / 2, (d3.max(y) + d3.min(y)) / 2];
    const across = [(width - margin) / 2 / perMetre, (height - margin) / 2 / perMetre];
    const X = d3.scaleLinear([middle[0] - across[0], middle[0] + across[0]], [margin, width]);
    const Y = d3.scaleLinear([middle[1] - across[1], middle[1] + across[1]], [height - margin, 0]);
    const svg = d3.select("#top-view");
    svg.selectAll("g.axis").data([0, 1]).join("g").attr("class", "axis")
      .attr("transform", (axis) => (axis ? `translate(${margin},0)` : `translate(0,${height - margin})`))
      .each(function (axis) { d3.select(this).call(axis ? d3.axisLeft(Y).ticks(6) : d3.axisBottom(X).ticks(7)); });
    svg.selectAll("text.label").data(["x (m)", "y (m)"]).join("text").attr("class", "label")
      .attr("transform", (_, k) => (k ? "translate(12,175) rotate(-90)" : `translate(${width / 2 + 20},${height - 10})`)).text((text) => text);
    const line = d3.line((k) => X(x[k]), (k) => Y(y[k]));
    svg.selectAll("path.flight").data([0]).join("path").attr("class", "flight").attr("d", line(d3.range(e.N))).attr("stroke", GREY);
    svg.selectAll("ellipse").data(ellipses).join("ellipse")
      .attr("transform", (one, k) => `translate(${X(x[k])},${Y(y[k])}) rotate(${-one.angle})`)
      .attr("rx", (one) => one.major * scale * perMetre).attr("ry", (one) => one.minor * scale * perMetre)
      .attr("stroke", tint).attr("fill", tint);
    drawPerturbation(svg, e, now, x, y, X, Y, extent, tint);
    const [i, j] = pair.map((input) => Number(input.value));
    svg.selectAll("circle.keyframe").data(d3.range(e.N)).join("circle").attr("class", "keyframe")
      .attr("cx", (k) => X(x[k])).attr("cy", (k) => Y(y[k])).attr("r", (k) => (k === i || k === j ? 6 : 3.5))
      .classed("chosen", (k) => k === i || k === j)
      .attr("tabindex", 0).attr("role", "button").attr("aria-pressed", (k) => k === i || k === j)
      .attr("aria-label", (k) => `keyframe ${k}`)
      .on("click", (_, k) => choose(k))
      .on("keydown", (event, k) => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); choose(k); } });
    svg.selectAll("text.number").data([...new Set([i, j])]).join("text").attr("class", "number")
      .attr("x", (k) => X(x[k]) + 9).attr("y", (k) => Y(y[k]) - 8).text((k) => k);
    const smaller = scale < usual ? ` (the other gauges: ${usual} times)` : "";
    element("top-note").textContent = `Ellipses: one standard deviation of x and y, enlarged ${scale} times${smaller}. Dots: keyframes, from 0 to ${e.N - 1}.`;
  }

  // The error of Fig. 8 as displacements of the keyframes: as it is, and projected onto the gauge.
  function drawPerturbation(svg, e, now, x, y, X, Y, extent, tint) {
    const lines = [];
    if (orbitForm.elements.shown.checked) {
      const { a, b } = perturbation(e);
      const centre = [d3.mean(x), d3.mean(y)];
      // The turn of the chart is about the centroid.
      const turn = [a, a * centre[1], -a * centre[0], 0];
      const back = now.slope.map((value) => value * b);
      const moved = (k, axis, along) => b * e.direction[3 * k + axis] + along.reduce((sum, value, c) => sum + value * e.U[(3 * k + axis) * 4 + c], 0);
      const tips = x.map((_, k) => [turn, back].map((along) => [moved(k, 0, along), moved(k, 1, along)]));
      const factor = enlargement(extent, d3.max(tips.flat(), (tip) => Math.hypot(...tip)), 0.2);
      tips.forEach((two, k) => two.forEach((tip, which) => lines.push({ k, which, tip: [x[k] + factor * tip[0], y[k] + factor * tip[1]] })));
    }
    svg.selectAll("line.moved").data(lines).join("line").attr("class", "moved")
      .attr("x1", (l) => X(x[l.k])).attr("y1", (l) => Y(y[l.k])).attr("x2", (l) => X(l.tip[0])).attr("y2", (l) => Y(l.tip[1]))
      .attr("stroke", (l) => (l.which ? tint : "#000")).attr("stroke-width", (l) => (l.which ? 3 : 1.5));
  }

  function drawSigmas(e, now, tint) {
    const [width, height, margin] = [520, 210, 46];
    const curves = [
      // The first is drawn below the others: dashes stay visible on it.
      { name: "here", C: now.C, colour: tint, dash: null, width: 2.8 },
      { name: "free gauge of the motion", C: e.free, colour: COLOURS.free, dash: "2 3", width: 1.2 },
      { name: "first pose held", C: e.fixed.C, colour: COLOURS.fix, dash: "5 3", width: 1.2 },
    ].map((curve) => ({ ...curve, mm: d3.range(e.N).map((k) => 1e3 * sigma(e, curve.C, k)) }));
    const X = d3.scaleLinear([0, e.N - 1], [margin, width - 8]);
    const Y = d3.scaleLinear([0, d3.max(curves, (curve) => d3.max(curve.mm))], [height - 34, 14]).nice();
    const svg = d3.select("#sigmas");
    svg.selectAll("g.axis").data([0, 1]).join("g").attr("class", "axis")
      .attr("transform", (axis) => (axis ? `translate(${margin},0)` : `translate(0,${height - 34})`))
      .each(function (axis) { d3.select(this).call(axis ? d3.axisLeft(Y).ticks(5) : d3.axisBottom(X).ticks(Math.min(10, e.N))); });
    svg.selectAll("path.curve").data(curves).join("path").attr("class", "curve").attr("d", (curve) => d3.line((_, k) => X(k), (value) => Y(value))(curve.mm))
      .attr("stroke", (curve) => curve.colour).attr("stroke-dasharray", (curve) => curve.dash).attr("stroke-width", (curve) => curve.width);
    svg.selectAll("text.label").data(["keyframe"]).join("text").attr("class", "label").attr("x", width / 2).attr("y", height - 3).text((text) => text);
    d3.select("#sigmas-key").selectAll("span").data(curves).join("span").text((curve) => curve.name)
      .style("border-top", (curve) => `${curve.dash ? 2 : 4}px ${curve.dash ? "dashed" : "solid"} ${curve.colour}`);
  }

  function drawMatrix(e, now) {
    const canvas = element("matrix");
    canvas.width = canvas.height = e.n;
    const context = canvas.getContext("2d");
    const image = context.createImageData(e.n, e.n);
    const [low, high] = [-7, Math.log10(d3.max(now.C, Math.abs) + 1e-7)];
    const variances = d3.range(e.n).map((i) => now.C[i * (e.n + 1)]);
    const held = variances.map((value) => value <= 1e-9 * d3.median(variances));
    now.C.forEach((value, k) => {
      const [row, column] = [Math.floor(k / e.n), k % e.n];
      const grey = 255 * (1 - (Math.log10(Math.abs(value) + 1e-7) - low) / (high - low));
      image.data.set(held[row] || held[column] ? [...HELD, 255] : [grey, grey, grey, 255], 4 * k);
    });
    context.putImageData(image, 0, 0);
    const count = held.filter(Boolean).length;
    drawScale(10 ** low, 10 ** high);
    const about = `Rows and columns: all positions (m), all rotations (rad), all velocities (m/s). An entry has the units of its row times those of its column. ${count ? `Yellow: ${count} parameters that are held.` : "No single parameter is held."}`;
    canvas.setAttribute("aria-label", `Covariance matrix. ${about}`);
    element("matrix-note").textContent = about;
    canvas.onpointermove = (event) => {
      const place = [event.offsetY / canvas.clientHeight, event.offsetX / canvas.clientWidth].map((share) => Math.min(e.n - 1, Math.max(0, Math.floor(share * e.n))));
      const names = place.map((k) => `${["p", "φ", "v"][Math.floor(k / (3 * e.N))]}${Math.floor((k % (3 * e.N)) / 3)},${"xyz"[k % 3]}`);
      element("matrix-note").textContent = `Covariance of ${names[0]} and ${names[1]}: ${now.C[place[0] * e.n + place[1]].toExponential(4)}`;
    };
    canvas.onpointerleave = () => { element("matrix-note").textContent = about; };
  }

  // The grey levels of the matrix, whose entries have 1e-7 added as in Figs. 9 and 10.
  function drawScale(low, high) {
    const X = d3.scaleLog([low, high], [30, 490]);
    const svg = d3.select("#scale");
    svg.selectAll("linearGradient").data([0]).join("linearGradient").attr("id", "greys")
      .selectAll("stop").data(["#fff", "#000"]).join("stop").attr("offset", (_, k) => k).attr("stop-color", (grey) => grey);
    svg.selectAll("rect").data([0]).join("rect").attr("x", X(low)).attr("width", X(high) - X(low)).attr("height", 14).attr("fill", "url(#greys)");
    svg.selectAll("g.axis").data([0]).join("g").attr("class", "axis").attr("transform", "translate(0,14)").call(d3.axisBottom(X).ticks(5, "~e"));
    svg.selectAll("text.label").data([0]).join("text").attr("class", "label").attr("x", 260).attr("y", 52).text("|entry| + 1e-7, in products of m, rad, m/s");
  }

  // In the chart of Fig. 8: yaw along the orbit (rad) and share of the way to the start across it. The widest
  // yaw has room for what the projection moves in every gauge.
  function widest(e) {
    if (!e.widest) {
      const gauges = [FIX, { kind: "centroid" }, { kind: "motion" }, ...d3.range(e.N).map((keyframe) => ({ kind: "keyframe", keyframe }))];
      e.widest = 1.25 * Math.max(1e-4, ...gauges.map((gauge) => Math.abs(gaugeMath.slope(e, gauge)[0])));
    }
    return e.widest;
  }

  function perturbation(e) {
    const [place, a, b] = ["place", "a", "b"].map((name) => Number(orbitForm.elements[name].value));
    return { place: place * widest(e), a: a * widest(e), b };
  }

  function drawOrbit(e, now, gauge, tint) {
    const [radius, unit, centre, reach] = [420, 150, [260, 640], 0.5];
    const at = (alpha, s) => {
      const angle = (reach * alpha) / widest(e);
      return [centre[0] + (radius + unit * s) * Math.sin(angle), centre[1] - (radius + unit * s) * Math.cos(angle)];
    };
    const { place, a, b } = perturbation(e);
    const kappa = now.slope[0];
    const curve = (points) => d3.line()(points.map(([alpha, s]) => at(alpha, s)));
    const along = (from, to, s) => d3.range(41).map((k) => [from + ((to - from) * k) / 40, s]);
    const paths = [
      { points: along(-1.35 * widest(e), 1.35 * widest(e), 0), stroke: "#000", width: 2.5 },
      { points: d3.range(-0.3, 1.2, 0.05).map((s) => [kappa * s, s]), stroke: tint, width: 2.5, dash: "7 4" },
      { points: along(place + a, a, b), stroke: GREY, width: 1.3, dash: "2 3" },
      { points: along(a, kappa * b, b), stroke: GREY, width: 1.3, dash: "2 3" },
      { points: [[place, 0], [place + a, b]], stroke: "#000", width: 2, arrow: true },
      { points: [[0, 0], [a, b]], stroke: GREY, width: 2, arrow: true },
      { points: [[0, 0], [kappa * b, b]], stroke: tint, width: 3, arrow: true },
    ];
    const svg = d3.select("#orbit");
    svg.selectAll("marker").data([0]).join("marker").attr("id", "tip").attr("viewBox", "0 0 10 10").attr("refX", 8).attr("refY", 5)
      .attr("markerWidth", 5).attr("markerHeight", 5).attr("orient", "auto").html('<path d="M0 0 10 5 0 10z" fill="context-stroke"/>');
    svg.selectAll("path.line").data(paths).join("path").attr("class", "line").attr("d", (p) => curve(p.points)).attr("stroke", (p) => p.stroke)
      .attr("stroke-width", (p) => p.width).attr("stroke-dasharray", (p) => p.dash ?? null).attr("marker-end", (p) => (p.arrow ? "url(#tip)" : null));
    const words = [
      { text: "orbit: estimates of the same cost", at: at(0, -0.43), anchor: "middle", fill: "#000" },
      { text: "gauge", at: at(1.2 * kappa, 1.22), anchor: "middle", fill: tint },
      { text: "Δθ", at: at(place + a, b + 0.1), anchor: "middle", fill: "#000" },
      { text: "carried", at: at(a, b + 0.1), anchor: "middle", fill: "#555" },
      { text: "QΔθ", at: at(kappa * b + 0.05 * widest(e), b + 0.04), anchor: "start", fill: tint },
      { text: "θ", at: at(place, -0.2), anchor: "middle", fill: "#000" },
      { text: "θC", at: at(0.06 * widest(e), -0.13), anchor: "middle", fill: "#000" },
    ];
    svg.selectAll("text").data(words).join("text").attr("x", (w) => w.at[0]).attr("y", (w) => w.at[1]).attr("text-anchor", (w) => w.anchor).attr("fill", (w) => w.fill).text((w) => w.text);
    const handles = [{ name: "estimate", at: at(place, 0) }, { name: "error", at: at(place + a, b) }];
    const set = (name, value) => { const input = orbitForm.elements[name]; input.value = Math.min(input.max, Math.max(input.min, value)); };
    svg.selectAll("circle").data(handles).join("circle").attr("cx", (h) => h.at[0]).attr("cy", (h) => h.at[1]).attr("r", 9)
      .call(d3.drag().on("drag", (event, handle) => {
        const [dx, dy] = [event.x - centre[0], centre[1] - event.y];
        const angle = Math.atan2(dx, dy) / reach;
        const start = Number(orbitForm.elements.place.value);
        if (handle.name === "estimate") set("place", angle);
        else { set("a", angle - start); set("b", (Math.hypot(dx, dy) - radius) / unit); }
        draw();
      }).subject((event) => ({ x: event.x, y: event.y })));
    const degrees = (value) => `${((value * 180) / Math.PI).toPrecision(3)}°`;
    const left = gauge.kind === "prior" ? ` The prior then leaves a yaw of ${degrees(1 / Math.sqrt(gaugeMath.information(gauge)))} (one standard deviation) open.` : "";
    element("orbit-note").textContent = `The error turns the estimate by ${degrees(a)} along the orbit and moves it ${b.toFixed(2)} of the way to the start across it. In this gauge the part along the orbit is no error: what is left turns it by ${degrees(kappa * b)}, whatever you drag along the orbit.${left}`;
  }

  function rows(id, list) {
    d3.select(id).selectAll("tr").data(list).join("tr").html(([name, here, there]) => `<th scope="row">${name}</th><td>${here}</td><td>${there}</td>`);
  }

  function numbers() {
    const e = estimate(Number(form.elements.estimate.value));
    const gauge = chosen();
    const now = results(e, gauge);
    const [i, j] = pair.map((input) => Number(input.value));
    const relative = i === j ? null : gaugeMath.relative(e, now.C, i, j);
    return { e, gauge, now, i, j, relative, fixed: i === j ? null : gaugeMath.relative(e, e.fixed.C, i, j) };
  }

  function draw() {
    const { e, gauge, now, i, j, relative, fixed } = numbers();
    const tint = COLOURS[gauge.kind];
    form.elements["keyframe-text"].textContent = gauge.keyframe;
    form.elements["weight-text"].textContent = `${short(gauge.weight)}, information ${gaugeMath.information(gauge).toExponential(1)}`;
    form.elements.keyframe.disabled = gauge.kind !== "keyframe";
    for (const input of [form.elements.weight, ...form.elements.reading]) input.disabled = gauge.kind !== "prior";
    element("gauge-note").textContent = NOTES[gauge.kind];
    const warning = tooLarge(e, now.C);
    Object.assign(element("too-large"), { textContent: warning, hidden: !warning });
    drawTop(e, now, tint);
    drawSigmas(e, now, tint);
    drawMatrix(e, now);
    drawOrbit(e, now, gauge, tint);
    rows("#changes", [["positions, m²", 0], ["rotations, rad²", 1], ["velocities, (m/s)²", 2]].map(([name, k]) => [name, short(now.traces[k]), short(e.fixed.traces[k])]));
    const size = (C, from) => Math.sqrt(C[from * 7] + C[(from + 1) * 7] + C[(from + 2) * 7]);
    const between = relative
      ? [[`σ of ${j} seen from ${i}: position, mm`, short(1e3 * size(relative, 0)), short(1e3 * size(fixed, 0))], ["the same: rotation, mrad", short(1e3 * size(relative, 3)), short(1e3 * size(fixed, 3))]]
      : [["relative pose", "choose two keyframes", ""]];
    rows("#stays", [
      ...between,
      ["NEES (degrees of freedom)", `${short(now.nees)} (${now.dof})`, `${short(e.fixed.nees)} (${e.fixed.dof})`],
      [`rise of log det if images were ${e.noisier} times as noisy`, `+${short(now.logDetDifference)}`, `+${short(e.fixed.logDetDifference)}`],
    ]);
  }

  function choose(k) {
    pair[clicked].value = k;
    clicked = 1 - clicked;
    draw();
  }

  function reset() {
    const { N } = estimate(Number(form.elements.estimate.value));
    form.elements.keyframe.max = N - 1;
    form.elements.keyframe.value = Math.floor(N / 2);
    pair.forEach((input, side) => { input.max = N - 1; input.value = side ? N - 1 : Math.floor(N / 2); });
    draw();
  }

  form.addEventListener("input", (event) => (event.target.name === "estimate" ? reset() : draw()));
  orbitForm.addEventListener("input", draw);
  for (const input of pair) {
    input.addEventListener("input", () => {
      const k = Math.round(Number(input.value));
      if (input.value !== "" && k >= 0 && k <= Number(input.max)) draw();
    });
  }
  for (const one of [form, orbitForm]) one.addEventListener("submit", (event) => event.preventDefault());
  // Browsers keep what a form said before a reload; the drawings start anew.
  for (const one of [form, orbitForm]) one.reset();
  reset();
  return { numbers };
})();
